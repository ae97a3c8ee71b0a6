//! A lost contact that is searched for faster than the task has approached it.

use std::collections::BTreeSet;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::exits::Exit;
use super::{Controlled, ModeLaw};
use crate::tool::control::law::Guidance;
use crate::tool::control::settings::source;

/// Share of a speed along the object that counts as one toward it [1].
const BESIDE: f64 = 0.5;

impl ModeLaw<'_> {
    pub(super) fn own_name(&self) -> &str {
        self.mode.map_or("", |mode| mode.name.rsplit('.').next().unwrap_or_default())
    }

    /// Returns the speed along +z with which the mode moves the sensor whatever it feels [m/s].
    pub(super) fn approach(&self) -> f64 {
        let constant: f64 = self.law.constants.iter().map(|constant| constant.twist[2]).sum();
        let composed = self.law.guidance.iter().filter(|guide| guide.kind == "compose_twist" && guide.passes[2]);
        constant + composed.filter_map(|guide| self.generated(guide)).sum::<f64>()
    }

    /// Returns whether the mode moves the sensor away from the object.
    pub(super) fn backs_off(&self) -> bool {
        let lifts = |guide: &Guidance| guide.kind == "park" && guide.passes[2] && !self.rests(guide);
        self.approach() < 0.0 || self.law.guidance.iter().any(lifts)
    }

    /// Returns the speed with which the mode searches [m/s]: toward the object, or half of that along it.
    fn search_speed(&self) -> f64 {
        let along = |i: usize| self.law.constants.iter().map(|constant| constant.twist[i]).sum::<f64>();
        self.approach().max(along(0).hypot(along(1)) * BESIDE)
    }

    /// Returns the largest speed along z that a `signal_generator` gives to a composed twist [m/s].
    fn generated(&self, guide: &Guidance) -> Option<f64> {
        let generator = self.nodes.writer(source(self.nodes.node(guide.node())?, "vz")?)?;
        let number = |key: &str| self.nodes.number(generator, key).unwrap_or_default();
        (generator.kind.text == "signal_generator").then(|| number("offset") + number("amplitude").abs())
    }
}

pub(super) fn check(arm: &Controlled<'_>, found: &mut Diagnostics) {
    let task = arm.outline.tasks.iter().find(|task| task.name == arm.task);
    let settings = task.map_or(&arm.outline.settings, |task| &task.settings);
    let start = settings.iter().find(|setting| setting.path == "start").and_then(|start| start.value.as_str());
    let Some(start) = start else { return };
    let first = search(arm, start, &BTreeSet::new());
    let first_speed = fastest(arm, &first, |mode| mode.approach()).filter(|(_, speed)| *speed > 0.0);
    let Some((slow, first_speed)) = first_speed else { return };
    for mode in &arm.modes {
        found.extend(mode.lost().filter(|exit| !first.contains(exit.to)).filter_map(|exit| {
            let search = search(arm, exit.to, &first);
            // A task that backs off first approaches again from a distance.
            let backs_off = search.iter().filter_map(|name| named(arm, name)).any(ModeLaw::backs_off);
            let (fast, again) = fastest(arm, &search, |mode| mode.search_speed()).filter(|_| !backs_off)?;
            let is_beside = named(arm, fast)?.approach() < again;
            (again > first_speed * (1.0 + 1e-9)).then(|| report(&exit, (fast, again, is_beside), (slow, first_speed)))
        }));
    }
}

/// Returns the modes from one on in which the task has no contact: up to those that begin with one or that a lost contact
/// ends, and to those that are known.
fn search<'a>(arm: &'a Controlled<'_>, from: &'a str, known: &BTreeSet<&str>) -> BTreeSet<&'a str> {
    let (mut open, mut found) = (vec![from], BTreeSet::new());
    while let Some(name) = open.pop() {
        let Some(mode) = named(arm, name) else { continue };
        // The first mode begins without one, even if it notices a lost contact itself.
        let has_contact = mode.lost().next().is_some() && name != from;
        if !has_contact && !known.contains(name) && found.insert(name) {
            open.extend(mode.exits("go").filter(|exit| !exit.is_found()).map(|exit| exit.to));
        }
    }
    found
}

fn named<'a>(arm: &'a Controlled<'_>, name: &str) -> Option<&'a ModeLaw<'a>> {
    arm.modes.iter().find(|mode| mode.own_name() == name)
}

/// Returns the mode that moves fastest, with its speed [m/s].
fn fastest<'a>(
    arm: &Controlled<'_>,
    modes: &BTreeSet<&'a str>,
    speed: impl Fn(&ModeLaw<'_>) -> f64,
) -> Option<(&'a str, f64)> {
    let speeds = modes.iter().filter_map(|name| Some((*name, speed(named(arm, name)?))));
    speeds.max_by(|(_, one), (_, other)| one.total_cmp(other))
}

fn report(exit: &Exit<'_>, (fast, again, is_beside): (&str, f64, bool), (slow, first): (&str, f64)) -> Diagnostic {
    let (way, again, most, axis) = match is_beside {
        true => ("sweeps along the object", again / BESIDE, first / BESIDE, "x and y"),
        false => ("moves toward the object", again, first, "+z"),
    };
    let than = if is_beside { "more than twice as fast as" } else { "faster than" };
    let message = format!(
        "after a lost contact, mode `{fast}` {way} with {again} m/s: {than} mode `{slow}`, which approaches with {first} m/s"
    );
    let help = format!(
        "let `{fast}` move with {most} m/s or less along {axis}: the object is near, and a fast touch presses hard"
    );
    let to = exit.value.as_table().and_then(|table| table.get("to"));
    Diagnostic::new(Code::FastRecovery, to.unwrap_or(exit.value).span.clone(), message).help(help)
}
