//! Poor controllers: each shipped task with one mistake gets the warning of this mistake and no other, and good variants
//! of the tasks get none.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::source::{Diagnostic, Report};
use tactflow_tests::{catalogue, toml_files, workspace};

/// A shipped task with changes: lines that replace the first one with the same key, `+` lines that are appended, `-` keys
/// whose lines are removed, and `set` assignments.
struct Variant {
    task: &'static str,
    bench: Option<&'static str>,
    changes: Vec<String>,
}

fn variant(task: &'static str, changes: &[&str]) -> Variant {
    Variant { task, bench: None, changes: changes.iter().map(|change| (*change).to_owned()).collect() }
}

fn on(bench: &'static str, variant: Variant) -> Variant {
    Variant { bench: Some(bench), ..variant }
}

fn graph(task: &str) -> PathBuf {
    workspace().join("graphs").join(task).with_extension("toml")
}

fn key(line: &str) -> &str {
    line.split('=').next().unwrap().trim()
}

impl Variant {
    fn text(&self) -> String {
        let text = std::fs::read_to_string(graph(self.task)).unwrap();
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

    fn compiled(&self, text: String) -> Compiled {
        let named = || format!("{}, {:?}", self.task, self.changes);
        compile(&catalogue(), &self.request(text))
            .unwrap_or_else(|report| panic!("{}\n{}", named(), report.render(false)))
    }

    fn warnings(&self) -> Option<Report> {
        self.compiled(self.text()).warnings()
    }
}

fn codes(report: Option<&Report>) -> BTreeSet<&'static str> {
    report.iter().flat_map(|report| &report.diagnostics).map(|diagnostic| diagnostic.code.name()).collect()
}

/// Applies a fix, and returns the text of the graph; `None` if it changes something else.
fn fixed(report: &Report, fixed: &Diagnostic, graph: &Path) -> Option<String> {
    let files = report.sources.edited(&fixed.fix);
    files.into_iter().find(|(name, _)| Path::new(name) == graph).map(|(_, text)| text)
}

