//! The device `ur` against a robot in another process, `tests/peers/ur.py`: what arrives there, and when it rests.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tactflow_nodes::devices::ur::Ur;
use tactflow_runtime::harness::LinkRig;
use tactflow_runtime::signal::{Features, Flag, Joints};
use tactflow_tests::workspace;

use crate::peer::{Process, SOON, free_tcp_port};

/// Velocities of the tests [rad/s].
const MOVE: [f64; 6] = [0.1, 0.0, 0.0, 0.0, 0.0, -0.1];
/// Maximum acceleration of a joint in the tests [rad/s²].
const ACCELERATION: f64 = 10.0;

/// A robot in another process.
pub(crate) struct Peer {
    process: Process,
    pub(crate) ports: [u64; 2],
}

impl Peer {
    pub(crate) fn start(settings: Value) -> Self {
        let process = Process::start("ur.py", [settings.to_string().as_str()]);
        let first = process.wait(0, |event| event["rtde"].is_u64());
        let ports = ["rtde", "script"].map(|port| first[port].as_u64().unwrap());
        Self { process, ports }
    }

    /// Changes the robot, and waits until it has changed. Returns the time of the robot [s].
    pub(crate) fn tell(&mut self, line: &str) -> f64 {
        let from = self.process.count();
        self.process.say(line);
        let event = self.wait(from, |event| event["told"] == line);
        event["t"].as_f64().unwrap()
    }

    pub(crate) fn events(&self) -> Vec<Value> {
        self.process.said(0)
    }

    /// Waits for an event, from the one with a number.
    pub(crate) fn wait(&self, from: usize, is_it: impl Fn(&Value) -> bool) -> Value {
        self.process.wait(from, is_it)
    }

    /// The velocities that arrived from a time on, each with the time [s], [rad/s].
    pub(crate) fn velocities(&self, from: f64) -> Vec<(f64, [f64; 6])> {
        let messages = self.events().into_iter().filter(|event| event["mode"] == 2);
        let found = messages.map(|event| {
            let qd: [f64; 6] = serde_json::from_value(event["qd"].clone()).unwrap();
            (event["t"].as_f64().unwrap(), qd)
        });
        found.filter(|(time, _)| *time >= from).collect()
    }

    /// The largest speed of a joint after a time, and the time of the last motion [rad/s], [s].
    pub(crate) fn motion(&self, from: f64) -> (f64, f64) {
        let moves = self.events().into_iter().filter(|event| event["speed"].as_f64().is_some_and(|speed| speed > 0.0));
        let moves = moves.filter(|event| event["ended"].is_null());
        let moves = moves.map(|event| (event["speed"].as_f64().unwrap(), event["t"].as_f64().unwrap()));
        moves
            .filter(|(_, time)| *time >= from)
            .fold((0.0, 0.0), |(most, last), (speed, time)| (speed.max(most), time.max(last)))
    }

    pub(crate) fn count(&self, is_it: impl Fn(&Value) -> bool) -> usize {
        self.events().iter().filter(|event| is_it(event)).count()
    }

    /// The parameters of the device for this robot.
    pub(crate) fn params(&self, more: &str) -> String {
        let [rtde, script] = self.ports;
        let urdf = workspace().join("graphs/robots/ur5e.urdf");
        let usual = [("rate_hz", "125"), ("receive_timeout_ms", "200"), ("start_s", "10"), ("silence_s", "1")];
        let usual: String = usual
            .iter()
            .filter(|(name, _)| !more.contains(name))
            .map(|(name, value)| format!("{name} = {value}\n"))
            .collect();
        format!(
            "address = '127.0.0.1'\nrtde_port = {rtde}\nscript_port = {script}\nreverse_port = 0\nurdf = {urdf:?}\n\
             tip = 'tool0'\n{usual}{more}\n"
        )
    }

    pub(crate) fn rig(&self, more: &str) -> LinkRig {
        LinkRig::start::<Ur>(&self.params(more)).unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
    }
}

