//! When the device `ur` starts and starts again: which robot it accepts, what it checks, and when it gives up.

use std::time::{Duration, Instant};

use serde_json::json;
use tactflow_nodes::devices::ur::Ur;
use tactflow_runtime::harness::LinkRig;
use tactflow_runtime::signal::{Flag, Joints};

use crate::peer::{SOON, free_tcp_port};
use crate::ur::{Peer, follows, is_moving, move_until, push};

/// What the device counts.
const STRANGERS: &str = "connections that were not expected";

#[test]
fn a_connection_from_elsewhere_than_the_robot_is_closed() {
    let peer = Peer::start(json!({ "from": "127.0.0.2" }));
    let mut rig = peer.rig("start_s = 0.5");
    assert!(rig.wait_until(SOON, |rig| rig.count(STRANGERS) == 1));
    assert_eq!(peer.wait(0, |event| event["ended"].is_string())["ended"], "the connection is closed");
    assert!(rig.wait_until(SOON, |rig| rig.get::<Flag>("safety") == Some(&false)));
    assert_eq!(peer.velocities(0.0).len(), 0);
    rig.stop().unwrap();
    let peer = Peer::start(json!({ "from": "127.0.0.2" }));
    let mut rig = peer.rig("robot_host = '127.0.0.2'");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    assert_eq!(rig.count(STRANGERS), 0);
    rig.stop().unwrap();
    let mistakes = LinkRig::start::<Ur>(&peer.params("robot_host = 'arm'")).err().unwrap();
    assert!(format!("{mistakes:?}").contains("`arm` is not an IP address"), "{mistakes:?}");
}

#[test]
fn a_request_from_elsewhere_than_the_robot_gets_no_program() {
    let port = free_tcp_port();
    let mut peer = Peer::start(json!({ "from": "127.0.0.2" }));
    let mut rig = peer.rig(&format!("start_by = 'urcap'\nrequest_port = {port}\nstart_s = 0.5"));
    assert!(rig.wait_until(SOON, |rig| rig.get::<Flag>("safety") == Some(&false)), "nobody has pressed play");
    peer.tell(&format!("urcap {port}"));
    assert_eq!(peer.wait(0, |event| event["program"].is_u64())["program"], 0);
    assert!(rig.wait_until(SOON, |rig| rig.count(STRANGERS) == 1));
    rig.stop().unwrap();
}

#[test]
fn a_robot_that_was_ready_is_checked_again_when_the_operator_resumes() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    // Nobody renews the command, so the lease is lost and the robot comes to rest. Its program goes on.
    let rests = |_: &LinkRig| peer.events().iter().rev().find_map(|event| event["speed"].as_f64()) == Some(0.0);
    assert!(rig.wait_until(SOON, rests));
    let wrong = peer.tell("set tcp_error 0.01");
    // What was sent before that has arrived.
    for _ in 0..5 {
        rig.next::<Joints>("position", SOON).unwrap();
    }
    let end = Instant::now() + SOON;
    while rig.refusal().is_none() && Instant::now() < end {
        // A machine that is too busy to renew a command in time gives no reason.
        rig.resume();
        push(&mut rig, Duration::from_millis(50));
    }
    push(&mut rig, Duration::from_millis(200));
    assert!(!follows(&rig));
    let refusal = rig.refusal().unwrap();
    assert!(refusal.contains("they are 10.0 mm and 0.0° apart"), "{refusal}");
    assert!(peer.velocities(wrong).iter().all(|(_, qd)| *qd == [0.0; 6]));
    let right = peer.tell("set tcp_error 0.0");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, right));
    assert_eq!(peer.count(|event| event["program"].is_u64()), 1, "the same program");
    rig.stop().unwrap();
}

#[test]
fn a_robot_begins_at_its_start_and_goes_on_anywhere_after_a_stop() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("start = [0.0, -1.7, -2.0, -1.0124, 1.5, 0.0]\nstart_bounds = { posture = 0.08 }");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    let is_far = |rig: &LinkRig| rig.get::<Joints>("position").is_some_and(|joints| joints.0[0].abs() > 0.1);
    move_until(&mut rig, is_far);
    let rests = |_: &LinkRig| peer.events().iter().rev().find_map(|event| event["speed"].as_f64()) == Some(0.0);
    assert!(rig.wait_until(SOON, rests));
    let later = peer.tell("set slider 1.0");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, later));
    rig.stop().unwrap();
}

#[test]
fn a_robot_that_sends_packets_without_a_sample_is_lost() {
    let mut peer = Peer::start(json!({}));
    let mut rig = peer.rig("silence_s = 0.3");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, 0.0));
    peer.tell("garble true");
    let is_named = |why: &str| why.ends_with("no sample for 300ms");
    assert!(rig.wait_until(SOON, |rig| rig.lost("position").is_some_and(is_named)));
    assert!(rig.count("bad packets") > 5);
    let back = peer.tell("garble false");
    move_until(&mut rig, |rig| follows(rig) && is_moving(&peer, back));
    rig.stop().unwrap();
}

#[test]
fn the_time_until_a_robot_answers_is_not_that_of_its_program() {
    let peer = Peer::start(json!({ "late": 2.0 }));
    let mut rig = peer.rig("start_s = 1.5\nconnect_s = 20");
    assert!(rig.wait_until(SOON, follows), "it starts without a resume");
    rig.stop().unwrap();
}
