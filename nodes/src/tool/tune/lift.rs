//! The end of a run: the sensor lifts off the object, so that the next run begins with a pad that nothing touches.

use std::collections::BTreeSet;

use tactflow_runtime::graph::{Outline, OutlinedMode, Request};

use super::task::Task;
use crate::tool::control::exits::{Exit, exits};

/// The mode in which the sensor lifts off.
pub(super) const MODE: &str = "tune_lift";
/// The same after a contact that was lost.
const LOST: &str = "tune_lost";
/// How long it lifts off [s].
pub(super) const LASTS_S: f64 = 2.0;
/// How fast it lifts off [m/s].
const SPEED: f64 = 0.015;

/// Where a contact that is lost leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lost {
    /// To the lift: a bench that does not start again would else press on, until the run ends.
    Lifts,
    /// To the mode that the task names.
    AsTheTaskSays,
}

impl Lost {
    /// Returns the setting of a mode, here or a copy of it with another name.
    pub(super) fn setting(self, mode: &OutlinedMode, name: &str) -> Option<String> {
        (self == Self::Lifts && can_lose(mode)).then(|| format!("modes.{name}.on_lost.to={LOST:?}"))
    }
}

/// Runs a request with these settings too, with a lift after a contact that is lost. `run` also says whether the pad has
/// bounced at the first touch: the task then finds the contact again, so it runs once more as the task says.
pub(super) fn unless_it_bounces<T, E>(
    (task, request): (&Task, &Request),
    settings: &[String],
    mode: &OutlinedMode,
    run: impl Fn(&Request) -> Result<(T, bool), E>,
) -> Result<T, E> {
    let with = |lost: Lost| run(&task.with(request, settings.iter().cloned().chain(lost.setting(mode, &mode.name))));
    match with(Lost::Lifts)? {
        (_, true) => with(Lost::AsTheTaskSays).map(|(seen, _)| seen),
        (seen, false) => Ok(seen),
    }
}

/// Returns how a mode ended that has gone on to another one.
pub(super) fn left(mode: &str, to: &str) -> String {
    match to {
        LOST => "the contact was lost".to_owned(),
        to => format!("the mode `{mode}` was left for `{to}`"),
    }
}

/// Returns the settings that let a mode end after so long [s], whatever its exits `go` say, and lift the sensor off. An
/// exit `done` that only waits for a time is off too. The exit `fail` stays. A lost contact leads where [`Lost`] says.
pub(super) fn settings(outline: &Outline, mode: &OutlinedMode, adder: &str, after_s: f64) -> Vec<String> {
    let mut set = vec![
        go(mode, MODE, after_s),
        format!("nodes.{MODE}_twist.type=twist_source"),
        format!("nodes.{MODE}_twist.twist=[0, 0, 0, 0, 0, 0]"),
        format!("nodes.{adder}.in.{MODE}={MODE}_twist.twist"),
    ];
    set.extend(done(mode));
    for lift in [Some(MODE), can_lose(mode).then_some(LOST)].into_iter().flatten() {
        let projectors = outline.nodes.iter().filter(|node| node.kind.text == "projector");
        set.extend(projectors.map(|node| format!("modes.{lift}.set.{}.select=[0, 0, 0, 0, 0, 0]", node.name)));
        set.push(format!("modes.{lift}.set.{MODE}_twist.twist=[0, 0, {:?}, 0, 0, 0]", -SPEED));
        set.push(format!("modes.{lift}.done={{ after_ms = {:?} }}", LASTS_S * 1e3));
    }
    set
}

/// Returns the setting of a mode without the exits `done` that only wait for a time; `None` if it has none of them.
fn done(mode: &OutlinedMode) -> Option<String> {
    let (timed, others): (Vec<Exit>, Vec<Exit>) = exits(mode, "done").partition(|exit| exit.waits() > 0.0);
    if timed.is_empty() {
        return None;
    }
    let others = others.into_iter().filter_map(|exit| Some(toml::Value::try_from(exit.value).ok()?.to_string()));
    // Nothing deletes a setting, so a word that nobody sends stands in for an empty list.
    let exits: Vec<String> = others.chain([format!("{{ on = \"{MODE}\" }}")]).collect();
    Some(format!("modes.{}.done=[{}]", mode.name, exits.join(", ")))
}

