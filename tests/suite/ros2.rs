//! Devices over ROS 2 against CycloneDDS in another process, `tests/peers/ros2/robot.py`: docs/ros2.md.

mod guide;
mod shown;
mod topics;

use std::fs;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tactflow_tests::workspace;
use tempfile::TempDir;

use crate::cli::in_new_folder;
use crate::control_law::rows;
use crate::peer::{Process, SOON};
use crate::record::has_python_module;
use crate::tool::{said, tool};

/// Time within which the arm rests by itself [s]: the horizon of 40 ms, the stop from the speeds of these tests, which are
/// below 0.5 rad/s, at 10 rad/s², the lag of the arm, and what a busy machine adds.
const REST: f64 = 0.04 + 0.05 + 0.1 + 0.15;
/// What is no motion [rad/s].
const STILL: f64 = 1e-3;

/// A robot in another process, in a domain of its own.
struct Robot {
    process: Process,
    domain: u32,
}

impl Robot {
    /// Starts it; `None` without CycloneDDS.
    fn start(domain: u32, settings: Value) -> Option<Self> {
        if !has_python_module("cyclonedds") {
            return None;
        }
        let mut all = json!({ "domain": domain, "urdf": workspace().join("graphs/robots/lwr4p.urdf") });
        all.as_object_mut().unwrap().extend(settings.as_object().unwrap().clone());
        let process = Process::start("ros2/robot.py", [all.to_string().as_str()]);
        process.wait(0, |event| event["t"].is_f64());
        Some(Self { process, domain })
    }

    /// Writes a bench with this robot. `change` replaces lines of it.
    fn bench(&self, change: &[(&str, &str)]) -> (TempDir, String) {
        let (folder, path) = in_new_folder("bench.toml");
        let text = fs::read_to_string(workspace().join("tests/data/ros2_bench.toml")).unwrap();
        let text = text.replace("../../graphs", &workspace().join("graphs").display().to_string());
        let mut text = text.replace("domain = 17", &format!("domain = {}", self.domain));
        for (from, to) in change {
            assert!(text.contains(from), "{from}");
            text = text.replace(from, to);
        }
        fs::write(&path, text).unwrap();
        (folder, path)
    }

    fn tell(&mut self, word: &str) {
        let from = self.process.count();
        self.process.say(word);
        self.process.wait(from, |event| event["heard"] == word);
    }

    /// The largest speed of a joint from a moment on [s, wall clock], [rad/s].
    fn speed(&self, from: f64) -> f64 {
        let lines = self.process.said(0);
        let later = lines.iter().filter(|line| line["t"].as_f64().is_some_and(|t| t > from));
        later.map(|line| line["speed"].as_f64().unwrap()).fold(0.0, f64::max)
    }

    /// The time of the newest line [s, wall clock].
    fn now(&self) -> f64 {
        self.process.said(0).iter().rev().find_map(|line| line["t"].as_f64()).unwrap()
    }

    /// The newest number of something.
    fn count(&self, what: &str) -> u64 {
        self.process.said(0).iter().rev().find_map(|line| line[what].as_u64()).unwrap()
    }

    /// Waits until the arm moves.
    fn moves(&self) {
        self.process.wait(self.process.count(), |event| event["speed"].as_f64().is_some_and(|speed| speed > 0.01));
    }
}

fn signal(id: u32, name: &str) {
    let kill = Command::new("kill").args([&format!("-{name}"), &id.to_string()]).status().unwrap();
    assert!(kill.success());
}

