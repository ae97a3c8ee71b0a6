//! A lost contact that is searched for faster than the task has approached it.

use std::collections::BTreeSet;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::tool::control::exits::Exit;

/// Share of a speed along the object that counts as one toward it [1].
const SWEEP_SHARE: f64 = 0.5;

impl ModeLaw<'_> {
    /// Returns the speed with which the mode searches [m/s]: toward the object, or half of that along it.
    fn search_speed(&self) -> f64 {
        let along = |i: usize| self.law.constants.iter().map(|constant| constant.twist[i]).sum::<f64>();
        self.approach().max(along(0).hypot(along(1)) * SWEEP_SHARE)
    }
}

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    let task = arm.outline.tasks.iter().find(|task| task.name == arm.task);
    let settings = task.map_or(&arm.outline.settings, |task| &task.settings);
    let start = settings.iter().find(|setting| setting.path == "start").and_then(|start| start.value.as_str());
    let Some(start) = start else { return found };
    let first = search(arm, start, &BTreeSet::new());
    let first_speed = fastest(arm, &first, |mode| mode.approach()).filter(|(_, speed)| *speed > 0.0);
    let Some((slow, first_speed)) = first_speed else { return found };
    for mode in &arm.modes {
        let exits = mode.lost().filter_map(|exit| Some((exit, exit.to()?)));
        found.extend(exits.filter(|(_, to)| !first.contains(to)).filter_map(|(exit, to)| {
            let search = search(arm, to, &first);
            // A task that backs off first approaches again from a distance.
            let backs_off = search.iter().filter_map(|name| arm.mode(name)).any(ModeLaw::backs_off);
            let (fast, again) = fastest(arm, &search, |mode| mode.search_speed()).filter(|_| !backs_off)?;
            let is_beside = arm.mode(fast)?.approach() < again;
            (again > first_speed * (1.0 + 1e-9)).then(|| report(exit, (fast, again, is_beside), (slow, first_speed)))
        }));
    }
    found
}

/// Returns a mode and those that follow it while the task has no contact. The search ends at a mode that a lost contact ends,
/// at an exit that waits for a contact, and at modes that are known.
fn search<'a>(arm: &'a Arm<'_>, from: &'a str, known: &BTreeSet<&str>) -> BTreeSet<&'a str> {
    let (mut open, mut found) = (vec![from], BTreeSet::new());
    while let Some(name) = open.pop() {
        let Some(mode) = arm.mode(name) else { continue };
        // The first mode begins without one, even if it notices a lost contact itself.
        let has_contact = mode.lost().next().is_some() && name != from;
        if !has_contact && !known.contains(name) && found.insert(name) {
            open.extend(mode.exits("go").filter(|exit| !exit.is_found()).filter_map(Exit::to));
        }
    }
    found
}

/// Returns the mode that moves fastest, with its speed [m/s].
fn fastest<'a>(
    arm: &Arm<'_>,
    modes: &BTreeSet<&'a str>,
    speed: impl Fn(&ModeLaw<'_>) -> f64,
) -> Option<(&'a str, f64)> {
    let speeds = modes.iter().filter_map(|name| Some((*name, speed(arm.mode(name)?))));
    speeds.max_by(|(_, one), (_, other)| one.total_cmp(other))
}

fn report(exit: Exit<'_>, (fast, again, is_beside): (&str, f64, bool), (slow, first): (&str, f64)) -> Diagnostic {
    let (way, again, most, axis) = match is_beside {
        true => ("sweeps along the object", again / SWEEP_SHARE, first / SWEEP_SHARE, "x and y"),
        false => ("moves toward the object", again, first, "+z"),
    };
    let than = if is_beside { "more than twice as fast as" } else { "faster than" };
    let message = format!(
        "after a lost contact, mode `{fast}` {way} with {again} m/s: {than} mode `{slow}`, which approaches with {first} m/s"
    );
    let help = format!(
        "let `{fast}` move with {most} m/s or less along {axis}: the object is near, and a fast touch presses hard"
    );
    let place = exit.entry("to").unwrap_or(exit.value).span.clone();
    Diagnostic::new(Code::FastRecovery, place, message).help(help)
}
