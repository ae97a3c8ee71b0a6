//! A shipped task with changes.

use std::path::PathBuf;

use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::source::Report;
use tactflow_tests::{catalogue, workspace};

/// A shipped task with changes: lines that replace the first one with the same key, `+` lines that are appended, `-` keys
/// whose lines are removed, and `set` assignments.
pub(super) struct Variant {
    pub(super) task: &'static str,
    pub(super) bench: Option<&'static str>,
    pub(super) changes: Vec<String>,
}

pub(super) fn variant(task: &'static str, changes: &[&str]) -> Variant {
    Variant { task, bench: None, changes: changes.iter().map(|change| (*change).to_owned()).collect() }
}

pub(super) fn on(bench: &'static str, variant: Variant) -> Variant {
    Variant { bench: Some(bench), ..variant }
}

pub(super) fn graph(task: &str) -> PathBuf {
    workspace().join("graphs").join(task).with_extension("toml")
}

fn key(line: &str) -> &str {
    line.split('=').next().unwrap().trim()
}

/// The text of a task whose controller reads `x` directly: each change adds the only filter, or none.
fn unfiltered(task: &str) -> String {
    let text = std::fs::read_to_string(graph(task)).unwrap();
    let Some((before, filter)) = text.split_once("[nodes.calm_x]") else { return text };
    let after = filter.split_once("\n\n").unwrap().1;
    (before.to_owned() + after).replace("calm_x.value", "touch.x")
}

impl Variant {
    pub(super) fn text(&self) -> String {
        let text = unfiltered(self.task);
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        for change in self.changes.iter().filter(|change| !change.starts_with("set ")) {
            match change.split_at(1) {
                ("+", more) => lines.push(more.to_owned()),
                ("-", gone) => lines.retain(|line| key(line) != gone),
                _ => {
                    let at = lines.iter().position(|line| key(line) == key(change));
                    lines[at.unwrap_or_else(|| panic!("{} has no `{change}`", self.task))].clone_from(change);
                }
            }
        }
        lines.join("\n") + "\n"
    }

    fn request(&self, text: String) -> Request {
        let sets = self.changes.iter().filter_map(|change| change.strip_prefix("set "));
        let request = Request { text: Some(text), ..Request::file(graph(self.task)) };
        let request = sets.fold(request, |request, set| request.set(set));
        match self.bench {
            Some(bench) => request.bench(workspace().join("graphs/benches").join(bench).with_extension("toml")),
            None => request,
        }
    }

    pub(super) fn compiled(&self, text: String) -> Compiled {
        let named = || format!("{}, {:?}", self.task, self.changes);
        compile(&catalogue(), &self.request(text))
            .unwrap_or_else(|report| panic!("{}\n{}", named(), report.render(false)))
    }

    pub(super) fn warnings(&self) -> Option<Report> {
        self.compiled(self.text()).warnings()
    }
}

/// A mode that searches with a speed, for a task with the modes `approach` and `servo`.
pub(super) fn search(speed: &str) -> Vec<String> {
    [
        "on_lost = { of = \"touch.present\", after_ms = 100, to = \"search\" }".to_owned(),
        "+[modes.search]".to_owned(),
        "+set.projector.select = [0, 0, 0, 0, 0, 0]".to_owned(),
        format!("+set.reach.twist = [0, 0, {speed}, 0, 0, 0]"),
        "+go = { to = \"servo\", when = \"touch.present\", for_ms = 40 }".to_owned(),
        "+fail = { after_ms = 10000, after_travel_mm = 60, of = \"move.sensor_pose\" }".to_owned(),
    ]
    .into()
}

/// A first mode that lifts the sensor off with a speed, before the task approaches.
pub(super) fn cleared(speed: &str) -> Vec<String> {
    [
        "start = \"clear\"".to_owned(),
        "+[modes.clear]".to_owned(),
        "+set.projector.select = [0, 0, 0, 0, 0, 0]".to_owned(),
        format!("+set.reach.twist = [0, 0, {speed}, 0, 0, 0]"),
        "+go = { to = \"approach\", after_travel_mm = 5, of = \"move.sensor_pose\" }".to_owned(),
        "+fail = { after_ms = 5000 }".to_owned(),
    ]
    .into()
}