/// Commands a velocity until something is so. A machine that is too busy to renew it in time resumes.
pub(crate) fn move_until(rig: &mut LinkRig, is_so: impl Fn(&LinkRig) -> bool) {
    let end = Instant::now() + SOON;
    while !is_so(rig) {
        assert!(Instant::now() < end, "it does not happen");
        rig.command("velocity", &MOVE);
        rig.wait_until(Duration::from_millis(5), |_| false);
        rig.resume();
    }
}

/// Commands a velocity for a time, and never resumes.
pub(crate) fn push(rig: &mut LinkRig, time: Duration) {
    let end = Instant::now() + time;
    while Instant::now() < end {
        rig.command("velocity", &MOVE);
        rig.wait_until(Duration::from_millis(5), |_| false);
    }
}

pub(crate) fn follows(rig: &LinkRig) -> bool {
    rig.get::<Flag>("safety") == Some(&true)
}

/// Whether a message with the whole velocity has arrived.
pub(crate) fn is_moving(peer: &Peer, from: f64) -> bool {
    peer.velocities(from).iter().any(|(_, qd)| *qd == MOVE)
}

/// Checks that no velocity jumps, except to zero.
fn assert_smooth(peer: &Peer) {
    let velocities = peer.velocities(0.0);
    assert!(velocities.len() > 3);
    for pair in velocities.windows(2) {
        let ((before, last), (time, next)) = (&pair[0], &pair[1]);
        for (a, b) in last.iter().zip(next) {
            // The steps of the robot are counted, and not the delays of this machine.
            let most = 2.0 * ACCELERATION * (time - before).clamp(0.008, 0.1) * 1.5 + 0.16;
            assert!((b - a).abs() <= most || *b == 0.0, "{a} to {b} rad/s in {} s", time - before);
        }
    }
}

#[test]
fn it_starts_the_program_and_the_robot_follows() {
    let mut peer = Peer::start(json!({ "force": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3] }));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let program = peer.wait(0, |event| event["program"].is_u64());
    assert_eq!((&program["has_stop"], &program["has_open"]), (&json!(true), &json!(false)), "{program}");
    let rtde: Vec<String> = peer.events().iter().filter_map(|event| Some(event["rtde"].as_str()?.to_owned())).collect();
    assert_eq!((rtde[0].as_str(), rtde.last().unwrap().as_str()), ("0005560002", "000353"));
    let message = peer.wait(0, |event| event["mode"] == 2);
    assert_eq!(message["timeout"], 200);
    let from = peer.tell("mark");
    move_until(&mut rig, |_| peer.motion(from).0 > 0.09);
    let start = [0.0, -1.7, -2.0, -1.0124, std::f64::consts::FRAC_PI_2, 0.0];
    // On a busy machine, samples from before the motion may still wait.
    let mut positions = (0..250).map(|_| rig.next::<Joints>("position", SOON).unwrap().0.clone());
    let position = positions.find(|position| position[0] > start[0]).expect("the robot moves");
    assert!(position[5] < start[5] && position.len() == 6, "{position:?}");
    assert!(position.iter().zip(start).skip(1).take(4).all(|(q, start)| (q - start).abs() < 1e-5), "{position:?}");
    // The flange points down, so the z of the base is its -z.
    let wrench = rig.next::<Features>("wrench", SOON).unwrap();
    let [force, down] = [2, 5].map(|i| wrench.components()[i].get().unwrap());
    assert!((force + 3.0).abs() < 1e-3 && (down + 0.3).abs() < 1e-3, "{wrench:?}");
    assert_eq!(rig.count("bad packets"), 0);
    let rests = |_: &LinkRig| peer.events().iter().rev().find_map(|event| event["speed"].as_f64()) == Some(0.0);
    assert!(rig.wait_until(SOON, rests), "the commands have expired");
    rig.stop().unwrap();
    let ended = peer.wait(0, |event| event["ended"].is_string());
    assert_eq!((ended["ended"].as_str(), ended["speed"].as_f64()), (Some("asked to"), Some(0.0)));
    assert_smooth(&peer);
}

#[test]
fn bytes_that_are_split_and_texts_between_them_change_nothing() {
    let peer = Peer::start(json!({ "chunk": 7, "texts": 3 }));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && peer.velocities(0.0).len() > 50);
    assert_eq!((rig.count("bad packets"), rig.lost("position")), (0, None));
    rig.stop().unwrap();
}

