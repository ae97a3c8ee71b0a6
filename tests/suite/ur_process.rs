//! The device `ur` in a process that runs a graph: what a halt says, and what the robot does when the process is killed
//! or stopped.

use std::fs;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::json;
use tempfile::TempDir;

use crate::cli::in_new_folder;
use crate::peer::SOON;
use crate::tool::tool;
use crate::ur::Peer;

/// The last joint turns, for as long as the run lasts.
pub(crate) const GRAPH: &str = "[graph]\nclock = 'arm'\nstart = 'go'\n[roles]\narm = 'bare_arm'\n[commands]\narm.velocity = 'move.velocity'\n\
    [nodes.turn]\ntype = 'twist_source'\ntwist = [0, 0, 0, 0, 0, 0.3]\n\
    [modes.go]\nfail = { after_ms = 60000 }\n\
    [parts.move]\nfile = 'builtin:parts/bare_move.toml'\nin.twist = 'turn.twist'\nin.position = 'arm.position'\n\
    in.equilibrium = 'arm.equilibrium'\n\
    [limits]\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8\nlinear_m_per_s2 = 2.0\nangular_rad_per_s2 = 10.0\n\
    joint_rad_per_s2 = 5.0\nlead_rad = 0.1\n\
    workspace_min_m = [-1, -1, -1]\nworkspace_max_m = [1, 1, 1]\n[bind]\narm = 'arm'\n[devices.arm]\ntype = 'ur'\n";
/// Time within which the robot rests by itself in these tests [s]: 200 ms, three steps, the stop from 0.3 rad/s at
/// 4 rad/s², and what a busy machine adds to the steps of the robot.
const REST: f64 = 0.2 + 0.024 + 0.075 + 0.15;

/// Starts the tool on a robot, and waits until the robot turns.
fn process(peer: &Peer) -> (TempDir, Child) {
    let (folder, graph) = in_new_folder("graph.toml");
    fs::write(&graph, format!("{GRAPH}{}", peer.params(""))).unwrap();
    let mut command = tool(&["run", &graph, "--listen", "--slow", "1"]);
    let child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    until(|| peer.motion(0.0).0 > 0.25);
    (folder, child)
}

fn until(is_so: impl Fn() -> bool) {
    let end = Instant::now() + SOON;
    while !is_so() {
        assert!(Instant::now() < end, "it does not happen");
        thread::sleep(Duration::from_millis(5));
    }
}

fn signal(child: &Child, name: &str) {
    let kill = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(kill.success());
}

/// Ends the tool, and returns what it said.
fn end(child: Child) -> String {
    signal(&child, "INT");
    let output = child.wait_with_output().unwrap();
    assert!(output.status.code().is_some(), "it ends by itself");
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn a_process_that_is_killed_leaves_the_robot_at_rest() {
    let mut peer = Peer::start(json!({}));
    let (_folder, mut child) = process(&peer);
    signal(&child, "KILL");
    child.wait().unwrap();
    let killed = peer.tell("mark");
    peer.wait(0, |event| event["ended"].is_string());
    thread::sleep(Duration::from_millis(500));
    assert!(peer.motion(killed).1 < killed + REST, "{} after {killed}", peer.motion(killed).1);
}

#[test]
fn a_process_that_was_stopped_moves_nothing_until_the_operator_resumes() {
    // Shorter and longer than the time of a message; in the middle of a motion each.
    for stop in [100, 400, 1500] {
        let mut peer = Peer::start(json!({}));
        let (_folder, mut child) = process(&peer);
        signal(&child, "STOP");
        let stopped = peer.tell("mark");
        thread::sleep(Duration::from_millis(stop));
        let continued = peer.tell("mark");
        signal(&child, "CONT");
        thread::sleep(Duration::from_millis(600));
        let resumed = peer.tell("mark");
        let (most, last) = peer.motion(stopped + REST + 0.2);
        // A short stop that keeps the connection is followed by a ramp.
        assert!(most == 0.0 || stop == 100, "{stop} ms: {most} rad/s at {last}, {stopped} to {continued}");
        let ramp = peer.velocities(continued);
        let is_ramp = ramp.windows(2).all(|pair| pair[1].1[5].abs() <= pair[0].1[5].abs());
        assert!(is_ramp, "{stop} ms: {ramp:?}");
        child.stdin.as_mut().unwrap().write_all(b"resume\n").unwrap();
        until(|| peer.motion(resumed + 0.01).0 > 0.25);
        end(child);
        until(|| peer.count(|event| event["ended"] == "asked to") == 1);
    }
}

#[test]
fn a_halt_names_what_the_robot_does() {
    for (word, message) in [
        ("protective_stop", "device `arm` does not follow commands: the robot is in protective stop (safety_mode 3)"),
        ("set safety_mode 7", "the robot is in robot emergency stop (safety_mode 7)"),
        ("set slider 0.4", "the speed slider is at 40 % and slows every motion: raise it to 100 %"),
        ("pause", "the program on the robot is paused"),
        ("stop_program", "the program on the robot is stopped"),
    ] {
        let mut peer = Peer::start(json!({}));
        let (_folder, child) = process(&peer);
        let told = peer.tell(word);
        thread::sleep(Duration::from_millis(400));
        let said = end(child);
        assert!(said.contains(message), "{word}: {said}");
        assert_eq!(peer.motion(told + 0.4).0, 0.0, "{word}");
    }
}
