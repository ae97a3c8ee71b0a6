//! Blind motion in closed loop: an arm that feels nothing stops within its bound, whatever else runs beside it.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::node::NodeSpec;
use tactflow_runtime::signal::{Flag, Kind, Pose, Scalar, Twist};
use tactflow_tests::{catalogue, workspace};

/// How far a sensor moved in a run. An approach is straight, and the arm vibrates, so it is the distance from the start.
#[derive(Default)]
struct Way {
    start: Option<Vector3<f64>>,
    end: Vector3<f64>,
    whole_m: f64,
    /// Before the last second.
    early_m: f64,
}

impl Way {
    fn add(&mut self, pose: &Pose, is_last_second: bool) {
        self.end = pose.0.translation.vector;
        self.whole_m = (self.end - *self.start.get_or_insert(self.end)).norm();
        if !is_last_second {
            self.early_m = self.whole_m;
        }
    }

    fn last_second_m(&self) -> f64 {
        (self.whole_m - self.early_m).abs()
    }
}

fn engine(request: &Request) -> Engine {
    Engine::new(compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Runs until `until_s` and returns the ways of the sensors with these poses.
fn ways<const N: usize>(engine: &mut Engine, until_s: f64, poses: [&str; N]) -> [Way; N] {
    let mut ways = std::array::from_fn(|_| Way::default());
    let seconds = |now: i64| now as f64 * 1e-9;
    while let Some(next) = engine.next().filter(|next| seconds(*next) < until_s) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        for (way, pose) in ways.iter_mut().zip(poses) {
            if let Some(pose) = engine.get::<Pose>(pose) {
                way.add(pose, seconds(next) > until_s - 1.0);
            }
        }
    }
    ways
}

fn two_arms() -> Request {
    Request::file(workspace().join("tests/data/two_arms/press_and_slide.toml"))
}

#[test]
fn an_arm_that_finds_nothing_stops_within_its_bound_and_the_other_one_goes_on() {
    let mut engine = engine(&two_arms());
    let poses = ["left_move.state.sensor_pose", "right_move.state.sensor_pose"];
    let [left, right] = ways(&mut engine, 9.0, poses);
    assert!((0.048..=0.0501).contains(&right.whole_m), "the right arm moved {:.4} m of 0.05 m", right.whole_m);
    // At 8 mm/s the budget is spent after some 6.5 s. After that, the task still asks the arm to move.
    let last = right.last_second_m();
    assert!(last < 1e-4, "the right arm moved {last:.6} m in the last second");
    assert!(engine.get::<Twist>("right_reach.twist").is_some_and(|twist| twist.0[2] > 0.0), "its task still wants to");
    assert!((left.last_second_m() - 0.005).abs() < 0.001, "the left arm moved {:.4} m", left.last_second_m());
    let rests: Vec<&str> = engine.rests().iter().map(|rest| rest.role.as_str()).collect();
    assert_eq!(rests, ["right_arm"]);
}

#[test]
fn a_contact_on_another_arm_does_not_end_a_motion() {
    let own = compile(&catalogue(), &two_arms());
    assert!(own.is_ok(), "a gate on the contact of its own arm");
    let request = two_arms().set("nodes.left_slide.in.gate='right_touch.present'");
    let Err(report) = compile(&catalogue(), &request) else { panic!("a gate on the contact of the other arm") };
    let codes: Vec<&str> = report.diagnostics.iter().map(|diagnostic| diagnostic.code.name()).collect();
    // The modes that nothing else ends: the wait for a time and the hold.
    assert_eq!(codes, ["ungated-motion"; 2], "{}", report.render(false));
    assert!(report.render(false).contains("left_slide"), "{}", report.render(false));
}

#[test]
fn a_lost_contact_ends_a_cycle_of_its_own_arm_only() {
    let codes = |of: &str, after_ms: i64| {
        let lost = format!("on_lost={{ of = '{of}', after_ms = {after_ms}, to = 'still' }}");
        // Both modes move the right arm, and lead to each other by time.
        let changes = [
            "modes.hold.set.right_reach.twist=[0, 0, 0.008, 0, 0, 0]".to_owned(),
            "modes.search.go={ to = 'hold', after_ms = 3000 }".to_owned(),
            "modes.hold.go={ to = 'search', after_ms = 3000 }".to_owned(),
            "modes.still.set.right_reach.twist=[0, 0, 0, 0, 0, 0]".to_owned(),
            format!("modes.search.{lost}"),
            format!("modes.hold.{lost}"),
        ];
        let request = changes.into_iter().fold(two_arms(), |request, change| request.set(change));
        let diagnostics = compile(&catalogue(), &request).err().map_or_else(Vec::new, |report| report.diagnostics);
        diagnostics.into_iter().map(|diagnostic| diagnostic.code.name()).collect::<Vec<_>>()
    };
    assert!(codes("right_touch.present", 100).is_empty(), "{:?}", codes("right_touch.present", 100));
    assert_eq!(codes("right_touch.present", 3100), ["ungated-motion"], "the time comes first");
    assert!(codes("left_touch.present", 100).contains(&"ungated-motion"), "the left arm may have its contact");
}

#[test]
fn a_gate_that_is_the_flag_of_a_mode_is_open_in_that_mode_alone() {
    // The modes `seek` and `turn` of this task can follow each other without a contact.
    let codes = |mode: &str, more: &[&str]| {
        let signal = [
            "nodes.signal={ type = 'signal_generator', form = 'sine', unit = 'm/s', amplitude = 0.001, frequency = 1.0 }",
            "nodes.shake={ type = 'compose_twist', in.vx = 'signal.value' }",
            "nodes.sum.in.shake='shake.twist'",
        ];
        let request = Request::file(workspace().join("graphs/seek_ridge.toml"));
        let request = request.set(format!("nodes.signal.in.gate='{mode}'"));
        let request = signal.iter().chain(more).fold(request, |request, set| request.set(*set));
        let diagnostics = compile(&catalogue(), &request).err().map_or_else(Vec::new, |report| report.diagnostics);
        diagnostics.into_iter().map(|diagnostic| diagnostic.code.name()).collect::<Vec<_>>()
    };
    assert!(codes("modes.press", &[]).is_empty() && codes("modes.follow", &[]).is_empty());
    assert_eq!(codes("modes.seek", &[]), ["ungated-motion"]);
    // What turns a flag around, or adds other ones, is open in other modes too.
    let not = "nodes.other={ type = 'not', in.flag = 'modes.press' }";
    let any = "nodes.other={ type = 'any', in.press = 'modes.press', in.seek = 'modes.seek' }";
    for other in [not, any] {
        assert_eq!(codes("other.is_met", &[other]), ["ungated-motion"], "{other}");
    }
}

#[test]
fn what_reads_a_flag_alone_writes_nothing_while_it_is_not_set() {
    let catalogue = catalogue();
    let reads_flag_alone = |spec: &NodeSpec| {
        let others = spec.inputs.iter().any(|port| port.need.must_be_wired && port.kind != Kind::Flag);
        let gives_flag = spec.outputs.iter().any(|port| port.kind == Kind::Flag);
        !others && !gives_flag && spec.inputs.iter().any(|port| port.kind == Kind::Flag)
    };
    let specs = catalogue.nodes().iter().map(|node| node.spec());
    let names: Vec<String> = specs.filter(reads_flag_alone).map(|spec| spec.name.into_owned()).collect();
    assert_eq!(names, ["twist_source", "signal_generator"]);
    let request = Request::file(workspace().join("graphs/hybrid.toml"))
        .set("nodes.signal={ type = 'signal_generator', form = 'step', unit = '1', amplitude = 1.0 }")
        .set("nodes.signal.in.gate='modes.servo'")
        .set("nodes.push={ type = 'twist_source', in.gate = 'modes.servo', twist = [0, 0.001, 0, 0, 0, 0] }")
        .set("nodes.sum.in.push='push.twist'");
    let mut engine = engine(&request);
    let mut seen = BTreeSet::new();
    while let Some(next) = engine.next().filter(|next| *next < 2_000_000_000) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        // The flag is that of the tick that has just run.
        let is_open = engine.get::<Flag>("modes.servo") == Some(&true);
        let writes = [engine.get::<Scalar>("signal.value").is_some(), engine.get::<Twist>("push.twist").is_some()];
        assert_eq!(writes, [is_open; 2], "at {next} ns");
        seen.insert(is_open);
    }
    assert_eq!(seen.len(), 2, "open and shut");
}

