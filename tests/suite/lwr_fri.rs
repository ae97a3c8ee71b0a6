//! The arm `lwr_fri` against a controller in another process, which knows nothing of this one.
//!
//! The controller (`tests/peers/lwr.py`) checks every answer: while it takes no positions, the answer is the posture that
//! it commands, to the last bit; flags and stiffness change only in the state monitor; each datagram has an answer.

mod process;

use std::net::UdpSocket;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactflow_nodes::devices::lwr_fri::LwrFri;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::LinkRig;
use tactflow_runtime::signal::{Features, Flag, Joints, Scalar};
use tactflow_tests::{catalogue, workspace};

use crate::peer::{Process, SOON, free_udp_port};

/// Velocity of the first joint [rad/s].
const SPEED: f64 = 0.2;
/// What the precision of the wire adds to a step [rad].
const ROUNDING: f64 = 5e-7;

/// A controller in another process.
struct Controller(Process);

impl Controller {
    /// Starts a controller that sends to a port.
    fn start(port: u16, args: &str, events: &str) -> Self {
        let port = port.to_string();
        let args = ["--port", &port, "--events", events].into_iter().chain(args.split_whitespace());
        Self(Process::start("lwr.py", args))
    }

    /// Whether it has said something.
    fn has_said(&self, is_it: impl Fn(&Value) -> bool) -> bool {
        self.0.has_said(is_it)
    }

    /// Waits until it says something, and returns that.
    fn wait_for(&self, is_it: impl Fn(&Value) -> bool) -> Value {
        self.0.wait(0, is_it)
    }

    /// Returns what it saw, once it has ended.
    fn seen(&self) -> Value {
        self.wait_for(|said| said["event"] == "end")
    }
}