/// Starts the hybrid task on a bench.
fn run(bench: &str) -> Child {
    let mut run = tool(&["run", "graphs/hybrid.toml", "--bench", bench, "--slow", "1", "--quiet", "--for", "20s"]);
    run.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

/// Waits for the end of a run, and returns what it said.
fn end(child: Child) -> String {
    let output = child.wait_with_output().unwrap();
    String::from_utf8(output.stderr).unwrap()
}

/// Mean and standard deviation.
fn spread(values: &[f64]) -> (f64, f64) {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    (mean, (squares / values.len() as f64).sqrt())
}

#[test]
fn the_hybrid_task_holds_the_contact_over_ros_2() {
    // The joints stand in another order than in the model, and a gripper is among them.
    let names = json!([
        "gripper",
        "lwr_a6_joint",
        "lwr_a5_joint",
        "lwr_a4_joint",
        "lwr_a3_joint",
        "lwr_a2_joint",
        "lwr_a1_joint",
        "lwr_e1_joint"
    ]);
    let Some(robot) = Robot::start(31, json!({ "names": names })) else { return };
    assert_holds(&robot, &[]);
}

/// What an arm that follows velocities has in its block.
const VELOCITY: (&str, &str) =
    ("command = \"/command\"", "command = \"/command\"\nmessage = \"velocity\"\nwatchdog_ms = 100.0");

/// What an arm that is commanded through MoveIt Servo has in its block.
const TWIST: (&str, &str) = (
    "command = \"/command\"",
    "command = \"/command\"\nmessage = \"twist\"\nwatchdog_ms = 100.0\ncommand_in_type = \"speed_units\"\nframe = \"base\"",
);

#[test]
fn the_hybrid_task_holds_the_contact_through_twists_of_servo() {
    let Some(robot) = Robot::start(72, json!({ "command": "twist" })) else { return };
    assert_holds(&robot, &[TWIST]);
}

/// Runs the hybrid task: the contact is held, and the commands are young. It says how old they are.
fn assert_holds(robot: &Robot, change: &[(&str, &str)]) {
    let (folder, bench) = robot.bench(change);
    let out = folder.path().join("run.csv");
    let recording = folder.path().join("run.mcap");
    let [out, recording] = [&out, &recording].map(|path| path.to_str().unwrap());
    let args = ["run", "graphs/hybrid.toml", "--bench", &bench, "--slow", "1", "--quiet", "--for", "9s", "--out", out];
    let ran = said(&mut tool(&[&args[..], &["--record", recording]].concat()));
    assert_eq!(ran.code, 0, "{}", ran.err);
    let late: Vec<_> = rows(out).into_iter().filter(|row| row["time"] > 6.0).collect();
    let column = |name: &str| late.iter().filter_map(|row| row.get(name).copied()).collect::<Vec<f64>>();
    for (name, bound) in [("error.error.x", 0.2e-3), ("error.error.y", 0.2e-3), ("error.error.pressure", 0.01)] {
        let (mean, deviation) = spread(&column(name));
        assert!(mean.abs() < bound && deviation < bound, "{name}: {mean} ± {deviation}");
    }
    let ages = robot.process.said(0).into_iter().flat_map(|line| {
        let ages = line["ages"].as_array().cloned().unwrap_or_default();
        ages.into_iter().map(|age| age.as_f64().unwrap()).collect::<Vec<f64>>()
    });
    let mut ages: Vec<f64> = ages.collect();
    ages.sort_by(f64::total_cmp);
    assert!(ages.len() > 500 && robot.count("refused") == 0, "{} commands", ages.len());
    let [half, most] = [0.5, 0.99].map(|part| ages[(part * ages.len() as f64) as usize] * 1e3);
    let _ =
        writeln!(std::io::stderr(), "{} commands: {half:.2} ms old at the median, {most:.2} ms at 99 %", ages.len());
    assert!(half < 10.0 && most < 40.0, "{half} ms, {most} ms");
    // A replay needs neither the robot nor a domain.
    let replayed = said(&mut tool(&["replay", "--quiet", recording]));
    assert_eq!(replayed.code, 0, "{}", replayed.err);
}

#[test]
fn arrays_and_tactile_states_are_pads_too() {
    for (domain, pad, message) in [(32, "array", "array"), (33, "tactile_state", "tactile_state\"\nchannel = \"palm")] {
        let Some(robot) = Robot::start(domain, json!({ "pad": pad })) else { return };
        let (_folder, bench) = robot.bench(&[("message = \"image", &format!("message = \"{message}"))]);
        let args = ["run", "graphs/hybrid.toml", "--bench", &bench, "--slow", "1", "--quiet", "--for", "5s"];
        let ran = said(&mut tool(&args));
        assert_eq!(ran.code, 0, "{pad}: {}", ran.err);
        let force = robot.process.said(0).iter().rev().find_map(|line| line["force"].as_f64()).unwrap();
        assert!(force > 1.0, "{pad}: {force} N");
    }
}

#[test]
fn velocities_and_twists_move_an_arm_that_has_a_watchdog() {
    for (domain, command, change) in [(34, "velocity", VELOCITY), (73, "twist", TWIST)] {
        let Some(robot) = Robot::start(domain, json!({ "command": command })) else { return };
        let (_folder, bench) = robot.bench(&[change]);
        for name in ["INT", "KILL"] {
            let mut child = run(&bench);
            robot.moves();
            signal(child.id(), name);
            let killed = robot.now();
            let _ = child.wait();
            sleep(Duration::from_secs(1));
            let speed = robot.speed(killed + 0.1 + REST);
            assert!(speed < STILL, "{command} {name}: {speed} rad/s");
        }
    }
}

#[test]
fn whatever_happens_to_the_process_the_arm_comes_to_rest() {
    let Some(robot) = Robot::start(35, json!({})) else { return };
    let (_folder, bench) = robot.bench(&[]);
    for name in ["KILL", "STOP"] {
        let mut child = run(&bench);
        robot.moves();
        signal(child.id(), name);
        let from = robot.now();
        sleep(Duration::from_secs(1));
        let speed = robot.speed(from + REST);
        assert!(speed < STILL, "{name}: {speed} rad/s");
        if name == "STOP" {
            // It goes on, and nothing moves: the commands of its epoch are refused.
            let from = robot.now();
            signal(child.id(), "CONT");
            let text = end(child);
            assert!(text.contains("lost"), "{text}");
            assert!(robot.speed(from) < STILL, "{} rad/s after it goes on", robot.speed(from));
        } else {
            let _ = child.wait();
        }
    }
}

#[test]
fn a_robot_that_hangs_and_comes_back_gets_no_old_command() {
    // Velocities have no times: old ones are obeyed, but no longer than the watchdog says.
    let cases =
        [(36, "trajectory", None, 0.0), (75, "twist", Some(TWIST), 0.0), (76, "velocity", Some(VELOCITY), 0.1 + REST)];
    for (domain, command, change, after) in cases {
        let Some(robot) = Robot::start(domain, json!({ "command": command })) else { return };
        let (_folder, bench) = robot.bench(change.as_slice());
        let child = run(&bench);
        robot.moves();
        signal(robot.process.id(), "STOP");
        sleep(Duration::from_millis(1500));
        let lines = robot.process.count();
        signal(robot.process.id(), "CONT");
        let text = end(child);
        assert!(text.contains("is lost"), "{command}: {text}");
        sleep(Duration::from_secs_f64(0.5 + after));
        // The first line has the speed from before the hang.
        let later = robot.process.said(lines + 1);
        let since = later.iter().find_map(|line| line["t"].as_f64()).unwrap() + after;
        let later = later.iter().filter(|line| line["t"].as_f64().is_some_and(|t| t >= since));
        let speeds: Vec<f64> = later.filter_map(|line| line["speed"].as_f64()).collect();
        let fastest = speeds.iter().copied().fold(0.0, f64::max);
        assert!(speeds.len() > 10 && fastest < STILL, "{command}: {fastest} rad/s after it came back");
    }
}

/// What is wrong, and what the run says.
fn assert_says(domain: u32, settings: Value, word: Option<&str>, expected: &str) {
    let Some(mut robot) = Robot::start(domain, settings.clone()) else { return };
    let change = [TWIST];
    let (_folder, bench) = robot.bench(if settings["command"] == "twist" { &change } else { &[] });
    let child = run(&bench);
    if let Some(word) = word {
        robot.moves();
        robot.tell(word);
    }
    let begin = Instant::now();
    let text = end(child);
    assert!(text.contains(expected), "{settings} {word:?}: {text}");
    assert!(begin.elapsed() < SOON, "{settings} {word:?}: it takes {:?}", begin.elapsed());
    // The last trajectory ends at rest.
    let from = robot.now() + REST;
    sleep(Duration::from_secs_f64(REST + 0.3));
    assert!(robot.speed(from) < STILL, "{settings} {word:?}: the arm moves");
}

#[test]
fn what_is_wrong_on_the_topics_is_named() {
    let of_others = "has the joints `finger`, and none of ours";
    let twice = ["a1", "a2", "e1", "a3", "a4", "a5", "a6", "a1"].map(|joint| format!("lwr_{joint}_joint"));
    let cases = [
        (
            json!({ "state_type": "String" }),
            "is lost: `/joint_states` has messages of the type std_msgs/msg/String, and not",
        ),
        (
            json!({ "names": ["lwr_a1_joint", "lwr_a2_joint"] }),
            "lacks the joint `lwr_e1_joint`; it has `lwr_a1_joint`, ",
        ),
        (json!({ "names": ["finger"] }), of_others),
        (json!({ "names": twice }), "has the joint `lwr_a1_joint` more than once in a message"),
        (json!({ "nan_at": 0.0 }), "the controller reports no number as the position of joint"),
        (json!({ "stamp_offset": -1.7e9 }), "are years away from the clock of this machine"),
        (json!({ "stamp_offset": -0.5 }), "behind the clock of this machine, and at most 20 ms"),
        (json!({ "stamp_offset": 0.5 }), "ahead of the clock of this machine, and at most 20 ms"),
        (json!({ "command": "twist", "stamp_offset": -0.5 }), "behind the clock of this machine, and at most 20 ms"),
        (
            json!({ "command": "twist", "reader_type": "String" }),
            "`/command` is read as std_msgs/msg/String, and not as",
        ),
        (json!({ "command": null }), "nobody reads `/command` in the domain "),
        (
            json!({ "reader_type": "Float64MultiArray" }),
            "`/command` is read as std_msgs/msg/Float64MultiArray, and not as",
        ),
        (json!({ "reader_durability": "transient_local" }), "asks for another Durability than commands have"),
        (json!({ "rows": 8 }), "`pad.image` is lost: `/tactile`: an image of 8x8 pixels, and not 16x16"),
        (json!({ "pad": null }), "`pad.image` is lost: nobody publishes `/tactile` in the domain "),
    ];
    for (i, (settings, expected)) in cases.into_iter().enumerate() {
        assert_says(40 + i as u32, settings, None, expected);
    }
}

#[test]
fn what_goes_wrong_while_the_arm_moves_stops_it() {
    let cases = [
        ("second", "somebody else publishes on `/command` too"),
        ("twin", "two programs publish our joints on `/joint_states`"),
        ("quiet", "is lost: `/joint_states` is published as sensor_msgs/msg/JointState, but no message arrives"),
        ("nan", "`arm.position` is not a finite number"),
        ("blind", "`pad.image` is lost: `/tactile` is published as sensor_msgs/msg/Image, but no message arrives"),
    ];
    for (i, (word, expected)) in cases.into_iter().enumerate() {
        assert_says(60 + i as u32, json!({}), Some(word), expected);
    }
    assert_says(74, json!({ "command": "twist" }), Some("stray"), "joint `lwr_a6_joint` moves at ");
}

/// A task that reads a force sensor alone, with a part of the bench.
fn of_force(robot: &Robot, params: &str) -> (TempDir, String) {
    let (folder, path) = in_new_folder("force.toml");
    let text = r#"
        [graph]
        clock = "force"
        [roles]
        force = { type = "force_sensor", on = "none" }
        [nodes.smooth]
        type = "low_pass"
        cutoff_hz = 10.0
        in.value = "force.fz"
        [bind]
        force = "wrist"
        [devices.wrist]
        type = "ros2_force"
        topic = "/wrench"
        rate_hz = 250.0
        connect_s = 2.0
        "#;
    fs::write(&path, format!("{text}domain = {}\n{params}", robot.domain)).unwrap();
    (folder, path)
}

#[test]
fn a_wrench_arrives_in_the_frame_of_the_tip() {
    let Some(robot) = Robot::start(37, json!({ "wrench": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3] })) else { return };
    // By hand: the frame of the sensor is turned by a right angle about z, so (x, y) becomes (-y, x), and stands 0.1 m in
    // front of the tip, so the torque of the force (-2, 1, 3) is (-0.1, -0.2, 0) more. The reaction has the other sign.
    let frame = "frame = { xyz = [0.0, 0.0, 0.1], rpy = [0.0, 0.0, 1.5707963267948966] }\n";
    let turned = [-2.0, 1.0, 3.0, -0.2 - 0.1, 0.1 - 0.2, 0.3];
    for (params, expected) in [
        (String::new(), [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]),
        (frame.to_owned(), turned),
        (format!("{frame}is_reaction = true"), turned.map(|value| -value)),
    ] {
        let (folder, path) = of_force(&robot, &params);
        let out = folder.path().join("run.csv");
        let ran = said(&mut tool(&["run", &path, "--quiet", "--for", "1s", "--out", out.to_str().unwrap()]));
        assert_eq!(ran.code, 0, "{}", ran.err);
        let last = rows(out.to_str().unwrap()).pop().unwrap();
        for (name, expected) in ["fx", "fy", "fz", "tx", "ty", "tz"].into_iter().zip(expected) {
            let found = last[&format!("force.{name}")];
            assert!((found - expected).abs() < 1e-9, "{params}{name}: {found}, and not {expected}");
        }
    }
}

