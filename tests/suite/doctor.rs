//! `tactflow doctor` against a controller in another process.

use std::fs;
use std::io::{Read, Write};
use std::process::{Child, Command, Stdio};

use serde_json::json;
use tactflow_tests::workspace;
use tempfile::tempdir;

use crate::agni::Sensor;
use crate::peer::free_udp_port;
use crate::tool::{Said, say, tool};
use crate::ur::Peer;

/// A controller that sends to a port, until it is dropped.
pub(crate) struct Controller(Child);

impl Controller {
    pub(crate) fn start(port: u16, more: &[&str]) -> Self {
        let script = workspace().join("tests/peers/lwr.py");
        let mut command = Command::new("python3");
        command.arg(script).args(["--port", &port.to_string(), "--seconds", "60", "--restart-s", "0.3"]).args(more);
        Self(command.stdout(Stdio::null()).spawn().expect("python3 is there"))
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

pub(crate) fn bench(port: u16) -> String {
    format!(
        "[bind]\narm = \"arm\"\n[devices.arm]\ntype = \"lwr_fri\"\nrobot = \"builtin:lwr4p.toml\"\nport = {port}\n\
         [limits]\nworkspace_min_m = [-0.9, -0.9, -0.2]\nworkspace_max_m = [0.9, 0.9, 1.2]\n"
    )
}

/// Runs the tool with a line on its standard input.
fn answered(args: &[&str], line: &str) -> Said {
    let mut child = tool(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // A tool that asks nothing may have ended.
    let _ = child.stdin.take().unwrap().write_all(line.as_bytes());
    let (mut out, mut err) = (String::new(), String::new());
    child.stdout.take().unwrap().read_to_string(&mut out).unwrap();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    Said { code: child.wait().unwrap().code().unwrap(), out, err }
}

#[test]
fn an_arm_is_described_and_it_moves_and_is_commissioned_only_after_a_yes() {
    let (folder, port) = (tempdir().unwrap(), free_udp_port());
    let path = folder.path().join("cell.toml");
    let note = folder.path().join("cell.commissioned.toml");
    fs::write(&path, bench(port)).unwrap();
    let path = path.to_str().unwrap();
    let _controller = Controller::start(port, &[]);
    let refused = answered(&["doctor", path, "--for", "500ms", "--move"], "no\n");
    assert_eq!(refused.code, 0, "{}{}", refused.out, refused.err);
    let expected = [
        "position 4: lwr_a3_joint",
        "Hz (declared 250.0 Hz)",
        "clock: stamps are times of the device's own clock",
        "it stops within 200 ms",
        "it waits for its controller",
        "warning: not moved",
    ];
    for text in expected {
        assert!(refused.out.contains(text), "{text}: {}", refused.out);
    }
    assert!(!note.exists());
    // A busy machine may be too slow for the arm, which halts it.
    let trials = (0..3).map(|_| answered(&["doctor", path, "--for", "300ms", "--move"], "yes\n"));
    let proven = trials.into_iter().find(|said| said.code == 0).expect("it moves in some trial");
    assert!(proven.out.contains("without commands, it was at rest after"), "{}", proven.out);
    let note = fs::read_to_string(note).unwrap();
    assert!(note.contains("\n[arm]\nfingerprint = \""), "{note}");
}

#[test]
fn a_device_that_sends_nothing_is_a_problem() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("cell.toml");
    fs::write(&path, bench(free_udp_port())).unwrap();
    let silent = answered(&["doctor", path.to_str().unwrap(), "--for", "300ms", "--move"], "yes\n");
    assert_eq!(silent.code, 1, "{}{}", silent.out, silent.err);
    assert!(silent.out.contains("problem: position: no sample in 0.3 s"), "{}", silent.out);
    assert!(!silent.out.contains("Type `yes`"), "nothing moves: {}", silent.out);
}

/// What the doctor says of a bench with this text, in a time.
fn examined(text: &str, time: &str) -> Said {
    let folder = tempdir().unwrap();
    let path = folder.path().join("cell.toml");
    fs::write(&path, text).unwrap();
    say(&["doctor", path.to_str().unwrap(), "--for", time])
}

/// Asserts that an arm would not move, and that the reason is said once.
fn assert_refused(said: &Said, why: &str) {
    assert_eq!(said.code, 1, "{}{}", said.out, said.err);
    assert!(said.out.contains(&format!("problem: it would not move: {why}")), "{why}: {}", said.out);
    assert_eq!(said.out.matches(why).count(), 1, "{}", said.out);
}

const LIMITS: &str = "[limits]\nworkspace_min_m = [-0.9, -0.9, -0.2]\nworkspace_max_m = [0.9, 0.9, 1.2]\n";

#[test]
fn the_doctor_says_why_a_ur_would_not_move_and_sends_it_nothing() {
    let cases = [
        (json!({ "safety_mode": 3 }), "", Some("the robot is in protective stop (safety_mode 3)")),
        (json!({}), "tool_mass = 1.0", Some("the payload of the robot is 0.500 kg, but `tool_mass` is 1.000 kg")),
        (json!({ "tcp_error": 0.01 }), "", Some("the model puts the tip at")),
        (json!({ "robot_mode": 5 }), "", Some("the robot is not running but idle (robot_mode 5)")),
        (json!({}), "tool_mass = 0.5", None),
    ];
    std::thread::scope(|scope| {
        for (settings, params, why) in cases {
            scope.spawn(move || {
                let robot = Peer::start(settings);
                let params = robot.params(params);
                let said =
                    examined(&format!("[bind]\narm = \"arm\"\n[devices.arm]\ntype = \"ur\"\n{params}{LIMITS}"), "4s");
                match why {
                    Some(why) => assert_refused(&said, why),
                    None => {
                        assert_eq!(said.code, 0, "{}{}", said.out, said.err);
                        assert!(said.out.contains("it waits for its controller"), "{}", said.out);
                    }
                }
                let is_sent = robot.count(|event| !event["program"].is_null() || !event["mode"].is_null());
                assert_eq!(is_sent, 0, "{:?}", robot.events());
            });
        }
    });
}

#[test]
fn the_doctor_says_why_an_lwr_would_not_move() {
    let cases: [(&[&str], Option<&str>); 3] = [
        (&["--sag", "0.2"], Some("joint `lwr_a1_joint` is at")),
        (&["--pose-off", "0.01"], Some("the model puts the tip at")),
        (&[], None),
    ];
    std::thread::scope(|scope| {
        for (settings, why) in cases {
            scope.spawn(move || {
                let port = free_udp_port();
                let _controller = Controller::start(port, settings);
                // A run would wait for the state command for a shorter time.
                let said = examined(&bench(port).replace("[limits]", "wait_s = 0.1\n[limits]"), "2s");
                match why {
                    Some(why) => assert_refused(&said, why),
                    None => assert_eq!(said.code, 0, "{}{}", said.out, said.err),
                }
            });
        }
    });
}

#[test]
fn each_sensor_of_a_device_is_described() {
    let sensor = Sensor::start(&["--sensors", "512,192"]);
    let said = examined(
        &format!(
            "allow_uncalibrated = true\n[bind]\nleft_pad = \"skin.left\"\nright_pad = \"skin.right\"\n[devices.skin]\n\
             type = \"agni\"\nlink = \"serial:{}\"\nrate_hz = 200\nsilence_ms = 20000\nstamp_unit_ms = 0.1\n\
             sensors = [{{ side = \"left\" }}, {{ side = \"right\", layout = \"glove\" }}]\n",
            sensor.link.display()
        ),
        "3s",
    );
    let expected = [
        "left.image: 16 by 16 tactels, in 1;",
        "right.image: 8 by 8 tactels, in 1;",
        "clock: stamps are times of the device's own clock",
    ];
    for text in expected {
        assert!(said.out.contains(text), "{text}: {}{}", said.out, said.err);
    }
    for side in ["left", "right"] {
        let rate =
            said.out.lines().any(|line| line.contains(&format!("{side}.image: ")) && line.contains(" samples, "));
        assert!(rate, "{side}: {}", said.out);
    }
}