/// A mode that searches with a speed, for a task with the modes `approach` and `servo`.
fn search(speed: &str) -> Vec<String> {
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
fn cleared(speed: &str) -> Vec<String> {
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

/// A gate in front of a port that a task reads at an input.
fn gated(kind: &str, port: &str, input: &str, gate: &str) -> Vec<String> {
    [
        format!("set nodes.only.type={kind:?}"),
        format!("set nodes.only.in.value={port:?}"),
        format!("set nodes.only.in.gate={gate:?}"),
        format!("set nodes.{input}=\"only.value\""),
    ]
    .into()
}

/// Mistakes that nodes between the feature and the motion hide from a first look.
fn poor_behind_nodes() -> Vec<(&'static str, Variant)> {
    let with = |mut changes: Vec<String>, more: &[&str]| {
        changes.extend(more.iter().map(|change| (*change).to_owned()));
        Variant { task: "hybrid", bench: None, changes }
    };
    let twist = || gated("twist_gate", "projector.twist", "sum.in.touch", "touch.present");
    let feature = |gate: &str| gated("gate", "touch.x", "error.in.x", gate);
    let other =
        |gate: &str| with(feature(gate), &["set nodes.no.type=\"not\"", "set nodes.no.in.flag=\"touch.present\""]);
    vec![
        ("low-margin", with(twist(), &["gains.x = { kp = 17.5 }"])),
        ("wrong-column", with(twist(), &["columns.x = [1, 0, 0, 0, 20, 0]"])),
        ("low-margin", with(feature("touch.present"), &["gains.x = { kp = 17.5 }"])),
        ("unfiltered-derivative", with(feature("touch.present"), &["gains.x = { kp = 3.5, kd = 0.1 }"])),
        ("unused-column", other("no.is_met")),
        // A delay smooths nothing.
        (
            "unfiltered-derivative",
            with(
                vec!["gains.x = { kp = 3.5, kd = 0.1 }".to_owned()],
                &[
                    "set nodes.late.type=\"delay\"",
                    "set nodes.late.unit=\"m\"",
                    "set nodes.late.in.value=\"touch.x\"",
                    "set nodes.error.in.x=\"late.value\"",
                ],
            ),
        ),
        ("unused-column", with(feature("modes.approach"), &[])),
    ]
}

/// Columns that move the sensor the wrong way, or along the wrong axis.
fn wrong_columns() -> Vec<(&'static str, Variant)> {
    let cases = [
        variant("hybrid", &["columns.x = [1, 0, 0, 0, 20, 0]"]),
        variant("hybrid", &["columns.y = [0, 1, 0, -20, 0, 0]"]),
        variant("hybrid", &["columns.pressure = [0, 0, -1, 0, 0, 0]"]),
        variant(
            "hybrid",
            &[
                "columns.y = [0, -1, 0, 0, 0, 0]",
                "columns.pressure = [0, 0, 0, 1, 0, 0]",
                "select = [1, 1, 0, 1, 0, 0]",
            ],
        ),
        variant("hybrid", &["columns.x = [0, -1, 0, 20, 0, 0]", "columns.y = [-1, 0, 0, 0, -20, 0]"]),
        variant("hybrid", &["columns.x = [0, -1, 0, 20, 0, 0]"]),
        variant("edge", &["columns.orientation = [0, 0, 0, 0, 0, 1]"]),
        variant("edge", &["columns.pressure = [0, 0, 0, 0, 0, -1]", "columns.orientation = [0, 0, 1, 0, 0, 0]"]),
        variant("rolling", &["columns.x = [-1, 0, 0, 0, 20, 0]"]),
        // As the paper prints it.
        variant("rolling", &["columns.y = [0, -1, 0, -20, 0, 0]"]),
        variant("force", &["columns.pressure = [0, 0, -1, 0, 0, 0]"]),
        variant("cable", &["columns.orientation = [0, 0, 0, 0, 0, 1]"]),
        variant("cable", &["columns.x = [0, 0, 0, 0, 0, -1]", "columns.orientation = [-1, 0, 0, 0, -20, 0]"]),
        variant("explore", &["columns.x = [1, 0, 0, 0, -20, 0]"]),
        variant("seek_ridge", &["columns.y = [0, 1, 0, 20, 0, 0]"]),
        variant("position", &["columns.y = [0, 1, 0, 20, 0, 0]"]),
        variant("square", &["columns.pressure = [0, 0, -1, 0, 0, 0]"]),
        variant("finger_press", &["columns.pressure = [0, 0, -0.0005, 0, 0, 0]"]),
        variant("two_arms", &["set parts.left.set.jacobian.columns.x=[1, 0, 0, 0, 20, 0]"]),
        variant("carry", &["set parts.left.set.jacobian.columns.force=[0, 0, -0.004, 0, 0, 0]"]),
    ];
    cases.into_iter().map(|variant| ("wrong-column", variant)).collect()
}

/// Gains, filters and setpoints.
fn poor_gains() -> Vec<(&'static str, Variant)> {
    let stiff = "gains.pressure = { kp = 2.5, ki = 0.5, within = 0.02 }";
    let slow = "time_constant_ms = 1000";
    vec![
        ("low-margin", variant("hybrid", &["gains.x = { kp = 17.5 }"])),
        ("low-margin", variant("hybrid", &["gains.pressure = { kp = 5.0, ki = 1.0, within = 0.02 }"])),
        ("low-margin", variant("hybrid", &["gains.pressure = { kp = 0.1, ki = 0.5, within = 0.02 }"])),
        ("low-margin", variant("position", &["gains.x = { kp = 17.5 }"])),
        ("low-margin", variant("edge", &[stiff])),
        ("low-margin", variant("edge", &["gains.orientation = { kp = 30.0, ki = 30.0, within = 0.05, limit = 0.7 }"])),
        ("low-margin", on("pen", variant("force", &[stiff]))),
        ("low-margin", on("pen", variant("hybrid", &[stiff]))),
        ("low-margin", on("toy_box", variant("force", &[stiff]))),
        ("slow-filter", variant("hybrid", &[slow])),
        ("slow-filter", variant("edge", &[slow])),
        ("slow-filter", on("pen", variant("force", &[slow]))),
        ("slow-filter", variant("edge", &["set parts.touch.set.orientation.window=250"])),
        ("slow-filter", variant("cable", &["set nodes.direction.window=250"])),
        ("unfiltered-derivative", variant("hybrid", &["gains.x = { kp = 3.5, kd = 0.1 }"])),
        ("unfiltered-derivative", variant("position", &["gains.y = { kp = 3.5, kd = 0.05 }"])),
        ("unfiltered-derivative", variant("explore", &["gains.y = { kp = 2.0, kd = 0.02 }"])),
        ("windup", variant("hybrid", &["gains.pressure = { kp = 0.5, ki = 0.1 }"])),
        ("windup", on("pen", variant("force", &["gains.pressure = { kp = 0.5, ki = 0.1 }"]))),
        ("windup", variant("edge", &["gains.orientation = { kp = 6.0, ki = 6.0 }"])),
        ("windup", variant("hybrid", &["gains.x = { kp = 3.5, ki = 1.0, limit = 0.2 }"])),
        ("windup", variant("hybrid", &["gains.pressure = { kp = 0.5, ki = 0.1, within = 5.0 }"])),
        ("unstable-gain", variant("hybrid", &["gains.x = { kp = 600.0 }"])),
        // By the sampling alone: 1.2 times the error in each period.
        ("low-margin", on("held_ball", variant("hybrid", &["gains.x = { kp = 300.0 }"]))),
        ("unusual-gain", variant("hybrid", &["gains.x = { kp = -3.5 }", "columns.x = [1, 0, 0, 0, 20, 0]"])),
        ("unreachable-setpoint", variant("force", &["setpoint = { pressure = 4.0 }"])),
        ("unreachable-setpoint", variant("force", &["setpoint = { pressure = 0.005 }"])),
        ("unreachable-setpoint", variant("carry", &["set parts.right.set.error.setpoint.force=7.0"])),
        ("unusual-value", variant("position", &["setpoint = { x = 0.2, y = 0.0 }"])),
        // Contacts that cannot be read check nothing.
        (
            "unusual-value",
            variant(
                "hybrid",
                &["set facts.arm.contacts=[{ object = \"ball\", pressure = { vz = 10.0, resonance = 5.0 } }]"],
            ),
        ),
    ]
}

/// Projectors and modes.
fn poor_modes() -> Vec<(&'static str, Variant)> {
    let searching = |task: &'static str| Variant { task, bench: None, changes: search("0.03") };
    let after_a_clearance =
        Variant { task: "hybrid", bench: None, changes: [search("0.03"), cleared("-0.01")].concat() };
    vec![
        ("unused-column", variant("hybrid", &["select = [1, 1, 0, 0, 0, 0]"])),
        ("unused-column", variant("edge", &["select = [0, 0, 1, 0, 0, 0]"])),
        ("unused-column", variant("hybrid", &["columns.y = [0, 0, 0, 0, 0, 0]", "select = [1, 0, 1, 0, 0, 0]"])),
        ("idle-axis", variant("force", &["select = [1, 0, 1, 0, 0, 0]"])),
        ("idle-axis", variant("hybrid", &["select = [1, 1, 1, 0, 0, 1]"])),
        ("unforced-rolling", variant("rolling", &["select = [1, 1, 0, 1, 1, 0]"])),
        ("unforced-rolling", variant("position", &["select = [1, 1, 0, 1, 1, 0]"])),
        ("unforced-rolling", variant("explore", &["select = [1, 1, 0, 1, 1, 1]"])),
        ("line-position", variant("cable", &["select = [1, 1, 1, 0, 0, 1]"])),
        ("line-position", on("bent_cable", variant("cable", &["select = [1, 1, 1, 1, 0, 1]"]))),
        ("chattering-modes", variant("position", &["set modes.servo.go.below=0.06"])),
        ("chattering-modes", variant("position", &["set modes.servo.go.below=0.05", "set modes.servo.go.for_ms=100"])),
        (
            "chattering-modes",
            variant("position", &["set modes.press.go.above=0.03", "set modes.press.go.hysteresis=0.01"]),
        ),
        ("fast-recovery", searching("hybrid")),
        ("fast-recovery", searching("edge")),
        ("fast-recovery", after_a_clearance),
        ("unused-column", variant("hybrid", &["columns.y = [0.8, -1, 0, 20, 0, 0]", "select = [1, 0, 1, 0, 0, 0]"])),
    ]
}

#[test]
fn each_poor_controller_gets_its_warning_and_no_other() {
    let mut wrong = Vec::new();
    let poor: Vec<_> =
        [wrong_columns(), poor_gains(), poor_modes(), poor_behind_nodes()].into_iter().flatten().collect();
    assert!(poor.len() > 50, "{}", poor.len());
    let kinds: BTreeSet<_> = poor.iter().map(|(code, _)| *code).collect();
    for (code, variant) in &poor {
        let named = || format!("{}, {:?}", variant.task, variant.changes);
        let report = variant.warnings();
        if codes(report.as_ref()) != BTreeSet::from([*code]) {
            let found = report.map(|report| report.render(false)).unwrap_or_default();
            wrong.push(format!("{code}: {}\n{found}", named()));
            continue;
        }
        let report = report.unwrap();
        for diagnostic in &report.diagnostics {
            let Some(text) = fixed(&report, diagnostic, &graph(variant.task)) else { continue };
            let after = variant.compiled(text).warnings();
            if codes(after.as_ref()).contains(code) {
                wrong.push(format!("{code}: {} stays after the fix {:?}", named(), diagnostic.help));
            }
        }
    }
    assert!(wrong.is_empty(), "{} of {}\n{}", wrong.len(), poor.len(), wrong.join("\n"));
    assert!(kinds.len() > 12, "{kinds:?}");
}

/// The lines of all gains of a task, with each `kp` and `ki` times a factor.
fn scaled(task: &'static str, factor: f64) -> Vec<String> {
    let text = std::fs::read_to_string(graph(task)).unwrap();
    let scale = |line: &str| {
        let mut words: Vec<String> = line.split('#').next().unwrap().split(' ').map(str::to_owned).collect();
        for at in 0..words.len().saturating_sub(2) {
            if ["kp", "ki"].contains(&words[at].as_str()) {
                let (digits, end) = words[at + 2].split_at(words[at + 2].trim_end_matches(',').len());
                words[at + 2] = format!("{}{end}", digits.parse::<f64>().unwrap() * factor);
            }
        }
        words.join(" ")
    };
    text.lines().filter(|line| line.starts_with("gains.")).map(scale).collect()
}

/// Good controllers with loops through a delay, and with sides of a switch that other modes use.
fn good_behind_nodes() -> Vec<Variant> {
    vec![
        // The last value is held through a delay, which closes a loop.
        variant(
            "hybrid",
            &[
                "set nodes.held.type=\"switch\"",
                "set nodes.held.in.on=\"touch.x\"",
                "set nodes.held.in.off=\"old.value\"",
                "set nodes.held.in.select=\"touch.present\"",
                "set nodes.error.in.x=\"held.value\"",
                "set nodes.old.type=\"delay\"",
                "set nodes.old.unit=\"m\"",
                "set nodes.old.in.value=\"held.value\"",
            ],
        ),
        variant(
            "hybrid",
            &[
                "set nodes.held.type=\"twist_switch\"",
                "set nodes.held.in.on=\"projector.twist\"",
                "set nodes.held.in.off=\"old.value\"",
                "set nodes.held.in.select=\"touch.present\"",
                "set nodes.sum.in.touch=\"held.value\"",
                "set nodes.old.type=\"twist_delay\"",
                "set nodes.old.in.value=\"held.value\"",
            ],
        ),
        // A slow side of a switch that only another mode uses.
        variant(
            "hybrid",
            &[
                "set nodes.slow.type=\"low_pass\"",
                "set nodes.slow.in.value=\"touch.x\"",
                "set nodes.slow.time_constant_ms=800",
                "set nodes.held.type=\"switch\"",
                "set nodes.held.in.on=\"touch.x\"",
                "set nodes.held.in.off=\"slow.value\"",
                "set nodes.held.in.select=\"modes.servo\"",
                "set nodes.error.in.x=\"held.value\"",
            ],
        ),
    ]
}

/// Controllers as an integrator may write them.
fn good() -> Vec<Variant> {
    let mut all = Vec::new();
    for task in ["hybrid", "edge", "explore", "rolling", "cable", "force", "position", "seek_ridge", "square"] {
        // Those of `hybrid` are already the largest that `tune` proposes.
        for factor in [0.3, 0.6, 0.9, if task == "hybrid" { 1.0 } else { 1.2 }] {
            all.push(Variant { task, bench: None, changes: scaled(task, factor) });
        }
    }
    for bench in ["ball", "pen", "toy_box", "held_ball", "moved_ball"] {
        for factor in [0.3, 1.0] {
            all.push(Variant { task: "hybrid", bench: Some(bench), changes: scaled("hybrid", factor) });
        }
    }
    for speed in ["0.005", "0.008"] {
        all.push(Variant { task: "edge", bench: None, changes: search(speed) });
    }
    all.extend([
        variant("hybrid", &["setpoint = { x = 0.01, y = -0.01, pressure = 0.3 }"]),
        variant("hybrid", &["setpoint = { x = 0.0, y = 0.0, pressure = 0.05 }"]),
        variant("edge", &["setpoint = { pressure = 0.2, orientation = 0.0 }"]),
        variant("edge", &["setpoint = { pressure = 0.1, orientation = -0.7 }"]),
        variant("force", &["setpoint = { pressure = 1.0 }"]),
        // Other signs and scales of the same motion.
        variant("hybrid", &["gains.x = { kp = 1.75 }", "columns.x = [-2, 0, 0, 0, 0, 0]"]),
        variant("hybrid", &["columns.x = [-1, 0, 0, 0, 20, 0]"]),
        variant("rolling", &["columns.x = [-1, 0, 0, 0, -5, 0]", "columns.y = [0, -1, 0, 5, 0, 0]"]),
        // Features left out, with their columns.
        variant(
            "hybrid",
            &[
                "-in.y",
                "-gains.y",
                "-columns.y",
                "-pid.gains.y.kp",
                "setpoint = { x = 0.0, pressure = 0.1 }",
                "select = [1, 0, 1, 0, 0, 0]",
                "+",
                "set parts.ruler.in.y=\"touch.y\"",
            ],
        ),
        variant("cable", &["select = [1, 0, 1, 0, 1, 1]"]),
        variant("edge", &["select = [1, 1, 1, 1, 1, 1]"]),
        variant("rolling", &["select = [0, 0, 1, 1, 1, 0]"]),
        variant("hybrid", &["gains.x = { kp = 3.5, kd = 0.005 }"]),
        // A task that creeps first and then approaches.
        Variant { task: "hybrid", bench: None, changes: cleared("0.002") },
        // Modes that lead to each other with a gap, or after a while.
        variant("position", &["set modes.servo.go.below=0.04"]),
        variant("position", &["set modes.servo.go.below=0.08", "set modes.servo.go.for_ms=1000"]),
        // Filters, derivatives and integrals as they should be.
        variant("hybrid", &["time_constant_ms = 200"]),
        variant("hybrid", &["time_constant_ms = 20"]),
        variant("force", &["gains.pressure = { kp = 0.5, ki = 0.1, within = 0.02, kd = 0.01 }"]),
        variant("force", &["gains.pressure = { kp = 0.5, ki = 0.1, bound = 0.01 }"]),
        variant("edge", &["gains.orientation = { kp = 6.0, ki = 6.0, limit = 0.7 }"]),
        variant("edge", &["gains.orientation = { kp = 8.0, ki = 8.0, within = 0.05, limit = 0.7 }"]),
        variant("position", &["gains.x = { kp = 2.0, ki = 0.5, within = 0.002 }"]),
        variant(
            "force",
            &[
                "set nodes.pid.in.error=\"rest.error\"",
                "set nodes.rest.type=\"deadband\"",
                "set nodes.rest.in.error=\"error.error\"",
                "set nodes.rest.width.pressure={ inner = 0.001, outer = 0.003 }",
            ],
        ),
    ]);
    all
}

#[test]
fn no_good_controller_is_blamed() {
    let good = [good(), good_behind_nodes()].into_iter().flatten().collect::<Vec<_>>();
    assert!(good.len() > 60, "{}", good.len());
    let reports = good.iter().filter_map(|variant| Some((variant, variant.warnings()?)));
    let wrong: Vec<String> = reports
        .map(|(variant, report)| format!("{}, {:?}\n{}", variant.task, variant.changes, report.render(false)))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_shipped_task_is_blamed_on_any_bench_that_it_runs_on() {
    let (mut pairs, mut wrong) = (0, Vec::new());
    let folder = workspace().join("graphs");
    let benches: Vec<Option<PathBuf>> =
        [None].into_iter().chain(toml_files(&folder.join("benches")).into_iter().map(Some)).collect();
    // A bench that waits for a simulator to connect is left out.
    let waits = |bench: &Option<PathBuf>| bench.as_ref().is_some_and(|bench| bench.ends_with("lockstep.toml"));
    for task in toml_files(&folder) {
        for bench in benches.iter().filter(|bench| !waits(bench)) {
            let request = Request { bench: bench.clone(), ..Request::file(&task) };
            let Ok(compiled) = compile(&catalogue(), &request) else { continue };
            pairs += 1;
            wrong.extend(compiled.warnings().map(|report| format!("{bench:?}\n{}", report.render(false))));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(pairs > 100, "{pairs} pairs of a task and a bench");
}

#[test]
fn a_rule_that_is_broken_on_purpose_is_allowed_with_its_reason() {
    let changes =
        ["gains.x = { kp = 17.5 }", "+[allow]", "+low-margin = \"it rings on purpose, to show what ringing is\""];
    let compiled = variant("hybrid", &changes).compiled(variant("hybrid", &changes).text());
    assert!(compiled.warnings().is_none());
    assert_eq!(compiled.allowed()[0].count, 1);
}

#[test]
fn the_numbers_of_a_warning_are_those_of_explain() {
    let args = ["graphs/edge.toml", "--set", "nodes.pid.gains.pressure.kp=2.5"];
    let said = crate::tool::say(&[&["explain"], &args[..], &["--format", "json"]].concat());
    let explained: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let loops = explained["motions"][0]["modes"][1]["loops"].as_array().unwrap();
    let margins = &loops.iter().find(|one| one["feature"] == "pressure").unwrap()["margins"];
    let [peak, gain] = ["peak_sensitivity", "gain_db"].map(|key| margins[key].as_f64().unwrap());
    let expected = format!("the peak of its sensitivity is {peak:.1}, and its gain margin {gain:.1} dB");
    let checked = crate::tool::say(&[&["check"], &args[..]].concat());
    assert!(checked.err.contains(&expected), "{expected}\n{}", checked.err);
    let run = crate::tool::say(&[&["run"], &args[..], &["--for", "10ms", "--quiet"]].concat());
    assert!(run.err.contains("warning[low-margin]"), "{}", run.err);
}
