//! What the arm is told in each of a table of situations: `situations/NAME.toml` says what happens to a graph that
//! ships, `situations/NAME.csv` what came of it, the ramp at the end too; `situations/spoilt` holds the same of runs in
//! which a type of node goes wrong. With `TACTFLOW_BLESS=1` the latter are written anew; read the difference before you
//! commit it.
//!
//! In all of them, tick by tick: neither the motion before the limiters nor the one behind them nor any joint ever
//! changes by more than the accelerations of `[limits]` allow, and after a fault every command goes straight to zero.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::fault::Fault;
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::node::PortId;
use tactflow_runtime::signal::Twist;
use tactflow_runtime::source::Item;
use tactflow_tests::saboteur::{How, Sabotage, sabotaged};
use tactflow_tests::{catalogue, on_the_mock_bench, toml_files, workspace};

/// What happens to which graph.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Situation {
    /// Name of a graph that ships.
    graph: String,
    /// Values laid over it.
    #[serde(default)]
    set: Vec<String>,
    /// How long it runs [s].
    for_s: f64,
    /// Words from outside: when [s], and which.
    #[serde(default)]
    send: Vec<(f64, String)>,
    /// The modes in their order.
    modes: Vec<String>,
    /// What the fault says at its end begins with this; nothing went wrong if it is empty.
    #[serde(default)]
    fault: String,
    /// What held the motion in between: what each halt says begins so.
    #[serde(default)]
    halts: Vec<String>,
}

/// The greatest change of a value in a second, as the limiters of a graph allow it.
struct Accelerations {
    linear: f64,
    angular: f64,
    joint: f64,
}

/// A run that is watched.
struct Watch {
    engine: Engine,
    before: PortId,
    behind: PortId,
    allowed: Accelerations,
    /// Both twists and the joints' commands of the last tick.
    last: Option<(Twist, Twist, Vec<f64>)>,
    csv: String,
}

fn number_of(plan: &Compiled, kind: &str, path: &str) -> f64 {
    let node = plan.outline().nodes.iter().find(|node| node.kind.text == kind).unwrap();
    let setting = node.settings.iter().find(|setting| setting.path == path).unwrap();
    match setting.value.item {
        Item::Float(number) => number,
        Item::Integer(number) => number as f64,
        _ => panic!("{path} of {kind} is a number"),
    }
}

impl Watch {
    fn new(plan: Compiled) -> Self {
        let name = |kind: &str| plan.outline().nodes.iter().find(|node| node.kind.text == kind).unwrap().name.clone();
        let (before, behind) = (format!("{}.twist", name("bumpless")), format!("{}.twist", name("acceleration_limit")));
        let allowed = Accelerations {
            linear: number_of(&plan, "acceleration_limit", "linear_m_per_s2"),
            angular: number_of(&plan, "acceleration_limit", "angular_rad_per_s2"),
            joint: number_of(&plan, "joint_limit", "acceleration"),
        };
        let engine = Engine::new(plan);
        let id = |name: &str| engine.ports().iter().find(|(port, _)| port.name == name).unwrap().1;
        let (before, behind) = (id(&before), id(&behind));
        let csv = "time,mode,before.vx,vy,vz,wx,wy,wz,behind.vx,vy,vz,wx,wy,wz,a1,a2,e1,a3,a4,a5,a6\n".into();
        Self { engine, before, behind, allowed, last: None, csv }
    }

    /// A twist on the bus; nothing is zero motion.
    fn twist(&self, id: PortId) -> Twist {
        self.engine.bus().get::<Twist>(id).copied().unwrap_or_default()
    }

    /// Compares with the tick before, `dt` [s] ago, and writes a row now and then.
    fn look(&mut self, dt: f64, what: &str) {
        let now = (self.twist(self.before), self.twist(self.behind), self.engine.commands("arm").unwrap());
        let Accelerations { linear, angular, joint } = self.allowed;
        if let Some(last) = &self.last {
            let at = format!("{what} at {:.3} s", self.engine.now() as f64 * 1e-9);
            for (twist, old, where_) in [(now.0, last.0, "before"), (now.1, last.1, "behind")] {
                let change = Twist(twist.0 - old.0);
                let (v, w) = (change.linear().norm(), change.angular().norm());
                assert!(v <= linear * dt + 1e-9, "{at}: {v} m/s in {dt} s {where_} the limiters");
                assert!(w <= angular * dt + 1e-9, "{at}: {w} rad/s in {dt} s {where_} the limiters");
            }
            for (new, old) in now.2.iter().zip(&last.2) {
                assert!((new - old).abs() <= joint * dt + 1e-9, "{at}: a joint goes from {old} to {new} in {dt} s");
            }
        }
        if self.engine.ticks() % 8 == 1 {
            self.row(&now);
        }
        self.last = Some(now);
    }