fn arm(port: u16, more: &str) -> LinkRig {
    let urdf = workspace().join("graphs/robots/lwr4p.urdf");
    let params = format!("urdf = '{}'\ntip = 'lwr_7_link'\nport = {port}\n{more}", urdf.display());
    LinkRig::start::<LwrFri>(&params).unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

/// An arm and its controller.
fn pair(more: &str, args: &str, events: &str) -> (LinkRig, Controller) {
    let port = free_udp_port();
    let rig = arm(port, more);
    (rig, Controller::start(port, args, events))
}

fn follows(rig: &LinkRig) -> bool {
    rig.get::<Flag>("safety") == Some(&true)
}

/// Commands a velocity of the first joint until something is so. Without `resumes`, what is refused stays refused.
fn drive(rig: &mut LinkRig, speed: f64, resumes: bool, mut is_over: impl FnMut(&LinkRig) -> bool) -> bool {
    let end = Instant::now() + SOON;
    while Instant::now() < end {
        if resumes {
            rig.resume();
        }
        rig.command("velocity", &[speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        rig.wait_until(Duration::from_millis(4), |_| false);
        if is_over(rig) {
            return true;
        }
    }
    false
}

fn count(seen: &Value, name: &str) -> u64 {
    seen[name].as_u64().unwrap_or_else(|| panic!("{name}: {seen}"))
}

fn number(seen: &Value, name: &str) -> f64 {
    seen[name].as_f64().unwrap_or_else(|| panic!("{name}: {seen}"))
}

/// Checks what must hold in every run. `dt` is the sample time [s].
fn assert_clean(seen: &Value, dt: f64) {
    for name in
        ["bad_answers", "unknown_answers", "mirror_errors", "flag_errors", "sequence_errors", "stranger_answers"]
    {
        assert_eq!(count(seen, name), 0, "{name}: {seen}");
    }
    assert_eq!(number(seen, "entry_jump"), 0.0, "{seen}");
    assert!(number(seen, "largest_step") <= SPEED * dt + ROUNDING, "{seen}");
}

/// Position of the first joint that the controller commands [rad].
fn total(seen: &Value) -> f64 {
    seen["total"][0].as_f64().unwrap()
}

#[test]
fn at_every_rate_it_mirrors_then_integrates_and_answers_each_datagram() {
    let runs = [1.0, 4.0, 20.0].map(|sample_ms: f64| {
        thread::spawn(move || {
            let more = format!("sample_ms = {sample_ms}");
            let args = format!("--sample-ms {sample_ms} --seconds 3 --silence-ms 600");
            let (mut rig, krc) = pair(&more, &args, "[]");
            assert!(drive(&mut rig, 0.0, true, follows), "{sample_ms} ms: it never follows");
            let begin = rig.get::<Joints>("equilibrium").unwrap().0[0];
            assert!(drive(&mut rig, SPEED, true, |rig| {
                rig.get::<Joints>("equilibrium").is_some_and(|q| q.0[0] > begin + 0.1)
            }));
            assert!(drive(&mut rig, 0.0, true, |_| krc.has_said(|said| said["event"] == "end")));
            let (seen, position) = (krc.seen(), rig.get::<Joints>("position").cloned());
            assert_clean(&seen, sample_ms * 1e-3);
            assert!((total(&seen) - begin).abs() >= 0.1 - ROUNDING, "{seen}");
            // The last one or two answers may be on their way when it ends.
            let lost = rig.count("lost datagrams");
            assert!(count(&seen, "answered") + lost + 2 >= count(&seen, "sent"), "{sample_ms} ms: {seen}");
            assert!(count(&seen, "commands") > 20, "{seen}");
            assert_eq!(seen["flags"], serde_json::json!([1]), "{seen}");
            if let Some(position) = position {
                assert!((position.0[0] - total(&seen) - 0.003).abs() < 1e-3, "it ends where the controller is");
            }
            rig.stop().unwrap();
        })
    });
    runs.into_iter().for_each(|run| run.join().unwrap());
}

/// Everything that a network does to datagrams, while the arm moves.
const NETWORK: &str = r#"[
    {"at": 0.2, "do": "lose", "count": 1}, {"at": 0.4, "do": "lose", "count": 5}, {"at": 0.6, "do": "duplicate"},
    {"at": 0.8, "do": "hold", "count": 2, "swap": true}, {"at": 1.0, "do": "hold", "count": 6}, {"at": 1.2, "do": "short"},
    {"at": 1.25, "do": "long"}, {"at": 1.3, "do": "wrong_id"}, {"at": 1.35, "do": "not_finite"},
    {"at": 1.4, "do": "stranger", "count": 7}, {"at": 1.6, "do": "lose", "count": 30},
    {"at": 1.9, "do": "old"}, {"at": 2.0, "do": "swallow", "count": 5}
]"#;

#[test]
fn nothing_that_a_network_does_makes_the_target_jump() {
    let (mut rig, krc) = pair("", "--seconds 3.5 --silence-ms 3000 --lag-s 0.02", NETWORK);
    assert!(drive(&mut rig, 0.0, true, follows));
    assert!(drive(&mut rig, SPEED, true, |_| krc.has_said(|said| said["what"] == "swallow")));
    let before = rig.get::<Joints>("equilibrium").unwrap().0[0];
    assert!(drive(&mut rig, SPEED, true, |rig| {
        rig.get::<Joints>("equilibrium").is_some_and(|q| q.0[0] > before + 0.02)
    }));
    assert!(drive(&mut rig, 0.0, true, |_| krc.has_said(|said| said["event"] == "end")));
    let seen = krc.seen();
    assert_clean(&seen, 0.004);
    for (what, expected) in [("bad datagrams", 4), ("repeated datagrams", 1), ("datagrams of a second controller", 7)] {
        assert_eq!(rig.count(what), expected, "{what}: {seen}");
    }
    // The first of the two that are swapped is missing when the second one comes.
    assert_eq!(rig.count("late datagrams"), 2, "{seen}");
    // Of those that come together, all but the newest count too.
    assert!(rig.count("lost datagrams") > 5 + 30 + 1, "{seen}");
    assert_eq!(rig.count("shortened steps"), 0);
    rig.stop().unwrap();
}

#[test]
fn while_it_sends_nothing_the_target_stays_with_the_controller() {
    let (mut rig, krc) = pair("", "--seconds 3 --silence-ms 3000", "[]");
    assert!(drive(&mut rig, 0.0, true, follows));
    for is_mute in [false, true, false] {
        rig.mute(is_mute);
        let until = Instant::now() + Duration::from_millis(300);
        assert!(drive(&mut rig, SPEED, true, |_| Instant::now() > until));
    }
    assert!(drive(&mut rig, 0.0, true, |_| krc.has_said(|said| said["event"] == "end")));
    assert_clean(&krc.seen(), 0.004);
    rig.stop().unwrap();
}

#[test]
fn a_controller_that_does_not_follow_the_answers_stops_the_arm() {
    let events = r#"[{"at": 0.3, "do": "frozen", "value": true}]"#;
    let (mut rig, krc) = pair("max_step = 0.002", "--seconds 3 --silence-ms 3000", events);
    assert!(drive(&mut rig, 0.0, true, follows));
    assert!(drive(&mut rig, SPEED, true, |_| krc.has_said(|said| said["what"] == "frozen")));
    assert!(drive(&mut rig, SPEED, false, |rig| rig.refusal().is_some_and(|why| why.contains("does not follow"))));
    krc.seen();
    rig.stop().unwrap();
}

#[test]
fn after_each_thing_that_is_not_legal_it_rests_until_it_is_resumed() {
    let cases = [
        r#"{"at": 0.3, "do": "monitor"}"#,
        r#"{"at": 0.3, "do": "power", "value": 0}, {"at": 1.1, "do": "power", "value": 127}"#,
        r#"{"at": 0.3, "do": "error", "value": 16}, {"at": 1.1, "do": "error", "value": 0}"#,
        r#"{"at": 0.3, "do": "control", "value": 2}, {"at": 1.1, "do": "control", "value": 3}"#,
        r#"{"at": 0.3, "do": "quality", "value": 1}, {"at": 1.1, "do": "quality", "value": null}"#,
        r#"{"at": 0.3, "do": "restart"}"#,
    ];
    let runs = cases.map(|events| {
        thread::spawn(move || {
            let events = format!("[{events}]");
            let more = "stiffness = 200.0\ndamping_ratio = 0.2";
            let (mut rig, krc) = pair(more, "--seconds 5 --silence-ms 3000 --restart-s 0.8 --lag-s 0.02", &events);
            assert!(drive(&mut rig, 0.0, true, follows), "{events}");
            // It moves until the controller does not follow.
            let mut moved: f64 = 0.0;
            let start = rig.get::<Joints>("equilibrium").unwrap().0[0];
            let is_done = |krc: &Controller| krc.has_said(|said| said["event"] == "do");
            assert!(drive(&mut rig, SPEED, true, |rig| {
                moved = moved.max(rig.get::<Joints>("equilibrium").map_or(0.0, |q| q.0[0] - start));
                is_done(&krc)
            }));
            assert!(moved > 0.01, "{events}: it moved by {moved} rad");
            // It follows again by itself, but rests: nobody resumes.
            assert!(drive(&mut rig, SPEED, false, |rig| events.contains("restart") || !follows(rig)), "{events}");
            assert!(drive(&mut rig, SPEED, false, follows), "{events}");
            let rest = rig.get::<Joints>("equilibrium").unwrap().0[0];
            let until = Instant::now() + Duration::from_millis(300);
            drive(&mut rig, SPEED, false, |rig| {
                let q = rig.get::<Joints>("equilibrium").map_or(rest, |q| q.0[0]);
                assert!((q - rest).abs() < ROUNDING, "{events}: it moves by {}", q - rest);
                Instant::now() > until
            });
            assert!(drive(&mut rig, SPEED, true, |rig| {
                rig.get::<Joints>("equilibrium").is_some_and(|q| q.0[0] > rest + 0.01)
            }));
            assert!(drive(&mut rig, 0.0, true, |_| krc.has_said(|said| said["event"] == "end")));
            assert_clean(&krc.seen(), 0.004);
            rig.stop().unwrap();
        })
    });
    runs.into_iter().for_each(|run| run.join().unwrap());
}

#[test]
fn an_arm_that_is_not_as_its_model_says_never_moves() {
    // The flange is 3 mm off, the drives rest far from their target, the arm is in the wrong control mode, or it is a
    // controller that the bench does not name.
    let cases = [
        ("", "--pose-off 0.003", "[]"),
        ("tool = { xyz = [0.0, 0.0, 0.1] }", "", "[]"),
        ("stiffness = 200.0", "--control 1", "[]"),
        ("controller = '127.0.0.2'", "", "[]"),
        ("", "--only-monitor", "[]"),
        // It is not at the start of the bench: the second joint is 0.2 rad away.
        ("start = [0.0, 0.7, 0.0, -1.3, 0.0, 1.3, 0.0]", "", "[]"),
    ];
    let runs = cases.map(|(more, args, events)| {
        thread::spawn(move || {
            let (mut rig, krc) = pair(more, &format!("{args} --seconds 1.5 --silence-ms 600"), events);
            assert!(drive(&mut rig, SPEED, true, |rig| {
                assert!(!follows(rig), "{more} {args}");
                krc.has_said(|said| said["event"] == "end")
            }));
            let seen = krc.seen();
            assert!(number(&seen, "largest_step") < ROUNDING && number(&seen, "entry_jump") == 0.0, "{seen}");
            assert_eq!((count(&seen, "mirror_errors"), count(&seen, "flag_errors")), (0, 0), "{seen}");
            rig.stop().unwrap();
        })
    });
    runs.into_iter().for_each(|run| run.join().unwrap());
}

#[test]
fn a_run_begins_at_its_start_and_goes_on_anywhere_after_a_stop() {
    // The second joint is 0.08 rad from the start, and the first one is farther away when the session drops.
    let start = "start = [0.0, 0.58, 0.0, -1.3, 0.0, 1.3, 0.0]";
    let (mut rig, krc) =
        pair(start, "--seconds 20 --restart-s 0.2 --until-silent", r#"[{"at": 1.2, "do": "monitor"}]"#);
    let first = |rig: &LinkRig| rig.get::<Joints>("position").map_or(0.0, |joints| joints.0[0]);
    assert!(drive(&mut rig, SPEED, true, |rig| first(rig) > 0.12 && krc.has_said(|said| said["what"] == "monitor")));
    let before = first(&rig);
    assert!(drive(&mut rig, SPEED, true, |rig| follows(rig) && first(rig) > before + 0.05), "{:?}", rig.refusal());
    rig.stop().unwrap();
    // Elsewhere it is refused with both values, and the way out.
    let (mut rig, _krc) = pair("start = [0.0, 0.7, 0.0, -1.3, 0.0, 1.3, 0.0]", "--seconds 20 --until-silent", "[]");
    assert!(drive(&mut rig, SPEED, false, |rig| rig.refusal().is_some_and(|why| why.contains("`start`"))));
    let why = rig.refusal().unwrap();
    assert!(why.contains("joint `lwr_a2_joint` is at 0.5030 rad, but `start` is 0.7000 rad"), "{why}");
    assert!(why.contains("Guide the arm there, raise `start_bounds.posture`, or leave out `start`"), "{why}");
    rig.stop().unwrap();
}

#[test]
fn it_sets_the_impedance_talks_to_the_program_and_leaves_with_cleared_flags() {
    let more = "stiffness = [200, 200, 200, 100, 100, 50, 50]\ndamping_ratio = 0.25\nkrl_ints = { 1 = 10 }\n\
                krl_ints_at_end = { 2 = 1 }";
    let args = "--seconds 20 --silence-ms 600 --start-int 1 10 --stop-int 2 1 --until-silent";
    let (mut rig, krc) = pair(more, args, "[]");
    assert!(drive(&mut rig, 0.0, true, follows));
    rig.stop().unwrap();
    let seen = krc.seen();
    assert_clean(&seen, 0.004);
    assert_eq!((seen["flags"].clone(), count(&seen, "state")), (serde_json::json!([0x31, 0]), 1), "{seen}");
    let [stiffness, damping] = [0, 1].map(|i| seen["impedance"][i].clone());
    assert_eq!(stiffness, serde_json::json!([200.0, 200.0, 200.0, 100.0, 100.0, 50.0, 50.0]));
    assert_eq!(damping, serde_json::json!(vec![0.25; 7]));
    // The other integers come back as the program sends them.
    let ints: Vec<i64> = seen["ints"].as_array().unwrap().iter().filter_map(Value::as_i64).collect();
    assert_eq!(ints, [vec![10, 1], (102..116).collect()].concat());
}

#[test]
fn the_wrench_is_that_on_the_tool_without_its_weight() {
    // The flange points down, turned by 0.0416 rad about y: the weight of 1 kg reads along its z and x.
    let (sin, cos) = (0.041_580_662_433_290_48, 0.999_135_150_273_279_4);
    let weight = 9.80665;
    let args = "--sag 0 --seconds 1.5 --wrench 1 2 3 0.1 0.2 0.3";
    let (mut rig, krc) = pair("tool_mass = 1.0\ntool_com = [0.0, 0.0, 0.1]", args, "[]");
    assert!(drive(&mut rig, 0.0, true, |rig| rig.get::<Features>("wrench").is_some()));
    let wrench: Vec<f64> = rig.get::<Features>("wrench").unwrap().values().map(Option::unwrap).collect();
    let (x, z) = (-weight * sin, weight * cos);
    let expected = [1.0 - x, 2.0, 3.0 - z, 0.1, 0.2 - 0.1 * x, 0.3];
    for ((found, expected), name) in wrench.iter().zip(expected).zip(["fx", "fy", "fz", "tx", "ty", "tz"]) {
        assert!((found - expected).abs() < 1e-5, "{name}: {wrench:?}");
        assert_eq!(rig.get::<Scalar>(name), Some(found));
    }
    krc.seen();
    rig.stop().unwrap();
}

#[test]
fn a_port_that_another_program_has_is_an_error() {
    let taken = UdpSocket::bind("0.0.0.0:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let mut rig = arm(port, "");
    rig.wait_until(Duration::from_millis(100), |_| false);
    let error = rig.stop().unwrap_err().0;
    assert!(error.starts_with(&format!("cannot listen on the UDP port {port}: ")), "{error}");
}

#[test]
fn a_controller_that_is_silent_is_lost_and_found_again() {
    let port = free_udp_port();
    let mut rig = arm(port, "");
    assert!(rig.wait_until(SOON, |rig| rig.lost("position").is_some()));
    let why = rig.lost("position").unwrap().to_owned();
    assert!(why.starts_with(&format!("no datagram of FRI 1.0 has come on the UDP port {port} for 2000 ms")), "{why}");
    for _ in 0..2 {
        let krc = Controller::start(port, "--seconds 1", "[]");
        assert!(rig.wait_until(SOON, |rig| rig.get::<Joints>("position").is_some()));
        krc.seen();
        assert!(rig.wait_until(SOON, |rig| rig.lost("position").is_some()));
        assert!(rig.lost("safety").unwrap().contains("has sent nothing for 100 ms"), "{:?}", rig.lost("safety"));
    }
    rig.stop().unwrap();
}

/// A task that presses with 5 N, as far as its features go.
const PRESS: &str = "
[graph]
clock = 'force'
[roles]
force = 'force_sensor'
[nodes.calm]
type = 'low_pass'
in.value = 'force.tx'
time_constant_ms = 20
[nodes.error]
type = 'feature_error'
in.fz = 'force.fz'
in.tx = 'calm.value'
setpoint = { fz = '-5 N', tx = '200 mN m' }
[nodes.pid]
type = 'pid'
in.error = 'error.error'
gains.fz = { kp = 1.0 }
gains.tx = { kp = 1.0 }
[nodes.jacobian]
type = 'inverse_jacobian'
in.control = 'pid.control'
columns.fz = [0, 0, '-1 mm/N', 0, 0, 0]
columns.tx = [0, 0, 0, '0.1 rad/N/m', 0, 0]
[bind]
force = 'arm'
[devices.arm]
type = 'lwr_fri'
robot = 'builtin:lwr4p.toml'
";

#[test]
fn the_nodes_of_touch_work_on_forces_and_torques() {
    let load = |text: &str| compile(&catalogue(), &Request::text(text));
    load(PRESS).unwrap_or_else(|report| panic!("{}", report.render(false)));
    for (right, wrong, part) in [
        ("'200 mN m'", "'200 mN'", "[N m]"),
        ("'0.1 rad/N/m'", "'0.1 rad/N'", "[rad/N/m]"),
        ("in.fz = 'force.fz'", "in.fz = 'force.wrench'", "wrench"),
    ] {
        let report = load(&PRESS.replace(right, wrong)).err().unwrap_or_else(|| panic!("{wrong} loads"));
        let text = report.render(false);
        assert!(text.contains(part), "{text}");
    }
}