#[test]
fn a_flag_that_is_made_of_what_rests_may_open_a_gate() {
    // Nothing ends the motion of `push` in `idle`: the signal behind `small` rests there, and `idle` opens the gate.
    let idle = "modes.idle.go={ to = 'approach', when = 'touch.present' }";
    let signal = |amplitude: &str, gate: &str| {
        format!(
            "nodes.signal={{ type = 'signal_generator', form = 'step', unit = '1', amplitude = {amplitude}{gate} }}"
        )
    };
    let small = "nodes.small={ type = 'compare', in.value = 'signal.value', above = -1.0 }";
    let push = "nodes.push={ type = 'twist_source', twist = [0, 0.005, 0, 0, 0, 0], in.gate = 'other.is_met' }";
    let wire = "nodes.sum.in.push='push.twist'";
    let of_mode = signal("0.001", ", in.gate = 'modes.servo'");
    let of_nothing = signal("0.0", "");
    let any = |with: &str| format!("nodes.other={{ type = 'any', in.a = 'small.is_met', in.b = '{with}' }}");
    for (signal, with) in [(&of_mode, "modes.idle"), (&of_mode, "arm.safety"), (&of_nothing, "small.is_met")] {
        let other = any(with);
        let sets = ["graph.start='idle'", idle, signal, small, &other, push, wire];
        let request = Request::file(workspace().join("graphs/hybrid.toml"));
        let request = sets.iter().fold(request, |request, set| request.set(*set));
        let report = compile(&catalogue(), &request).err().unwrap_or_else(|| panic!("{signal}, {with}: it loads"));
        assert!(report.render(false).contains("ungated-motion"), "{with}: {}", report.render(false));
    }
}