    fn row(&mut self, (before, behind, joints): &(Twist, Twist, Vec<f64>)) {
        let time = self.engine.now() as f64 * 1e-9;
        write!(self.csv, "{time:.3},{}", self.engine.mode().unwrap_or("")).unwrap();
        for value in before.0.iter().chain(behind.0.iter()).chain(joints) {
            // Rounding is no motion, and zero has no sign.
            let value = if value.abs() < 5e-6 { 0.0 } else { *value };
            write!(self.csv, ",{value:.5}").unwrap();
        }
        self.csv.push('\n');
    }

    /// Runs to the end of the situation, and on until all is still.
    fn run(&mut self, until: i64, send: &[(f64, String)], what: &str) -> Option<Fault> {
        let (mut fault, mut send) = (None, send.iter().peekable());
        while let Some(next) = self.engine.next().filter(|next| *next <= until && !self.engine.is_done()) {
            while let Some((_, word)) = send.next_if(|(at, _)| (at * 1e9) as i64 <= next) {
                self.engine.send(word).unwrap();
            }
            let dt = (next - self.engine.now()) as f64 * 1e-9;
            if let Err(error) = self.engine.tick(next) {
                fault = Some(error);
                break;
            }
            self.look(dt, what);
        }
        self.wind_down(what);
        fault
    }

    /// The end of every run: straight to zero, and never up again.
    fn wind_down(&mut self, what: &str) {
        let period = self.engine.period() as f64 * 1e-9;
        let mut last = self.engine.commands("arm").unwrap();
        for step in 0.. {
            assert!(step < 10_000, "{what}: the arm never stands still");
            let is_still = self.engine.wind_down();
            let now = self.engine.commands("arm").unwrap();
            for (new, old) in now.iter().zip(&last) {
                assert!((new - old).abs() <= self.allowed.joint * period + 1e-9, "{what}: from {old} to {new}");
                assert!(new.abs() <= old.abs() && new * old >= 0.0, "{what}: from {old} to {new} is not toward zero");
            }
            let time = self.engine.now() as f64 * 1e-9;
            write!(self.csv, "{time:.3},ramp{}", ",".repeat(12)).unwrap();
            now.iter().for_each(|velocity| write!(self.csv, ",{velocity:.5}").unwrap());
            self.csv.push('\n');
            last = now;
            if is_still {
                break;
            }
        }
        assert!(last.iter().all(|velocity| *velocity == 0.0), "{what}: {last:?}");
    }
}

fn graph(name: &str) -> Request {
    on_the_mock_bench(&format!("{name}.toml"))
}

fn check(path: &Path) {
    let what = path.file_stem().unwrap().to_str().unwrap();
    let situation: Situation = toml::from_str(&fs::read_to_string(path).unwrap())
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let request = situation.set.iter().fold(graph(&situation.graph), Request::set);
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{what}: {}", report.render(false)));
    let mut watch = Watch::new(plan);
    let fault = watch.run((situation.for_s * 1e9) as i64, &situation.send, what);
    let said = fault.map_or_else(String::new, |fault| fault.to_string());
    assert!(said.starts_with(&situation.fault) && said.is_empty() == situation.fault.is_empty(), "{what}: {said}");
    let modes: Vec<String> = watch.engine.changes().into_iter().map(|change| change.mode).collect();
    assert_eq!(modes, situation.modes, "{what}");
    let halts: Vec<String> = watch.engine.halts().iter().map(|halt| halt.fault.to_string()).collect();
    let are_meant = halts.len() == situation.halts.len()
        && halts.iter().zip(&situation.halts).all(|(halt, meant)| halt.starts_with(meant));
    assert!(are_meant, "{what}: {halts:#?}");
    compare(&path.with_extension("csv"), &watch.csv);
}