#[test]
fn a_controller_that_cannot_be_used_is_named_with_its_reason() {
    for (settings, why) in [
        (json!({ "not_found": ["actual_q"] }), "it does not know the output `actual_q`: update its software"),
        (json!({ "in_use": ["timestamp"] }), "the output `timestamp` is in use by another client: end that program"),
        (json!({ "protocol": false }), "it refuses version 2 of RTDE: it needs PolyScope 3.3 (CB3)"),
    ] {
        let peer = Peer::start(settings);
        let mut rig = peer.rig("");
        // The driver has ended when nothing more is asked of the robot.
        peer.wait(0, |event| event["rtde"].is_string());
        rig.wait_until(Duration::from_secs(1), |_| false);
        let error = rig.stop().unwrap_err().0;
        let address = format!("the robot at 127.0.0.1:{}: ", peer.ports[0]);
        assert!(error.starts_with(&address) && error.contains(why), "{error}");
        assert_eq!(peer.count(|event| event["program"].is_u64()), 0);
    }
}

#[test]
fn an_old_controller_does_not_know_its_payload_and_its_tool() {
    let peer = Peer::start(json!({ "not_found": ["tcp_offset", "payload", "target_speed_fraction"] }));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    rig.stop().unwrap();
}

#[test]
fn what_is_wrong_before_the_first_velocity_keeps_the_program_from_the_robot() {
    for (settings, more, why) in [
        (json!({ "tcp_error": 0.01 }), "", "they are 10.0 mm and 0.0° apart"),
        (
            json!({ "deflection": 0.1 }),
            "",
            "joint `elbow_joint` is at -1.9000 rad, but the controller commands -2.0000 rad",
        ),
        (
            json!({ "payload": 1.5 }),
            "tool_mass = 0.5",
            "the payload of the robot is 1.500 kg, but `tool_mass` is 0.500 kg",
        ),
        (json!({ "slider": 0.5 }), "", "the speed slider is at 50 %"),
        (
            json!({}),
            "start = [0.0, -1.7, -2.0, -1.0124, 1.45, 0.0]",
            "joint `wrist_2_joint` is at 1.5708 rad, but `start` is 1.4500 rad: they differ by more than 0.1 rad",
        ),
        (json!({ "safety_mode": 2 }), "", "the robot is in reduced mode"),
        (json!({ "robot_mode": 5 }), "", "the robot is not running but idle"),
        (json!({ "remote": false }), "start_s = 0.3", "within 300ms: switch it to remote control"),
    ] {
        let peer = Peer::start(settings.clone());
        let mut rig = peer.rig(more);
        assert!(rig.wait_until(SOON, |rig| rig.get::<Flag>("safety") == Some(&false)), "{settings}");
        // The first command is refused, with the reason.
        let end = Instant::now() + SOON;
        while rig.refusal().is_none() && Instant::now() < end {
            push(&mut rig, Duration::from_millis(50));
            // A machine that is too busy to renew a command in time gives no reason.
            if rig.refusal().is_none() {
                rig.resume();
            }
        }
        push(&mut rig, Duration::from_millis(200));
        assert!(!follows(&rig) && peer.count(|event| event["program"].is_u64()) == 0, "{settings}");
        let refusal = rig.refusal().unwrap_or_else(|| panic!("{settings}"));
        assert!(refusal.contains(why), "{refusal}");
        rig.stop().unwrap();
    }
    let peer = Peer::start(json!({ "slider": 0.5, "safety_mode": 2 }));
    let mut rig = peer.rig("min_speed_fraction = 0.5\nallow_reduced = true\ntool_mass = 0.45");
    move_until(&mut rig, follows);
    rig.stop().unwrap();
}

#[test]
fn a_connection_that_breaks_in_a_packet_is_made_again_and_nothing_moves_before_resume() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let cut = peer.tell("cut");
    assert!(rig.wait_until(SOON, |rig| rig.count("reconnects") > 0));
    assert!(peer.wait(0, |event| event["ended"].is_string())["ended"] == "the connection is closed");
    push(&mut rig, Duration::from_millis(1500));
    assert!(rig.get::<Joints>("position").is_some() && !follows(&rig), "{:?}", rig.lost("position"));
    let programs = peer.count(|event| event["program"].is_u64());
    assert_eq!((programs, peer.velocities(cut + 0.1).len()), (1, 0));
    rig.resume();
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, cut + 0.1));
    assert_eq!(peer.count(|event| event["program"].is_u64()), 2);
    rig.stop().unwrap();
}