#[test]
fn a_force_sensor_of_another_type_or_without_a_number_is_named() {
    for (domain, settings, expected) in [
        (38, json!({ "wrench_type": "String" }), "`/wrench` has messages of the type std_msgs/msg/String, and not"),
        (39, json!({ "wrench": ["nan", 0, 0, 0, 0, 0] }), "`force.wrench` is not a finite number"),
    ] {
        let Some(robot) = Robot::start(domain, settings) else { return };
        let (_folder, path) = of_force(&robot, "");
        let ran = said(&mut tool(&["run", &path, "--quiet", "--for", "5s"]));
        assert!(ran.code != 0 && ran.err.contains(expected), "{expected}: {}", ran.err);
    }
}

#[test]
fn the_domain_of_the_environment_holds_where_the_bench_states_none() {
    let Some(robot) = Robot::start(70, json!({})) else { return };
    let (_folder, bench) = robot.bench(&[("domain = 70\n", "")]);
    let doctor = |id: &str| said(tool(&["doctor", &bench, "--for", "4s"]).env("ROS_DOMAIN_ID", id));
    let there = doctor("70");
    assert_eq!(there.code, 0, "{}{}", there.out, there.err);
    for (id, expected) in [
        ("71", "in the domain 71, where no topic of ROS is published"),
        ("lab", "ROS_DOMAIN_ID is `lab`, and not a number from 0 to 101"),
    ] {
        let other = doctor(id);
        assert!(
            other.code != 0 && (other.out.clone() + &other.err).contains(expected),
            "{id}: {}{}",
            other.out,
            other.err
        );
    }
    assert!(robot.count("taken") == 0 && robot.speed(0.0) < STILL, "the doctor commands the arm");
}