#[test]
fn a_number_that_is_0_may_become_a_motion() {
    // The controller of a signal of 0 moves to its setpoint, and a multisine of 0 is done after a while.
    let controlled = [
        "nodes.zero={ type = 'signal_generator', form = 'step', unit = 'm', amplitude = 0.0, frame = 'pad' }",
        "nodes.far={ type = 'feature_error', in.q = 'zero.value', setpoint.q = 0.01 }",
        "nodes.near={ type = 'pid', in.error = 'far.error', gains.q.kp = 1.0 }",
        "nodes.push={ type = 'inverse_jacobian', in.control = 'near.control', columns.q = [0, 1, 0, 0, 0, 0] }",
    ];
    let gated = [
        "nodes.zero={ type = 'multisine', unit = '1', amplitude = 0.0, period = 1.0, min_frequency = 1.0, \
         max_frequency = 2.0, periods = 1 }",
        "nodes.push={ type = 'twist_source', in.gate = 'zero.done', twist = [0, 0.005, 0, 0, 0, 0] }",
    ];
    let idle = ["graph.start='idle'", "modes.idle.go={ to = 'approach', when = 'touch.present' }"];
    for nodes in [&controlled[..], &gated] {
        let request = Request::file(workspace().join("graphs/hybrid.toml")).set("nodes.sum.in.push='push.twist'");
        let request = idle.iter().chain(nodes).fold(request, |request, set| request.set(*set));
        let report = compile(&catalogue(), &request).err().unwrap_or_else(|| panic!("{nodes:?}: it loads"));
        assert!(report.render(false).contains("ungated-motion"), "{}", report.render(false));
    }
}

/// A right arm whose motion reads the force of the left arm's limiter, and whose guidance has this gate.
fn coupled(gate: &str) -> Request {
    let blocks = [
        "nodes.left_soft={ type = 'contact_limit', in.twist = 'left_sum.twist', in.image = 'left_touch.image', \
         force_n = 15.0, peak_n = 3.0, deceleration_m_per_s2 = 2.0 }",
        "parts.left_move.in.twist='left_soft.twist'",
        "nodes.copy_error={ type = 'feature_error', in.k = 'left_soft.force', setpoint.k = 1.0 }",
        "nodes.copy_pid={ type = 'pid', in.error = 'copy_error.error', gains.k.kp = 0.1 }",
        "nodes.copy={ type = 'inverse_jacobian', in.control = 'copy_pid.control', columns.k = [0, 0, 0.001, 0, 0, 0] }",
        "nodes.right_sum={ type = 'twist_adder', in.reach = 'right_reach.twist', in.slide = 'right_slide.twist', \
         in.copy = 'copy.twist' }",
        "parts.right_move.in.twist='right_sum.twist'",
    ];
    let slide =
        format!("nodes.right_slide={{ type = 'twist_source', in.gate = '{gate}', twist = [0, 0.005, 0, 0, 0, 0] }}");
    blocks.iter().fold(two_arms().set(slide), |request, set| request.set(*set))
}

#[test]
fn a_limiter_of_another_arm_does_not_make_its_contact_count() {
    let text = |gate: &str| match compile(&catalogue(), &coupled(gate)) {
        Ok(_) => String::new(),
        Err(report) => report.render(false),
    };
    let [own, other] = ["right_touch.present", "left_touch.present"].map(text);
    assert!(!own.contains("`right_slide`"), "{own}");
    assert!(other.contains("ungated-motion") && other.contains("`right_slide`"), "{other}");
}

#[test]
fn without_an_object_every_approach_stops_within_its_bound() {
    for task in ["hybrid", "force", "position", "edge", "explore"] {
        let request = Request::file(workspace().join(format!("graphs/{task}.toml")))
            .set("devices.bench.objects=[]")
            .set("modes.approach.fail={ after_ms = 9000 }")
            .set("limits.blind_mm=40.0");
        let [way] = ways(&mut engine(&request), 7.0, ["move.state.sensor_pose"]);
        assert!((0.038..=0.0401).contains(&way.whole_m), "{task}: the arm moved {:.4} m of 0.04 m", way.whole_m);
        assert!(way.last_second_m() < 1e-4, "{task}: the arm moved {:.6} m at last", way.last_second_m());
    }
}
