//! What each trouble does: counted, held, stopped or a fault; wires that may grow only so old; and samples that come
//! twice, late or not at all, which change nothing that the distinct ones would not.

use proptest::prelude::*;
use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::fault::Fault;
use tactflow_runtime::graph::compile;
use tactflow_runtime::harness::GraphRig;
use tactflow_runtime::signal::{Features, Freshness};
use tactflow_tests::nodes::length_by_hand;
use tactflow_tests::saboteur::{How, Sabotage, sabotaged};
use tactflow_tests::{catalogue, on_the_mock_bench};

use crate::tool::say;

/// A trouble from 0.8 s to 1.0 s, and what a fault says of it.
#[derive(Debug, Clone, Copy)]
struct Case {
    key: &'static str,
    glitch: Option<&'static str>,
    sabotage: Option<(&'static str, How)>,
    says: &'static str,
    /// Whether it is over at 1.0 s.
    ends: bool,
}

const CASES: [Case; 6] = [
    Case { key: "stale", glitch: Some("repeat"), sabotage: None, says: "`pad.image` is 24.0 ms old", ends: true },
    Case {
        key: "clock",
        glitch: Some("silence"),
        sabotage: None,
        says: "the clock device `pad` sends no samples",
        ends: true,
    },
    Case { key: "not_finite", glitch: Some("nan"), sabotage: None, says: "`pad.image` is not a finite", ends: true },
    Case {
        key: "not_finite",
        glitch: None,
        sabotage: Some(("pid", How::Nan)),
        says: "`pid.control` is not",
        ends: true,
    },
    Case { key: "panic", glitch: None, sabotage: Some(("pid", How::Panic)), says: "node `pid` panicked", ends: true },
    Case { key: "device", glitch: Some("unplug"), sabotage: None, says: "device `pad` failed", ends: false },
];

fn engine(case: Case, policy: &str) -> Engine {
    engine_with(case, policy, &[])
}

fn engine_with(case: Case, policy: &str, set: &[&str]) -> Engine {
    let mut request = on_the_mock_bench("hybrid.toml")
        .set("devices.pad.press=[{ from_s = 0.3, force = 3.0, at = [0.008, -0.004] }]")
        .set("devices.pad.for_s=9.0")
        .set(format!("policy.{}='{policy}'", case.key));
    if let Some(glitch) = case.glitch {
        request = request.set(format!("devices.pad.glitch=[{{ at_s = 0.8, for_s = 0.2, kind = '{glitch}' }}]"));
    }
    let request = set.iter().fold(request, |request, set| request.set(*set));
    let catalogue = match case.sabotage {
        Some((target, how)) => sabotaged(&Sabotage { target: target.into(), how, from: 200, to: 250 }),
        None => catalogue(),
    };
    Engine::new(compile(&catalogue, &request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Runs to `until` [s]; whether the arm moves then.
fn moves(engine: &mut Engine, until: f64) -> Result<bool, Fault> {
    while let Some(next) = engine.next().filter(|next| *next <= (until * 1e9) as i64) {
        engine.tick(next)?;
    }
    Ok(engine.commands("arm").unwrap().iter().any(|velocity| velocity.abs() > 1e-3))
}

#[test]
fn what_each_trouble_does_under_each_policy() {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    for case in CASES {
        let mut held = engine(case, "hold");
        assert_eq!(moves(&mut held, 0.79), Ok(true), "{case:?}");
        assert_eq!(moves(&mut held, 0.99), Ok(false), "{case:?} holds");
        assert_eq!(moves(&mut held, 1.6), Ok(case.ends), "{case:?} goes on by itself");
        let halt = &held.halts()[0];
        assert!(halt.fault.to_string().starts_with(case.says), "{case:?}: {}", halt.fault);
        assert_eq!(halt.until.is_some(), case.ends, "{case:?}");

        let mut stopped = engine(case, "stop");
        assert_eq!(moves(&mut stopped, 0.99), Ok(false), "{case:?} stops");
        assert_eq!(moves(&mut stopped, 1.6), Ok(false), "{case:?} waits for the operator");
        assert!(stopped.is_stopped());
        assert_eq!(stopped.send("resume").is_ok(), case.ends, "{case:?}");
        assert_eq!(moves(&mut stopped, 2.4), Ok(case.ends), "{case:?} goes on when it may");

        let fault = moves(&mut engine(case, "fault"), 2.0).unwrap_err();
        assert!(fault.to_string().starts_with(case.says), "{case:?}: {fault}");
        assert!((0.79..0.9).contains(&(fault.time as f64 * 1e-9)), "{case:?}: {fault}");
    }
    std::panic::set_hook(hook);
}

#[test]
fn what_is_only_counted_changes_nothing() {
    let mut counted = engine(CASES[0], "count");
    assert_eq!(moves(&mut counted, 0.79), Ok(true));
    assert_eq!(moves(&mut counted, 1.6), Ok(true));
    assert!(counted.halts().is_empty());
    let image = counted.counters().next().unwrap();
    assert!(image.repeated >= 49, "{image:?}");
}

/// A graph whose two lengths come every 10 ms, with a policy.
fn lengths(policy: &str) -> GraphRig {
    let text = format!(
        "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\nb = \"length\"\n[policy]\nclock = \"count\"\n{policy}\n"
    );
    let rig = GraphRig::new(catalogue(), &text, vec![length_by_hand("a"), length_by_hand("b")]);
    rig.unwrap_or_else(|report| panic!("{}", report.render(false)))
}

#[test]
fn a_tick_that_begins_late_is_told_with_its_own_number() {
    for (policy, faults, halts, is_stopped) in
        [("count", false, 0, false), ("hold", false, 1, false), ("stop", false, 1, true), ("fault", true, 0, false)]
    {
        let mut rig = lengths(&format!("deadline = \"{policy}\""));
        let mut fault = None;
        for (i, ms) in [0.0, 10.0, 35.0, 40.0].into_iter().enumerate() {
            rig.feed("a.value", ms, 1.0);
            if i == 2 {
                rig.engine.begin_late(15_000_000);
            }
            fault = fault.or(rig.tick(ms).err());
        }
        assert_eq!((fault.is_some(), rig.engine.halts().len()), (faults, halts), "{policy}");
        assert_eq!((rig.engine.is_stopped(), rig.engine.late()), (is_stopped, 1), "{policy}");
        if let Some(fault) = fault.or(rig.engine.halts().first().map(|halt| halt.fault.clone())) {
            assert_eq!(fault.to_string(), "a tick began 15.0 ms late in tick 3 at 0.035 s", "{policy}");
        }
        let until = rig.engine.halts().first().map(|halt| halt.until);
        assert!(until.is_none() || (until == Some(Some(40_000_000))) == (policy == "hold"), "{policy}: {until:?}");
    }
}

#[test]
fn each_role_has_its_own_age_and_policy() {
    // What is set, when `a` is heard of no more, and when `b` is: in ms after the last sample of both.
    let cases = [
        ("", 60.0, 60.0, "hold"),
        ("max_age_ms = 25", 30.0, 30.0, "hold"),
        ("max_age_ms = 25\nroles.b.max_age_ms = 40", 30.0, 50.0, "hold"),
        ("roles.a.max_age_ms = 20", 30.0, 60.0, "hold"),
        ("stale = \"count\"\nroles.b = { stale = \"stop\" }", f64::INFINITY, 60.0, "stop"),
        ("stale = \"stop\"\nroles.a.stale = \"count\"", f64::INFINITY, 60.0, "stop"),
    ];
    for (policy, a, b, what) in cases {
        // Each is silent alone, so that the other does not hide it.
        for (silent, expected) in [("a", a), ("b", b)] {
            let mut rig = lengths(policy);
            let mut found = f64::INFINITY;
            for tick in 0..10 {
                let ms = f64::from(tick) * 10.0;
                for role in ["a", "b"].into_iter().filter(|role| tick == 0 || *role != silent) {
                    rig.feed(&format!("{role}.value"), ms, 1.0);
                }
                rig.tick(ms).unwrap();
                if !rig.engine.halts().is_empty() {
                    found = found.min(ms);
                }
            }
            assert_eq!(found, expected, "{silent} is silent under `{policy}`");
            assert_eq!(rig.engine.is_stopped(), expected.is_finite() && what == "stop", "{silent}: `{policy}`");
        }
    }
}

#[test]
fn what_was_never_there_is_not_old() {
    let mut rig = lengths("stale = \"fault\"");
    for tick in 0..20 {
        let ms = f64::from(tick) * 10.0;
        rig.feed("a.value", ms, 1.0);
        rig.tick(ms).unwrap();
    }
}

#[test]
fn each_port_counts_what_came_in() {
    let text = "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n[policy]\nnot_finite = \"hold\"\n";
    let mut rig = GraphRig::new(catalogue(), text, vec![length_by_hand("a")]).unwrap();
    // When it comes, the stamp and the sequence number it says, and its value; a period is 10 ms.
    let samples = [
        (0.0, 0.0, 1, 1.0),
        (10.0, 10.0, 2, 1.0),
        (20.0, 10.0, 2, 1.0),
        (30.0, 30.0, 5, 1.0),
        (60.0, 45.0, 6, 1.0),
        (70.0, 40.0, 7, 1.0),
        (80.0, 80.0, 7, f64::NAN),
        (90.0, 90.0, 7, 1.0),
    ];
    for (at, stamp, sequence, value) in samples {
        rig.feed_as("a.value", at, stamp, sequence, value);
        rig.tick(at).unwrap();
    }
    let found = rig.engine.counters().next().unwrap();
    let counts = [found.new, found.repeated, found.gaps, found.late, found.went_back, found.not_finite];
    assert_eq!(counts, [5, 1, 2, 1, 1, 1], "{found:?}");
}

fn wire(wire: &str) -> GraphRig {
    let text = format!(
        "[graph]\nclock = \"a\"\nreset_after_ms = 1000\n[roles]\na = \"length\"\n[policy]\nstale = \"count\"\n\
         [nodes.count]\ntype = \"count\"\nin.value = {wire}\n[nodes.other]\ntype = \"count\"\nin.value = \"a.value\"\n"
    );
    GraphRig::new(catalogue(), &text, vec![length_by_hand("a")]).unwrap_or_else(|r| panic!("{}", r.render(false)))
}

#[test]
fn a_wire_may_grow_only_so_old() {
    let mut rig = wire("{ from = \"a.value\", max_age_ms = 15 }");
    let mut seen = Vec::new();
    for (ms, is_new) in [(0, true), (10, true), (20, false), (30, false), (40, false), (50, true), (60, false)] {
        let ms = f64::from(ms);
        if is_new {
            rig.feed("a.value", ms, 1.0);
        }
        rig.tick(ms).unwrap();
        seen.push(rig.freshness("count.steps"));
        assert!(rig.get::<f64>("other.steps").is_some(), "the other goes on");
    }
    use Freshness::{Absent, Held, Lost, New};
    assert_eq!(seen, [New, New, Held, Lost, Absent, New, Held]);
    assert_eq!(rig.get::<f64>("count.steps"), Some(&3.0), "state is kept, and nothing counted twice");
}

#[test]
fn a_wire_through_parts_is_as_old_as_the_strictest_on_its_way_allows() {
    let folder = tempfile::tempdir().unwrap();
    let wire = |from: &str, age: &str| match age {
        "" => format!("in.value = \"{from}\""),
        age => format!("in.value = {{ from = \"{from}\", max_age_ms = {age} }}"),
    };
    // The ages on the node's own wire, on that into its part, and on that into the part around; and the first tick, of
    // one every 10 ms, in which the node does without a sample of 0 ms.
    let cases = [
        ("", "", "", f64::INFINITY),
        ("15", "", "", 20.0),
        ("", "25", "", 30.0),
        ("", "", "35", 40.0),
        ("45", "25", "35", 30.0),
        ("35", "45", "15", 20.0),
    ];
    for (own, inner, outer, expected) in cases {
        let own = wire("inputs.value", own);
        let part = |body: &str| format!("[inputs]\nvalue = \"a length\"\n{body}\n");
        let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
        write("inner.toml", part(&format!("[nodes.count]\ntype = \"count\"\n{own}")));
        let inner = wire("inputs.value", inner);
        write("outer.toml", part(&format!("[parts.inner]\nfile = \"inner.toml\"\n{inner}")));
        let file = folder.path().join("outer.toml");
        let text = format!(
            "[graph]\nclock = \"a\"\n[roles]\na = \"length\"\n[policy]\nstale = \"count\"\n\
             [parts.outer]\nfile = {:?}\n{}\n",
            file.to_str().unwrap(),
            wire("a.value", outer),
        );
        let mut rig = GraphRig::new(catalogue(), &text, vec![length_by_hand("a")])
            .unwrap_or_else(|report| panic!("{}", report.render(false)));
        rig.feed("a.value", 0.0, 1.0);
        let mut found = f64::INFINITY;
        for ms in [0.0, 10.0, 20.0, 30.0, 40.0, 50.0] {
            rig.tick(ms).unwrap();
            if rig.freshness("outer.inner.count.steps") == Freshness::Lost {
                found = found.min(ms);
            }
        }
        assert_eq!(found, expected, "{own}; {inner}; {outer}");
    }
}

#[test]
fn an_old_wire_can_stop_or_end_the_run() {
    let mut rig = wire("{ from = \"a.value\", max_age_ms = 15, stale = \"fault\" }");
    rig.feed("a.value", 0.0, 1.0);
    rig.tick(0.0).unwrap();
    let fault = rig.tick(20.0).unwrap_err();
    let expected =
        "`a.value` is 20.0 ms old at `count`, but the maximum is 15.0 ms in tick 2 at 0.020 s (graph.toml:10:21)";
    assert_eq!(fault.to_string(), expected);
    let mut rig = wire("{ from = \"a.value\", max_age_ms = 15, stale = \"stop\" }");
    rig.feed("a.value", 0.0, 1.0);
    rig.tick(0.0).unwrap();
    rig.tick(20.0).unwrap();
    assert!(rig.engine.is_stopped());
}

#[test]
fn an_old_feature_takes_the_others_with_it_only_on_their_common_wire() {
    let present = |own: &str, common: &str| {
        let text = format!(
            "[graph]\nclock = 'a'\n[policy]\nstale = 'count'\n[roles]\na = 'length'\nb = 'length'\n\
             [nodes.x]\ntype = 'count'\nin.value = 'a.value'\n[nodes.y]\ntype = 'count'\nin.value = 'b.value'\n\
             [nodes.error]\ntype = 'feature_error'\nin.x = 'x.steps'\nin.y = {own}\nsetpoint = {{ x = 0.0, y = 0.0 }}\n\
             [nodes.pid]\ntype = 'pid'\nin.error = {common}\ngains.x.kp = 1.0\ngains.y.kp = 1.0\n"
        );
        let mut rig = GraphRig::new(catalogue(), &text, vec![length_by_hand("a"), length_by_hand("b")])
            .unwrap_or_else(|report| panic!("{}", report.render(false)));
        for tick in 0..6 {
            let ms = f64::from(tick) * 10.0;
            rig.feed("a.value", ms, 1.0);
            if tick == 0 {
                rig.feed("b.value", ms, 1.0);
            }
            rig.tick(ms).unwrap();
        }
        let control = rig.get::<Features>("pid.control").map(Features::components);
        control.map(|both| [both[0].get().is_some(), both[1].get().is_some()])
    };
    let aged = |port: &str| format!("{{ from = '{port}', max_age_ms = 25 }}");
    let cases = [
        ("'y.steps'".to_owned(), "'error.error'".to_owned(), Some([true, true])),
        (aged("y.steps"), "'error.error'".to_owned(), Some([true, false])),
        ("'y.steps'".to_owned(), aged("error.error"), None),
        (aged("y.steps"), aged("error.error"), Some([true, false])),
    ];
    for (own, common, expected) in cases {
        assert_eq!(present(&own, &common), expected, "{own}, {common}");
    }
}

#[test]
fn an_old_command_ramps_and_does_what_its_wire_says() {
    // The pad repeats its frame from 0.8 s to 1.0 s, which is only counted.
    let commanded = |stale: &str| {
        let wire = format!("{{ from = 'move.velocity', max_age_ms = 6, stale = '{stale}' }}");
        engine_with(CASES[0], "count", &[&format!("commands.arm.velocity={wire}")])
    };
    for (stale, is_stopped) in [("hold", false), ("stop", true)] {
        let mut engine = commanded(stale);
        assert_eq!(moves(&mut engine, 0.79), Ok(true), "{stale}");
        assert_eq!(moves(&mut engine, 0.99), Ok(false), "{stale}");
        assert_eq!(moves(&mut engine, 1.6), Ok(!is_stopped), "{stale}");
        assert_eq!((engine.is_stopped(), engine.halts().len()), (is_stopped, usize::from(is_stopped)), "{stale}");
    }
    let fault = moves(&mut commanded("fault"), 2.0).unwrap_err();
    let says =
        "`move.joints.velocity` is 8.0 ms old at `arm.velocity`, but the maximum is 6.0 ms in tick 202 at 0.804 s";
    assert!(fault.to_string().starts_with(says), "{fault}");
}

#[test]
fn a_stop_that_nobody_can_end_ends_the_run() {
    let case = CASES[2];
    let options = |sends: &[(f64, &str)]| RunOptions {
        duration: Some(2.0),
        sends: sends.iter().map(|(at, word)| (*at, (*word).to_owned())).collect(),
        ..RunOptions::default()
    };
    let mut engine_ = engine(case, "stop");
    let outcome = run(&mut engine_, &options(&[]), &mut |_| {}).unwrap();
    let End::Fault(fault) = outcome.end else { panic!("{:?}", outcome.end) };
    assert!(fault.to_string().starts_with(case.says), "{fault}");
    assert!(outcome.time < 1_000_000_000, "as soon as the arm stands: {}", outcome.time);
    let mut engine_ = engine(case, "stop");
    let outcome = run(&mut engine_, &options(&[(1.5, "resume")]), &mut |_| {}).unwrap();
    assert_eq!(outcome.end, End::Duration);
    let mut lost = engine(CASES[5], "hold");
    let outcome = run(&mut lost, &RunOptions::default(), &mut |_| {}).unwrap();
    assert!(matches!(outcome.end, End::Fault(_)), "a device that is gone does not come back: {:?}", outcome.end);
}

/// What integrates, averages and differentiates, on one length.
const MEMORIES: &str = "
[graph]
clock = 'a'
max_gap_ms = 100000
[roles]
a = 'length'
[nodes.moving_average]
type = 'moving_average'
in.value = 'a.value'
window = 4
[nodes.recent]
type = 'moving_average'
in.value = 'a.value'
window_ms = 50
[nodes.median]
type = 'median'
in.value = 'a.value'
window = 5
[nodes.pole]
type = 'low_pass'
in.value = 'a.value'
time_constant_ms = 30
[nodes.error]
type = 'feature_error'
in.x = 'a.value'
setpoint = { x = 0.5 }
[nodes.pid]
type = 'pid'
in.error = 'error.error'
gains.x = { kp = 1.0, ki = 2.0, kd = 0.1 }
[nodes.count]
type = 'count'
in.value = 'moving_average.value'
";

fn remembered(rig: &GraphRig) -> Vec<u64> {
    let scalars = ["moving_average.value", "recent.value", "median.value", "pole.value", "count.steps", "count.time"];
    let mut values: Vec<f64> = scalars.iter().map(|port| *rig.get::<f64>(port).unwrap()).collect();
    values.extend(rig.get::<Features>("pid.control").unwrap().components()[0].get());
    values.into_iter().map(f64::to_bits).collect()
}

/// What comes in a tick.
#[derive(Debug, Clone, Copy)]
enum Comes {
    New(f64),
    /// A new one that was taken so long ago [ms].
    Delayed(f64, f64),
    /// The last sample again, under its number.
    Again,
    /// One with an older stamp than the last.
    Older,
    Nothing,
}

proptest! {
    #[test]
    fn what_comes_twice_late_or_not_at_all_changes_nothing_that_the_distinct_samples_would_not(
        pattern in prop::collection::vec(
            prop_oneof![
                3 => (-1.0..1.0f64).prop_map(Comes::New),
                2 => (-1.0..1.0f64, 0.1..9.0f64).prop_map(|(value, late)| Comes::Delayed(value, late)),
                2 => Just(Comes::Again),
                1 => Just(Comes::Older),
                2 => Just(Comes::Nothing),
            ],
            1..60,
        ),
    ) {
        let rig = || GraphRig::new(catalogue(), MEMORIES, vec![length_by_hand("a")]).unwrap();
        let (mut messy, mut clean) = (rig(), rig());
        let (mut last, mut sequence) = (None, 0);
        for (i, comes) in pattern.into_iter().enumerate() {
            let ms = 10.0 * i as f64;
            match (comes, last) {
                (Comes::New(value) | Comes::Delayed(value, _), _) => {
                    let stamp = if let Comes::Delayed(_, late) = comes { ms - late } else { ms };
                    sequence += 1;
                    last = Some((stamp, value));
                    messy.feed_as("a.value", ms, stamp, sequence, value);
                    // Here it comes when it was taken.
                    clean.feed_as("a.value", stamp, stamp, sequence, value);
                    clean.tick(stamp).unwrap();
                }
                (Comes::Again, Some((stamp, value))) => messy.feed_as("a.value", ms, stamp, sequence, value),
                (Comes::Older, Some((stamp, _))) => messy.feed_as("a.value", ms, stamp - 1.0, sequence + 1000, 9.0),
                (Comes::Again | Comes::Older, None) | (Comes::Nothing, _) => {}
            }
            messy.tick(ms).unwrap();
            if last.is_some() {
                prop_assert_eq!(remembered(&messy), remembered(&clean), "after {} ms", ms);
            }
        }
    }
}

#[test]
fn a_motion_that_is_too_old_is_named_in_the_summary() {
    // Five delays of a tick make each motion older than five ticks, so nothing moves.
    let delay = |i: usize| {
        let before = if i == 0 { "sum.twist".to_owned() } else { format!("late_{}.value", i - 1) };
        [format!("--set=nodes.late_{i}.type=twist_delay"), format!("--set=nodes.late_{i}.in.value={before}")]
    };
    let delays: Vec<String> = (0..5).flat_map(delay).collect();
    let delays: Vec<&str> = delays.iter().map(String::as_str).collect();
    let run = ["run", "graphs/edge.toml", "--for=3s"];
    let late = say(&[&run[..], &delays, &["--set=parts.move.in.twist=late_4.value"]].concat()).out;
    let says = "`move.acceleration`: the motion was too old ";
    let line = late.lines().find(|line| line.starts_with(says));
    assert!(line.is_some_and(|line| line.contains(" where 20.0 ms are allowed")), "{late}");
    assert!(!say(&run).out.contains("too old"), "the task as it is");
}