#[test]
fn after_a_protective_stop_the_program_starts_when_the_operator_resumes() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let stopped = peer.tell("protective_stop");
    assert!(rig.wait_until(SOON, |rig| !follows(rig)));
    push(&mut rig, Duration::from_millis(300));
    // A resume while the stop is active changes nothing.
    rig.resume();
    push(&mut rig, Duration::from_millis(300));
    assert!(!follows(&rig));
    peer.tell("unlock");
    push(&mut rig, Duration::from_millis(600));
    assert_eq!(peer.count(|event| event["program"].is_u64()), 1);
    assert!(peer.motion(stopped + 0.2).0 == 0.0 && !follows(&rig));
    rig.resume();
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, stopped + 0.5));
    assert_eq!(peer.count(|event| event["program"].is_u64()), 2);
    rig.stop().unwrap();
    assert_smooth(&peer);
}

#[test]
fn a_slower_slider_brings_the_robot_to_rest_and_its_program_goes_on() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let slowed = peer.tell("set slider 0.7");
    assert!(rig.wait_until(SOON, |rig| !follows(rig)));
    push(&mut rig, Duration::from_millis(300));
    let back = peer.tell("set slider 1.0");
    push(&mut rig, Duration::from_millis(300));
    let later = peer.velocities(back + 0.05);
    assert!(later.len() > 5 && later.iter().all(|(_, qd)| *qd == [0.0; 6]), "zeros keep the program alive: {later:?}");
    assert_eq!(peer.motion(slowed + 0.4).0, 0.0);
    rig.resume();
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, back));
    assert_eq!(peer.count(|event| event["program"].is_u64()), 1, "the same program");
    rig.stop().unwrap();
}

#[test]
fn a_program_that_is_paused_or_stopped_waits_for_the_operator() {
    for word in ["pause", "stop_program"] {
        let mut peer = Peer::start(json!({}));
        let mut rig = peer.rig("");
        move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
        let at = peer.tell(word);
        assert!(rig.wait_until(SOON, |rig| !follows(rig)), "{word}");
        push(&mut rig, Duration::from_millis(300));
        if word == "pause" {
            // The program reads on, and finds its connection closed.
            peer.tell("play_on");
            peer.wait(0, |event| event["ended"].is_string());
        }
        push(&mut rig, Duration::from_millis(300));
        assert!(peer.motion(at + 0.5).0 == 0.0 && !follows(&rig), "{word}");
        rig.resume();
        move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, at + 0.5));
        rig.stop().unwrap();
    }
}

#[test]
fn a_second_connection_gets_no_velocity() {
    let mut peer = Peer::start(json!({ "dials": 2 }));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    peer.tell("dial");
    assert!(rig.wait_until(SOON, |rig| rig.count("connections that were not expected") == 2));
    let later = peer.tell("mark");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, later));
    rig.stop().unwrap();
}

#[test]
fn a_node_of_external_control_gets_the_program_that_it_asks_for() {
    let port = free_tcp_port();
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig(&format!("start_by = 'urcap'\nrequest_port = {port}\nstart_s = 0.5"));
    assert!(rig.wait_until(SOON, |rig| rig.get::<Flag>("safety") == Some(&false)), "nobody has pressed play");
    peer.tell(&format!("urcap {port}"));
    let program = peer.wait(0, |event| event["program"].is_u64());
    assert_eq!(program["has_stop"], true);
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    rig.stop().unwrap();
}

