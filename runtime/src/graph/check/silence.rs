//! Checks that every live device that moves stops by itself without commands, and that no device keeps it from them.

use crate::device::{Driver, OnSilence};
use crate::graph::bench::OpenedBench;
use crate::graph::net::Net;
use crate::graph::plan::{PlannedDevice, Producer};
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports live devices that move and do not declare how they stop, and simulators that a tick would wait for beside
/// them.
pub(crate) fn check(opened: &OpenedBench, diagnostics: &mut Diagnostics) {
    let is_live = |device: &&PlannedDevice| matches!(device.driver, Driver::Live(_));
    let moving = opened.devices.iter().filter(is_live).filter(|device| !device.description.commands.is_empty());
    diagnostics.extend(moving.filter_map(unwatched));
    let Some(live) = opened.devices.iter().find(is_live) else { return };
    for device in opened.devices.iter().filter(|device| matches!(device.driver, Driver::Lockstep(_))) {
        let message =
            format!("a tick waits for device `{}`, but the device `{}` runs in real time", device.name, live.name);
        let diagnostic = Diagnostic::new(Code::BadClock, device.span.clone(), message);
        let help = "let the program behind it run by its own clock, without waiting for the graph";
        diagnostics.push(diagnostic.note(live.span.clone(), "the device in real time is here").help(help));
    }
}

/// Says what a run must know of the devices that move: what each live one does without commands, within which time and
/// way, and what a device says itself.
pub(crate) fn describe(net: &Net<'_>, opened: &OpenedBench) -> Vec<String> {
    let bound = opened.roles.iter().enumerate().filter_map(|(role, bound)| Some((role, bound.as_ref()?)));
    let moved = || bound.clone().filter(|(_, bound)| !bound.commands.is_empty());
    let notes = moved().flat_map(|(role, bound)| {
        let name = net.name(Producer::Role(role));
        opened.devices[bound.device].description.notes.iter().map(move |note| format!("`{name}` {note}"))
    });
    let lines = moved().filter_map(|(role, bound)| {
        let device = &opened.devices[bound.device];
        let silence = device.description.on_silence.as_ref().filter(|_| matches!(device.driver, Driver::Live(_)))?;
        let way = net.speed_limit(role).map(|speed| {
            format!("; the sensor moves by {} mm at most, at {} m/s", round(speed * silence.within * 1e3), round(speed))
        });
        let name = net.name(Producer::Role(role));
        Some(format!("`{name}` without commands: {silence}{}", way.unwrap_or_default()))
    });
    notes.chain(lines).collect()
}

/// Rounds a number to three decimals.
fn round(number: f64) -> f64 {
    (number * 1e3).round() / 1e3
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
