//! Checks that every live device that moves stops by itself without commands, and that no device keeps it from them.

use crate::device::{Driver, OnSilence};
use crate::graph::bench::OpenedBench;
use crate::graph::plan::PlannedDevice;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports live devices that move and do not declare how they stop, and simulators that a tick would wait for beside
/// them.
pub(crate) fn check(opened: &OpenedBench, diagnostics: &mut Diagnostics) {
    let is_live = |device: &&PlannedDevice| matches!(device.driver, Driver::Live(_));
    let moving = opened.devices.iter().filter(is_live).filter(|device| !device.description.commands.is_empty());
    diagnostics.extend(moving.filter_map(unwatched));
    let Some(live) = opened.devices.iter().find(is_live) else { return };
    for device in opened.devices.iter().filter(|device| matches!(device.driver, Driver::Lockstep(_))) {
        let message = format!(
            "device `{}` runs in lockstep, so a tick waits for it, but `{}` runs in real time",
            device.name, live.name
        );
        let diagnostic = Diagnostic::new(Code::BadClock, device.span.clone(), message);
        let help = "let the simulator run by its own clock: `\"lockstep\": false` in its hello message";
        diagnostics.push(diagnostic.note(live.span.clone(), "the device in real time is here").help(help));
    }
}

/// Reports a device that moves on when this process is silent, or does not say that it stops.
fn unwatched(device: &PlannedDevice) -> Option<Diagnostic> {
    let name = &device.name;
    let (message, help) = match &device.description.on_silence {
        None => (
            format!("device `{name}` moves, but does not declare when it stops without commands"),
            "call `Description::on_silence` in its `open`",
        ),
        Some(silence) if silence.reaction == (OnSilence::KeepsMoving { watchdog: None }) => (
            format!("device `{name}` keeps moving when its commands cease, and nothing stops it"),
            "let a program on the robot stop it, and name that: `watchdog = \"the program\"`",
        ),
        Some(_) => return None,
    };
    Some(Diagnostic::new(Code::UnwatchedDevice, device.span.clone(), message).help(help))
}
