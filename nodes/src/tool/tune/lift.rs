//! The end of a run: the sensor lifts off the object, so that the next run begins with a pad that nothing touches.

use std::collections::BTreeSet;

use tactflow_runtime::graph::{Outline, OutlinedMode};

use crate::tool::control::exits::{Exit, exits};

/// The mode in which the sensor lifts off.
pub(super) const MODE: &str = "tune_lift";
/// How long it lifts off [s].
pub(super) const LASTS_S: f64 = 2.0;
/// How fast it lifts off [m/s].
const SPEED: f64 = 0.015;

/// Returns the settings that let a mode end after so long [s], whatever its exits `go` say, and lift the sensor off.
/// Exits that fail, and those of a lost contact, stay.
pub(super) fn settings(outline: &Outline, mode: &OutlinedMode, adder: &str, after_s: f64) -> Vec<String> {
    let projectors = outline.nodes.iter().filter(|node| node.kind.text == "projector");
    let free = projectors.map(|node| format!("modes.{MODE}.set.{}.select=[0, 0, 0, 0, 0, 0]", node.name));
    let away = [
        go(mode, MODE, after_s),
        format!("nodes.{MODE}_twist.type=twist_source"),
        format!("nodes.{MODE}_twist.twist=[0, 0, 0, 0, 0, 0]"),
        format!("nodes.{adder}.in.{MODE}={MODE}_twist.twist"),
        format!("modes.{MODE}.set.{MODE}_twist.twist=[0, 0, {:?}, 0, 0, 0]", -SPEED),
        format!("modes.{MODE}.done={{ after_ms = {:?} }}", LASTS_S * 1e3),
    ];
    away.into_iter().chain(free).collect()
}

/// Returns the setting that lets a mode go on to another one after so long [s], instead of its own exits `go`.
pub(super) fn go(mode: &OutlinedMode, to: &str, after_s: f64) -> String {
    let mut exits = vec![after(to, after_s)];
    // The modes behind the exits stay reachable, by words that nobody sends.
    exits.extend(targets(mode).iter().map(|to| format!("{{ to = {to:?}, on = \"{MODE}_{to}\" }}")));
    format!("modes.{}.go=[{}]", mode.name, exits.join(", "))
}

/// Returns an exit to a mode after so long [s].
pub(super) fn after(to: &str, after_s: f64) -> String {
    format!("{{ to = {to:?}, after_ms = {:?}, priority = 1 }}", (after_s * 1e3).ceil())
}

/// Returns the modes to which the exits `go` of a mode lead.
fn targets(mode: &OutlinedMode) -> BTreeSet<&str> {
    exits(mode, "go").filter_map(Exit::to).collect()
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::{Request, compile};

    use super::*;

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
                let lift = settings(compiled.outline(), mode, "sum", 10.0);
                let lifted = load(&Request { set: lift, ..request.clone() });
                assert!(lifted.outline().modes.iter().any(|mode| mode.name == MODE), "{task}");
                with_exits += targets(mode).len();
            }
        }
        assert!(with_exits >= 5, "{with_exits} exits");
    }
}