#[test]
fn a_bench_that_cannot_be_right_is_refused_without_a_domain() {
    for (from, to, expected) in [
        ("topic = \"/tactile\"", "topic = \"tactile\"", "`tactile` is no name of a topic"),
        (
            "message = \"image\"",
            "message = \"image\"\nchannel = \"palm\"",
            "`channel` is the sensor of a `tactile_state`",
        ),
        (
            "command = \"/command\"",
            "command = \"/command\"\nmessage = \"velocity\"",
            "write `watchdog_ms`, the time after",
        ),
        ("command = \"/command\"", "command = \"/command\"\nwatchdog_ms = 5", "needs no watchdog"),
        (TWIST.0, &*TWIST.1.replace("speed_units", "unitless"), "set `command_in_type: speed_units` in the parameters"),
        (
            TWIST.0,
            &*TWIST.1.replace("command_in_type = \"speed_units\"\n", ""),
            "takes twists without units, unless its",
        ),
        (
            TWIST.0,
            &*TWIST.1.replace("watchdog_ms = 100.0\n", ""),
            "with the value of Servo's `incoming_command_timeout`",
        ),
        (TWIST.0, &*TWIST.1.replace("frame = \"base\"", ""), "write the planning frame of MoveIt Servo"),
        ("command = \"/command\"", "command = \"/command\"\nframe = \"base\"", "`frame` is for twists"),
        (
            "command = \"/command\"",
            "command = \"/command\"\njoints = [\"a\"]",
            "`joints` has 1 names, but the model has",
        ),
        ("command = \"/command\"", "command = \"/command\"\nnetwork = \"wlan0\"", "`wlan0` is no IP address"),
        ("command = \"/command\"", "command = \"/command\"\ndomain = 300", "101"),
    ] {
        let (_folder, path) = in_new_folder("bench.toml");
        let text = fs::read_to_string(workspace().join("tests/data/ros2_bench.toml")).unwrap();
        let text = text.replace("../../graphs", &workspace().join("graphs").display().to_string());
        let text = text.replace("domain = 17\n", "");
        assert!(text.contains(from), "{from}");
        fs::write(&path, text.replace(from, to)).unwrap();
        let checked = said(&mut tool(&["check", "graphs/hybrid.toml", "--bench", &path]));
        let text = checked.out + &checked.err;
        assert!(checked.code != 0 && text.contains(expected), "{to}: {text}");
    }
}

#[test]
fn the_bench_of_the_page_is_accepted() {
    let page = fs::read_to_string(workspace().join("docs/ros2.md")).unwrap();
    let block = page.split("   ```toml\n").nth(1).unwrap().split("   ```\n").next().unwrap();
    let (_folder, path) = in_new_folder("bench.toml");
    fs::write(&path, block).unwrap();
    let checked = said(&mut tool(&["check", "graphs/force.toml", "--bench", &path]));
    assert_eq!((checked.code, checked.err.as_str()), (0, ""), "{}", checked.out);
}
