//! The lockstep bridge against a simulator in another language, which knows nothing of this one.

use std::collections::BTreeSet;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tactflow_tests::{single_tasks, workspace};

use crate::cli::in_new_folder;
use crate::tool::{Said, said, tool};

/// The simulator and the port it listens on; it ends with the test.
pub(crate) struct Peer {
    child: Child,
    out: BufReader<std::process::ChildStdout>,
    pub(crate) port: String,
}

impl Peer {
    pub(crate) fn start(args: &str) -> Self {
        Self::of("simulator.py", args)
    }

    pub(crate) fn of(script: &str, args: &str) -> Self {
        let script = workspace().join("tests/peers").join(script);
        let mut command = Command::new("python3");
        command.arg(script).args(args.split_whitespace()).stdout(Stdio::piped());
        let mut child = command.spawn().expect("python3 is there");
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut port = String::new();
        out.read_line(&mut port).unwrap();
        Self { child, out, port: port.trim().to_owned() }
    }

    /// Sends it a signal.
    pub(crate) fn signal(&self, name: &str) {
        let kill = Command::new("kill").args([name, &self.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
    }

    /// What it saw, once it has ended.
    pub(crate) fn seen(mut self) -> Value {
        let mut text = String::new();
        self.out.read_to_string(&mut text).unwrap();
        assert!(self.child.wait().unwrap().success(), "{text}");
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // One that has ended by itself cannot be killed, and need not.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) fn command(graph: &str, port: &str, more: &[&str]) -> Command {
    let address = format!("devices.bench.address=127.0.0.1:{port}");
    let graph = format!("graphs/{graph}.toml");
    let mut args = vec!["run", &graph, "--bench", "graphs/benches/lockstep.toml", "--set", &address];
    args.extend(more);
    tool(&args)
}

/// Runs a graph with a simulator; what the tool said, and what the simulator saw.
fn run(graph: &str, simulator: &str, more: &[&str]) -> (Said, Value) {
    let peer = Peer::start(simulator);
    let said = said(&mut command(graph, &peer.port, more));
    (said, peer.seen())
}

pub(crate) fn number(seen: &Value, name: &str) -> f64 {
    seen[name].as_f64().unwrap_or_else(|| panic!("{name}: {seen}"))
}

#[test]
fn every_servo_task_runs_on_it_with_no_other_change() {
    let cases = [
        ("force", "--scene pen --seconds 1.5", 375.0),
        ("position", "--scene ball --offset 0.01 0 --gap 0.002 --seconds 1.5", 375.0),
        ("hybrid", "--scene ball --offset 0.01 -0.005 --seconds 1.5", 375.0),
        ("rolling", "--scene ball --offset 0.01 0 --seconds 1.5", 375.0),
        ("edge", "--scene edge --gap 0.002 --seconds 1", 250.0),
        ("cable", "--scene cable --radius 0.006 --angle 1.57 --gap 0.002 --seconds 1", 250.0),
        ("explore", "--scene plane --seconds 1.5", 375.0),
    ];
    for (graph, simulator, frames) in cases {
        let (said, seen) = run(graph, simulator, &[]);
        assert_eq!(said.code, 0, "{graph}: {}", said.err);
        assert!(said.out.contains("a device has no more samples"), "{graph}: {}", said.out);
        // Each frame was answered once, by its number, and the simulator ended the run.
        assert_eq!((number(&seen, "commands"), &seen["end"]), (frames, &Value::Null), "{graph}: {seen}");
        assert_eq!(seen["seqs"][4].as_f64(), Some(frames), "{graph}: {seen}");
        assert!(number(&seen, "reports") > 20.0 && number(&seen, "q_eq_moved") > 0.001, "{graph}: {seen}");
    }
}

#[test]
fn an_arm_with_the_stiffness_of_its_robot_file_presses_faster_than_a_stiff_one() {
    let explained = |more: &[&str]| {
        let peer = Peer::start("--scene pen --seconds 1");
        let address = format!("devices.bench.address=127.0.0.1:{}", peer.port);
        let bench = ["explain", "graphs/force.toml", "--bench", "graphs/benches/lockstep.toml", "--set", &address];
        said(&mut tool(&[&bench[..], more].concat()))
    };
    let soft = explained(&[]);
    assert!(soft.out.contains("joint_n_m_per_rad = 200.0"), "{}{}", soft.out, soft.err);
    let joints = explained(&["--set", "devices.bench.stiffness=[200, 200, 150, 100, 300, 50, 50]"]);
    assert!(joints.out.contains("joint_n_m_per_rad = 300.0"), "{}{}", joints.out, joints.err);
    let few = explained(&["--set", "devices.bench.stiffness=[200, 200]"]);
    assert!(few.err.contains("the list has 2 entries, but the arm has 7 joints"), "{}", few.err);
    // `force` presses with 30 mm/s at first: the limit of the force slows a stiff arm down.
    let slowed = |more: &[&str]| {
        let (said, _) = run("force", "--scene plane --seconds 2.5", more);
        assert_eq!(said.code, 0, "{}", said.err);
        let row = said.out.lines().find(|line| line.starts_with("move.contact.force")).map(str::to_owned);
        let time = row.map(|row| row.split_whitespace().nth(1).unwrap().parse::<f64>().unwrap());
        time.unwrap_or_default()
    };
    let (soft, stiff) = (slowed(&[]), slowed(&["--set", "facts.arm.joint_n_m_per_rad=1e6"]));
    assert!(stiff > 0.2 && soft < 0.3 * stiff, "limited for {soft} s, and for {stiff} s");
}

#[test]
fn a_ball_is_found_centred_and_measured() {
    let (said, seen) = run("hybrid", "--scene ball --offset 0.01 -0.005 --seconds 5", &[]);
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(number(&seen, "found") < 1.0 && number(&seen, "force") > 0.5, "{seen}");
    // Two tactels and one tactel off at the start [tactels].
    assert!(number(&seen, "x").abs() < 0.3 && number(&seen, "y").abs() < 0.3, "{seen}");
    // The ruler takes the pad's plane for the surface, and the foam gives way by a millimetre or two [m].
    assert!(number(&seen, "off") < 0.002, "{seen}");
    assert_eq!(seen["end"], Value::Null, "the simulator ends it: {seen}");
}

/// What a task achieves on the gantry: how far the contact is from the centre of the pad along x and y at most [m], how
/// far a line is from the pad's y at most, as a cosine, and how far the sensor has moved in its plane at least [m].
type Promise = ([f64; 2], f64, f64);

const ANYWHERE: f64 = f64::INFINITY;
const CENTRED: Promise = ([1e-3, 1e-3], ANYWHERE, 0.0);

/// The tasks on the second simulator, each with its scene, its duration [s] and what it promises.
const ON_THE_GANTRY: [(&str, &str, f64, Promise); 9] = [
    ("force", "--scene rod --radius 0.006", 2.4, ([ANYWHERE; 2], ANYWHERE, 0.0)),
    ("position", "--scene ball --offset 0.006 -0.004", 2.4, CENTRED),
    ("hybrid", "--scene ball --offset 0.006 -0.004", 3.2, CENTRED),
    ("rolling", "--scene ball --radius 0.05 --offset 0.006 -0.004", 3.2, CENTRED),
    ("edge", "--scene edge --angle 1.2", 4.0, ([ANYWHERE; 2], 0.06, 0.0)),
    ("cable", "--scene rod --radius 0.004 --angle 1.3 --offset 0.003 0", 4.8, ([1e-3, ANYWHERE], 0.03, 0.015)),
    ("explore", "--scene plane", 4.8, CENTRED),
    ("square", "--scene plane", 4.8, ([ANYWHERE; 2], ANYWHERE, 0.002)),
    (
        "seek_ridge",
        "--scene ridge --radius 0.005 --length 0.06 --angle 1 --offset 0.005 0",
        8.0,
        ([1e-3, 0.02], 0.03, 0.02),
    ),
];

#[test]
fn every_task_works_on_a_second_simulator_with_only_a_bench_of_its_own() {
    for (task, scene, seconds, (from_centre, from_y, way)) in ON_THE_GANTRY {
        let peer = Peer::of("gantry.py", &format!("{scene} --seconds {seconds}"));
        let address = format!("devices.bench.address=127.0.0.1:{}", peer.port);
        let graph = format!("graphs/{task}.toml");
        let args = ["run", &graph, "--bench", "tests/data/gantry_bench.toml", "--quiet", "--set", &address];
        let said = said(&mut tool(&args));
        let seen = peer.seen();
        assert_eq!((said.code, seen["end"].as_str()), (0, None), "{task}: {}", said.err);
        assert_eq!(number(&seen, "frames"), (seconds / 0.008).round(), "{task}: {seen}");
        // It never left the object, and presses with p = 1.
        assert_eq!(number(&seen, "lost"), 0.0, "{task}: {seen}");
        assert!(task == "position" || (number(&seen, "pressure") - 1.0).abs() < 0.25, "{task}: {seen}");
        assert!(
            number(&seen, "x").abs() < from_centre[0] && number(&seen, "y").abs() < from_centre[1],
            "{task}: {seen}"
        );
        assert!(number(&seen, "across") < from_y, "{task}: {seen}");
        let moved = [0, 1].map(|axis: usize| seen["moved"][axis].as_f64().unwrap());
        assert!(moved[0].hypot(moved[1]) > way, "{task}: {seen}");
    }
}

#[test]
fn all_tasks_that_do_not_play_a_recording_run_on_the_second_simulator() {
    let tasks = single_tasks().into_iter().map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned());
    // The limits of `finger_press` are in the raw readings of its recording, the pad of the simulator has one axis, and
    // nobody guides there.
    let others = ["finger_press", "guided", "hold_without_slip"];
    let tasks: BTreeSet<String> = tasks.filter(|task| !others.contains(&task.as_str())).collect();
    assert_eq!(tasks, ON_THE_GANTRY.map(|(task, ..)| task.to_owned()).into());
}

/// What a simulator does wrong, a part of the message, and whether it still listens: then it gets at least two commands
/// after the last good frame, because the arm moves too fast to stop within one.
const WRONGS: [(&str, &str, bool); 14] = [
    ("nan", "line 252: `img[7]`: expected value at byte ", true),
    ("inf", "line 252: `q[2]`: expected value at byte ", true),
    ("null", "line 252: obs 251: `dq[0]`: invalid type: null, expected f64", true),
    ("short", "line 252: obs 251: `img` has 255 numbers, but the pad has 16x16 = 256", true),
    ("missing", "line 252: obs 251: missing field `q_eq`", true),
    ("back-t", "line 252: obs 251: `t` is 0 s after a frame at 0.996 s: the time must not go back", true),
    ("back-seq", "line 252: obs 250: `seq` is 250 after a frame with 250, but it must increase with every frame", true),
    ("type", "line 252: obs 251: `type`: unknown variant `picture`, expected `obs` or `end`", true),
    ("garbage", "line 252: it is not UTF-8 text", true),
    ("words", "line 252: expected value at byte 1, found `ready`", true),
    ("long", "line 252: it is longer than 1 MiB", true),
    ("silent", "the simulator has sent nothing for 2 s", true),
    ("partial", "the simulator has closed the connection without an `end` in the middle of a message", false),
    ("close", "the simulator has closed the connection without an `end`", false),
];

#[test]
fn a_simulator_that_does_wrong_is_named_and_left_with_the_arm_at_rest() {
    for (wrong, message, listens) in WRONGS {
        let simulator = format!("--scene none --seconds 2 --at 250 --silence 30 --misbehave {wrong}");
        // A busy machine delays both sides. A simulator that is silent gets a command every 50 ms for 5 s, and the ramp
        // needs a part of them only.
        let settings = ["--set", "devices.bench.reply_s=2", "--set", "devices.bench.acceleration=0.5"];
        let (said, seen) = run("hybrid", &simulator, &settings);
        assert_eq!(said.code, 1, "{wrong}: {}", said.err);
        let line = said.err.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
        assert!(line.contains("device `bench` failed: the simulator at `127.0.0.1:"), "{wrong}: {line}");
        assert!(line.contains(message) && line.contains(" in tick 251"), "{wrong}: {line}");
        assert!(said.out.contains("a fault after 1.000 s"), "{wrong}: {}", said.out);
        let told = seen["end"].as_str().unwrap_or_default();
        assert_eq!(told.contains(message), listens, "{wrong}: {seen}");
        if listens {
            assert_eq!(number(&seen, "last_dq"), 0.0, "{wrong}: {seen}");
            assert!(number(&seen, "commands") > 252.0, "it goes to zero by steps, {wrong}: {seen}");
        } else {
            assert!(number(&seen, "last_dq") > 0.0, "it moved when the line was cut: {seen}");
        }
        // No joint ever changed its speed by more than it bears in a frame [rad/s].
        assert!(number(&seen, "step") <= 0.5 * 0.004 + 1e-9, "{wrong}: {seen}");
    }
}

#[test]
fn a_bench_without_a_robot_takes_the_model_that_the_simulator_names() {
    let (_folder, bench) = in_new_folder("bench.toml");
    let shipped = fs::read_to_string(workspace().join("graphs/benches/lockstep.toml")).unwrap();
    let without: String =
        shipped.lines().filter(|line| !line.starts_with("robot")).map(|line| format!("{line}\n")).collect();
    assert!(without.len() < shipped.len());
    fs::write(&bench, without + "joint_rad_per_s2 = 5.0\nlead_rad = 0.1\n").unwrap();
    for (wrong, message) in [("hello-urdf", "names the model `titan`, which is not built in"), ("none", "")] {
        let peer = Peer::start(&format!("--seconds 1 --silence 1 --misbehave {wrong}"));
        let address = format!("devices.bench.address=127.0.0.1:{}", peer.port);
        let said = said(&mut tool(&["check", "graphs/hybrid.toml", "--bench", &bench, "--set", &address]));
        assert_eq!(said.code, if message.is_empty() { 0 } else { 2 }, "{wrong}: {}", said.err);
        assert!(said.err.contains(message), "{wrong}: {}", said.err);
    }
}

#[test]
fn a_hello_that_will_not_do_is_told_before_anything_runs() {
    let cases = [
        ("proto", "hello (line 1): `proto`: 2 is not the supported protocol version, 1"),
        ("missing", "hello (line 1): missing field `pitch`"),
        ("nan", "hello (line 1): `dq_max[0]`: expected value at byte "),
        ("short", "hello (line 1): `q_min` has 6 numbers, but there are 7 `joints`"),
        ("mirror", "hello (line 1): `T_es`: this is not a pose: its axes are left-handed"),
        ("dt", "hello (line 1): `dt`: 0 is not greater than 0"),
        ("names", "its `joints` are [\"lwr_a6_joint\""),
        ("tip", "the model has no link `hand`"),
        ("garbage", "hello (line 1): invalid type: integer `220`, expected a JSON object"),
        ("silent", "the simulator sent no `hello`: the simulator has sent nothing for 2 s"),
        ("close", "the simulator sent no `hello`: the simulator has closed the connection without an `end`"),
    ];
    for (wrong, message) in cases {
        let peer = Peer::start(&format!("--seconds 1 --silence 30 --misbehave hello-{wrong}"));
        let said = said(&mut command("hybrid", &peer.port, &["--set", "devices.bench.reply_s=2"]));
        assert_eq!(said.code, 2, "{wrong}: {}", said.err);
        assert!(said.err.contains(message), "{wrong}: {}", said.err);
        assert!(said.err.contains("1 mistake"), "{wrong}: {}", said.err);
        assert!(said.err.contains(&peer.port), "{wrong}: {}", said.err);
        assert!(!said.out.contains("ticks"), "{wrong}: {}", said.out);
    }
}

#[test]
fn nobody_listens() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port().to_string();
    let said = said(&mut command("hybrid", &port, &["--set", "devices.bench.connect_s=0.2"]));
    let message = format!("cannot connect to the simulator at `127.0.0.1:{port}`");
    assert!(
        said.code == 2 && said.err.contains(&message) && said.err.contains("start the simulator first"),
        "{}",
        said.err
    );
}

#[test]
fn the_graph_ends_with_a_ramp_and_says_why() {
    let settings = ["--for", "1s", "--set", "devices.bench.acceleration=0.1"];
    let (said, seen) = run("hybrid", "--scene none --seconds 9", &settings);
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!((seen["end"].as_str(), number(&seen, "last_dq")), (Some("the time limit is reached"), 0.0), "{seen}");
    // The command of the last tick is passed over, so the first step of the ramp may be two.
    assert!(number(&seen, "step") <= 2.0 * 0.1 * 0.004 + 1e-9 && number(&seen, "commands") > 255.0, "{seen}");
    // A fault of the task: it has found nothing within its way.
    let (said, seen) = run("hybrid", "--scene none --seconds 9", &["--set", "modes.approach.fail.after_ms=500"]);
    assert_eq!((said.code, number(&seen, "last_dq")), (1, 0.0), "{seen}");
    assert!(seen["end"].as_str().is_some_and(|end| end.contains("approach")), "{seen}");
}

#[test]
fn a_graph_that_is_only_checked_says_so() {
    let peer = Peer::start("--seconds 1");
    let address = format!("devices.bench.address=127.0.0.1:{}", peer.port);
    let args = ["check", "graphs/hybrid.toml", "--bench", "graphs/benches/lockstep.toml", "--set", &address];
    let said = said(&mut tool(&args));
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!(peer.seen()["end"].as_str(), Some("the graph does not run"));
}

#[test]
fn a_clock_and_numbers_of_its_own_and_a_frame_that_is_missing() {
    let simulator = "--scene ball --seconds 1 --first 1000 --clock 5000.25 --misbehave gap --at 100";
    let (said, seen) = run("hybrid", simulator, &[]);
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!((number(&seen, "commands"), seen["seqs"][4].as_u64()), (250.0, Some(1250)), "{seen}");
    assert!(said.out.contains("after 0.") || said.out.contains("after 1."), "{}", said.out);
    let counted = said.out.lines().any(|line| line.contains("1 missing") || line.contains("gap"));
    assert!(counted, "{}", said.out);
}

#[test]
fn a_simulator_on_the_wall_clock_is_followed_and_not_queued() {
    let begin = Instant::now();
    let (said, seen) = run("hybrid", "--scene ball --seconds 2 --wall", &[]);
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(begin.elapsed() > Duration::from_secs(2));
    assert!(number(&seen, "found") < 1.5, "{seen}");
    // It may skip frames on a busy machine, but the last command is for one of the last frames.
    assert!(number(&seen, "commands") > 100.0 && seen["seqs"][4].as_f64().unwrap() > 400.0, "{seen}");
}