/// Compares a course with the one that is kept.
fn compare(file: &Path, csv: &str) {
    if std::env::var_os("TACTFLOW_BLESS").is_some() {
        fs::write(file, csv).unwrap();
    }
    let known = fs::read_to_string(file).unwrap_or_default();
    let differs = known.lines().zip(csv.lines()).find(|(known, now)| known != now);
    assert!(differs.is_none() && known.len() == csv.len(), "{}: {differs:?}", file.display());
}

/// Where the course is kept of a run in which that node type goes wrong.
fn spoilt(kind: &str, how: &str) -> PathBuf {
    workspace().join(format!("tests/situations/spoilt/{how}_{kind}.csv"))
}

#[test]
fn the_arm_is_told_what_the_files_say() {
    let files = toml_files(&workspace().join("tests/situations"));
    assert!(files.len() > 15, "{} situations", files.len());
    // All are tried, so that one does not hide the next.
    let failed = files.iter().filter(|file| std::panic::catch_unwind(|| check(file)).is_err()).count();
    assert_eq!(failed, 0, "situations that came out otherwise");
}

/// A graph that ships, one node type of which goes wrong in the middle of a contact.
fn sabotage(target: &str, how: How, to: u64, set: &[&str]) -> (Watch, Option<Fault>) {
    // What generates moves at the start, all else in the middle of the contact.
    let from = if target == "twist_source" { 20 } else { 250 };
    let sabotage = Sabotage { target: target.into(), how, from, to };
    let request = set.iter().copied().fold(graph("explore"), Request::set);
    let plan = compile(&sabotaged(&sabotage), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut watch = Watch::new(plan);
    let fault = watch.run(1_900_000_000, &[], &format!("{target} {how:?}"));
    (watch, fault)
}

/// The node types of a graph that ships, in the order in which they step, and the names of their nodes.
fn types() -> Vec<(String, Vec<String>)> {
    let plan = compile(&catalogue(), &graph("explore")).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut types: Vec<(String, Vec<String>)> = Vec::new();
    for name in plan.order() {
        let kind = &plan.outline().nodes.iter().find(|node| node.name == name).unwrap().kind.text;
        match types.iter_mut().find(|(known, _)| known == kind) {
            Some((_, names)) => names.push(name.to_owned()),
            None => types.push((kind.clone(), vec![name.to_owned()])),
        }
    }
    types
}

/// Nodes that write no numbers cannot write a wrong one, nor can one that begins at the end of the task.
const WITHOUT_NUMBERS: [&str; 3] = ["binarize", "label", "park"];

/// What lets a node write something in the first two seconds: the scan begins with the contact.
fn hurry(kind: &str) -> &'static [&'static str] {
    if kind == "follow_surface" { &["nodes.scan.speed_m_per_s=0.01"] } else { &[] }
}

#[test]
fn a_nan_at_each_node_in_turn_ends_the_run_and_names_it() {
    for (kind, names) in types().iter().filter(|(kind, _)| !WITHOUT_NUMBERS.contains(&kind.as_str())) {
        let (watch, fault) = sabotage(kind, How::Nan, u64::MAX, hurry(kind));
        let fault = fault.unwrap_or_else(|| panic!("{kind}: nothing happened"));
        assert!(names.contains(&fault.node), "{kind}: {fault}");
        assert!(fault.to_string().contains("is not a finite number in tick"), "{fault}");
        assert!(fault.tick >= 20 && fault.place.contains(".toml:"), "{fault}");
        compare(&spoilt(kind, "nan"), &watch.csv);
    }
}

#[test]
fn a_panic_at_each_node_in_turn_ends_the_run_and_names_it() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let spoilt_runs: Vec<_> =
        types().into_iter().map(|(kind, names)| (sabotage(&kind, How::Panic, u64::MAX, &[]), kind, names)).collect();
    std::panic::set_hook(hook);
    for ((watch, fault), kind, names) in spoilt_runs {
        let fault = fault.unwrap_or_else(|| panic!("{names:?}: nothing happened"));
        assert!(names.contains(&fault.node) && fault.tick >= 20, "{fault}");
        assert!(fault.to_string().contains("panicked: sabotage in tick"), "{fault}");
        compare(&spoilt(&kind, "panic"), &watch.csv);
    }
}