/// The task `force` with another end of its approach, which has a speed of 8 mm/s.
pub(super) fn approaching(end: &str, more: &[&str]) -> Variant {
    let fail = format!("set modes.approach.fail={{ {end}, of = \"move.sensor_pose\" }}");
    variant("force", &[&[&*fail], more].concat())
}

/// The task `force` with a mode that retreats with 20 mm/s while the pressure is controlled, by up to 30 mm/s.
pub(super) fn leaving(more: &[&str]) -> Variant {
    let own = [
        "set modes.servo.go={ to = \"leave\", after_ms = 8000 }",
        "set modes.leave.set.reach.twist=[0, 0, -0.02, 0, 0, 0]",
        "set modes.leave.done={ after_travel_mm = 20, of = \"move.sensor_pose\" }",
        "set modes.leave.fail={ after_ms = 5000 }",
    ];
    variant("force", &[&own, more].concat())
}

/// A gate in front of a port that a task reads at an input.
pub(super) fn gated(kind: &str, port: &str, input: &str, gate: &str) -> Vec<String> {
    [
        format!("set nodes.only.type={kind:?}"),
        format!("set nodes.only.in.value={port:?}"),
        format!("set nodes.only.in.gate={gate:?}"),
        format!("set nodes.{input}=\"only.value\""),
    ]
    .into()
}

/// Modes of `force` that follow the flag of a comparison: `eased` presses with half the pressure while the force is large.
pub(super) fn compared(bound: &str) -> [&str; 7] {
    [
        "set nodes.firm.type=\"compare\"",
        "set nodes.firm.in.value=\"touch.force\"",
        bound,
        "set modes.servo.go={ to = \"eased\", when = \"firm.is_met\", for_ms = 20 }",
        "set modes.eased.set.error.setpoint.pressure=0.05",
        "set modes.eased.go={ to = \"servo\", when = \"firm.is_met\", is = \"false\", for_ms = 20 }",
        "set modes.eased.on_lost={ of = \"touch.present\", after_ms = 100, to = \"approach\" }",
    ]
}

/// The changes that add a `contact_area`, and more.
pub(super) fn with_area(more: &[&'static str]) -> Vec<&'static str> {
    let own = [
        "set nodes.size.type=\"contact_area\"",
        "set nodes.size.in.image=\"touch.repaired\"",
        "set nodes.size.in.region=\"touch.region\"",
    ];
    [&own, more].concat()
}

/// The same, where the way back passes a node of flags: `not`, or one that combines several and has one.
pub(super) fn through(kind: &str) -> Variant {
    let (input, is) = if kind == "not" { ("flag", "true") } else { ("firm", "false") };
    let back = format!("set modes.eased.go={{ to = \"servo\", when = \"soft.is_met\", is = {is:?}, for_ms = 20 }}");
    let node =
        [format!("set nodes.soft.type={kind:?}"), format!("set nodes.soft.in={{ {input} = \"firm.is_met\" }}"), back];
    let changes = compared("set nodes.firm.above=2.0").map(str::to_owned).into_iter().chain(node).collect();
    Variant { task: "force", bench: None, changes }
}

/// A task that controls a feature more, with a setpoint of 0 and a gain of 1 1/s.
pub(super) fn with_feature(task: &'static str, name: &str, port: &str, column: &str, changes: &[&str]) -> Variant {
    let more = [
        format!("set nodes.error.in.{name}={port:?}"),
        format!("set nodes.error.setpoint.{name}=0.0"),
        format!("set nodes.pid.gains.{name}.kp=1.0"),
        format!("set nodes.jacobian.columns.{name}={column}"),
    ];
    let changes = more.into_iter().chain(changes.iter().map(|change| (*change).to_owned())).collect();
    Variant { task, bench: None, changes }
}

/// The task `edge`, which controls the whole force too.
pub(super) fn with_force(changes: &[&str]) -> Variant {
    with_feature("edge", "force", "touch.force", "[0, 0, 0.004, 0, 0, 0]", changes)
}