/// A program in the shape of the maker's, in our own words.
const VENDOR: &str = "{{BEGIN_REPLACE}}\nSTOPJ_ACCELERATION = 4.0\nread_timeout = 0.0\n\
    connect_socket_with_retry(\"{{SERVER_IP_REPLACE}}\", {{TRAJECTORY_SERVER_PORT_REPLACE}}, \"trajectory_socket\")\n\
    connect_socket_with_retry(\"{{SERVER_IP_REPLACE}}\", {{SCRIPT_COMMAND_SERVER_PORT_REPLACE}}, \"script_command_socket\")\n\
    {% if ROBOT_SOFTWARE_VERSION >= v5.12.0 %}\n\
    connect_socket_with_retry(\"{{SERVER_IP_REPLACE}}\", {{SERVER_PORT_REPLACE}}, \"reverse_socket\")\n\
    {% endif %}\n";

#[test]
fn the_makers_program_gets_its_three_connections() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("external_control.urscript");
    std::fs::write(&path, VENDOR).unwrap();
    let peer = Peer::start(json!({}));
    let mut rig = peer.rig(&format!("script = {path:?}\ntrajectory_port = 0\ncommand_port = 0"));
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let program = peer.wait(0, |event| event["program"].is_u64());
    assert_eq!((&program["is_vendor"], &program["has_open"]), (&json!(true), &json!(false)), "{program}");
    rig.stop().unwrap();
}

#[test]
fn a_cable_that_swallows_bytes_leaves_the_robot_at_rest_until_the_operator_resumes() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("silence_s = 0.3");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let cut = peer.tell("swallow true");
    push(&mut rig, Duration::from_millis(600));
    let ended = peer.wait(0, |event| event["ended"].is_string());
    assert!(["silence", "the connection is closed"].contains(&ended["ended"].as_str().unwrap()), "{ended}");
    peer.tell("swallow false");
    push(&mut rig, Duration::from_millis(1000));
    // 200 ms, three steps of 8 ms, and the stop from 0.1 rad/s at 4 rad/s².
    assert!(peer.motion(cut).1 < cut + 0.2 + 0.024 + 0.025 + 0.1, "{} after {cut}", peer.motion(cut).1);
    assert!(!follows(&rig));
    rig.resume();
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, cut + 0.6));
    rig.stop().unwrap();
}

#[test]
fn a_driver_that_sends_nothing_proves_that_the_robot_stops_by_itself() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    rig.mute(true);
    let muted = peer.tell("mark");
    push(&mut rig, Duration::from_millis(400));
    assert_eq!(peer.wait(0, |event| event["ended"].is_string())["ended"], "silence");
    assert!(peer.motion(muted).1 < muted + 0.2 + 0.024 + 0.025 + 0.1, "{} after {muted}", peer.motion(muted).1);
    assert!(peer.velocities(muted + 0.05).is_empty());
    // It still receives.
    assert!(rig.next::<Joints>("position", SOON).is_some() && !follows(&rig));
    rig.mute(false);
    rig.resume();
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, muted + 0.4));
    rig.stop().unwrap();
}

#[test]
fn packets_that_are_none_are_counted_and_a_wrong_size_ends_the_connection() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    // An unknown command, a sample that is too short, one of another recipe, and a text that is cut.
    for (i, bytes) in ["00055a0102", "00065501ffff", "000455ff", "00044d09"].iter().enumerate() {
        peer.tell(&format!("bytes {bytes}"));
        move_until(&mut rig, |rig| rig.count("bad packets") > i as u64);
    }
    let later = peer.tell("mark");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, later));
    peer.tell("bytes 0001");
    let is_named = |why: &str| why.ends_with("a packet states a size of 1 bytes, but its header has 3");
    assert!(rig.wait_until(SOON, |rig| rig.lost("position").is_some_and(is_named)));
    rig.stop().unwrap();
}

#[test]
fn messages_that_are_late_move_nothing() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    // The robot gets no message, but its states still arrive.
    let held = peer.tell("hold true");
    push(&mut rig, Duration::from_millis(400));
    assert_eq!(peer.wait(0, |event| event["ended"].is_string())["ended"], "silence");
    peer.tell("hold false");
    push(&mut rig, Duration::from_millis(400));
    assert!(peer.motion(held).1 < held + 0.2 + 0.024 + 0.025 + 0.1, "{} after {held}", peer.motion(held).1);
    assert!(!follows(&rig));
    rig.resume();
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, held + 0.5));
    rig.stop().unwrap();
}