/// Returns the setting that lets a mode go on to another one after so long [s], instead of its own exits `go`.
pub(super) fn go(mode: &OutlinedMode, to: &str, after_s: f64) -> String {
    let mut exits = vec![after(to, after_s)];
    // The modes behind the exits stay reachable, by words that nobody sends.
    let lost = can_lose(mode).then_some(LOST);
    exits.extend(targets(mode).into_iter().chain(lost).map(|to| format!("{{ to = {to:?}, on = \"{MODE}_{to}\" }}")));
    format!("modes.{}.go=[{}]", mode.name, exits.join(", "))
}

/// Returns an exit to a mode after so long [s].
pub(super) fn after(to: &str, after_s: f64) -> String {
    format!("{{ to = {to:?}, after_ms = {:?}, priority = 1 }}", (after_s * 1e3).ceil())
}

/// Returns the modes to which the exits `go` and `on_lost` of a mode lead.
fn targets(mode: &OutlinedMode) -> BTreeSet<&str> {
    ["go", "on_lost"].into_iter().flat_map(|key| exits(mode, key)).filter_map(Exit::to).collect()
}

/// Returns whether a mode ends when its contact is lost.
fn can_lose(mode: &OutlinedMode) -> bool {
    exits(mode, "on_lost").next().is_some()
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::compile;

    use super::*;

    #[test]
    fn a_done_that_waits_for_a_time_is_off_and_the_others_stay() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/seek_ridge.toml");
        let done = |exits: &str| {
            let request = Request::file(path).set(format!("modes.follow.done={exits}"));
            let compiled = compile(&crate::catalogue(), &request).unwrap_or_else(|it| panic!("{}", it.render(false)));
            done(compiled.outline().modes.iter().find(|mode| mode.name == "follow").unwrap())
        };
        let ridge = "{ when = \"ridge.on_ridge\", is = \"false\", for_ms = 100 }";
        assert_eq!(done(&format!("[{ridge}]")), None);
        let set = done(&format!("[{ridge}, {{ after_ms = 4000 }}]")).unwrap();
        let (key, exits) = set.split_once('=').unwrap();
        let exits: toml::Table = toml::from_str(&format!("done = {exits}")).unwrap();
        let exits = exits["done"].as_array().unwrap();
        assert_eq!((key, exits.len()), ("modes.follow.done", 2), "{exits:?}");
        assert_eq!([exits[0]["when"].as_str(), exits[1]["on"].as_str()], [Some("ridge.on_ridge"), Some(MODE)]);
    }

    #[test]
    fn every_mode_of_the_shipped_tasks_can_end_by_a_lift() {
        let graphs = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs");
        let catalogue = crate::catalogue();
        let mut with_exits = 0;
        for task in ["square", "explore", "hybrid", "edge", "seek_ridge"] {
            let request = Request::file(format!("{graphs}/{task}.toml"));
            let load = |request: &Request| {
                compile(&catalogue, request).unwrap_or_else(|report| panic!("{task}: {}", report.render(false)))
            };
            let compiled = load(&request);
            for mode in &compiled.outline().modes {
                for lost in [Lost::Lifts, Lost::AsTheTaskSays] {
                    let lift = settings(compiled.outline(), mode, "sum", 10.0).into_iter();
                    let set = lift.chain(lost.setting(mode, &mode.name)).collect();
                    let lifted = load(&Request { set, ..request.clone() });
                    let has = |name: &str| lifted.outline().modes.iter().any(|mode| mode.name == name);
                    assert_eq!((has(MODE), has(LOST)), (true, can_lose(mode)), "{task}");
                }
                with_exits += targets(mode).len();
            }
        }
        assert!(with_exits >= 5, "{with_exits} exits");
    }
}
