//! What `ros2 publish` shows of a run to CycloneDDS in another process, `tests/peers/ros2/listener.py`.

use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

use super::signal;
use crate::control_law::rows;
use crate::peer::Process;
use crate::record::has_python_module;
use crate::socket::session::{Session, finish};

/// A program that reads topics, in a domain of its own; `None` without CycloneDDS.
fn listener(domain: u32, topics: &Value) -> Option<Process> {
    if !has_python_module("cyclonedds") {
        return None;
    }
    let process =
        Process::start("ros2/listener.py", [json!({"domain": domain, "topics": topics}).to_string().as_str()]);
    process.wait(0, |event| event["is_ready"] == true);
    Some(process)
}

/// Starts `ros2 publish` for the runs of a session.
fn publish(session: &Session, domain: u32, args: &[&str]) -> Child {
    let domain = domain.to_string();
    let mut command = session.tool(&[&["ros2", "publish", "--domain", &domain], args].concat());
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// The messages of a topic, each with the time of its arrival [s, wall clock].
fn messages(listener: &Process, topic: &str) -> Vec<(f64, Value)> {
    let lines = listener.said(0).into_iter().filter(|line| line["topic"] == topic);
    lines.map(|line| (line["received"].as_f64().unwrap(), line["message"].clone())).collect()
}

/// The stamp of a header [s].
fn stamp(header: &Value) -> f64 {
    header["stamp"]["sec"].as_f64().unwrap() + header["stamp"]["nanosec"].as_f64().unwrap() * 1e-9
}

/// The states on /diagnostics, in their order and each once: the level and the message.
fn states(listener: &Process) -> Vec<(u64, String)> {
    let all = messages(listener, "/diagnostics").into_iter().flat_map(|(_, message)| {
        let status = message["status"].as_array().unwrap().clone();
        status
            .into_iter()
            .map(|status| (status["level"].as_u64().unwrap(), status["message"].as_str().unwrap().to_owned()))
    });
    let mut all: Vec<_> = all.collect();
    all.dedup();
    all
}

/// A pose and its transform are one, and the base has the name of ROS.
fn assert_transforms_are_poses(poses: &[(f64, Value)], transforms: &[(f64, Value)]) {
    let (_, pose) = poses.last().unwrap();
    assert_eq!(pose["header"]["frame_id"], "link0");
    let mut transforms = transforms.iter().map(|(_, tf)| &tf["transforms"][0]);
    let same = transforms.find(|tf| tf["header"]["stamp"] == pose["header"]["stamp"]).unwrap();
    assert_eq!((&same["child_frame_id"], &same["header"]["frame_id"]), (&json!("pad"), &json!("link0")));
    assert_eq!(same["transform"]["translation"], pose["pose"]["position"]);
    assert_eq!(same["transform"]["rotation"], pose["pose"]["orientation"]);
}

#[test]
fn others_see_images_numbers_poses_and_transforms_as_the_run_computes_them() {
    let topics = json!({
        "/cell/touch/image": ["Image", "reliable"],
        "/cell/touch/x": ["JointState", "best_effort"],
        "/cell/error/error": ["JointState", "reliable"],
        "/cell/arm/position": ["JointState", "reliable"],
        "/cell/move/joints/velocity": ["JointState", "reliable"],
        "/cell/projector/twist": ["TwistStamped", "reliable"],
        "/cell/move/sensor_pose": ["PoseStamped", "reliable"],
        "/tf": ["TFMessage", "reliable"],
        "/diagnostics": ["DiagnosticArray", "reliable"],
    });
    let Some(listener) = listener(81, &topics) else { return };
    let mut session = Session::new();
    let table = session.folder.path().join("run.csv");
    session.run(&["graphs/hybrid.toml", "--for", "6s", "--out", table.to_str().unwrap()]);
    let ports = [
        "touch.image",
        "touch.x",
        "error.error",
        "arm.position",
        "projector.twist",
        "move.sensor_pose",
        "move.joints.velocity",
    ];
    let publisher = publish(&session, 81, &[&ports[..], &["--prefix", "/cell", "--frame", "arm.base=link0"]].concat());
    let ran = finish(session.runs.remove(0));
    assert_eq!(ran.code, 0, "{}", ran.err);
    let ended = finish(publisher);
    assert!(ended.code == 0 && ended.err.contains("the run has ended: the time limit"), "{}", ended.err);
    let lists = |line: &str| line.split_whitespace().eq(["/cell/touch/image", "sensor_msgs/msg/Image"]);
    assert!(ended.err.lines().any(lists), "{}", ended.err);
    sleep(Duration::from_millis(300));
    let of = |topic: &str| {
        let found = messages(&listener, topic);
        assert!(found.len() > 50, "{topic}: {} messages", found.len());
        found
    };
    let rows = rows(table.to_str().unwrap());
    // Numbers are those of the table to the last bit, under their names.
    let is_in_table = |name: &str, value: f64| rows.iter().any(|row| row.get(name) == Some(&value));
    let (_, last) = of("/cell/error/error").pop().unwrap();
    for (name, value) in last["name"].as_array().unwrap().iter().zip(last["position"].as_array().unwrap()) {
        let column = format!("error.error.{}", name.as_str().unwrap());
        assert!(is_in_table(&column, value.as_f64().unwrap()), "{column} {value}");
    }
    let (_, x) = of("/cell/touch/x").pop().unwrap();
    assert_eq!((&x["name"], &x["header"]["frame_id"]), (&json!(["x"]), &json!("pad")));
    assert!(is_in_table("touch.moments.x", x["position"][0].as_f64().unwrap()), "{x}");
    let (_, joints) = of("/cell/arm/position").pop().unwrap();
    assert_eq!((joints["position"].as_array().unwrap().len(), &joints["velocity"]), (7, &json!([])));
    let (_, velocity) = of("/cell/move/joints/velocity").pop().unwrap();
    assert_eq!((velocity["velocity"].as_array().unwrap().len(), &velocity["position"]), (7, &json!([])));
    of("/cell/projector/twist").iter().for_each(|(_, twist)| assert_eq!(twist["header"]["frame_id"], "pad"));
    // The sum of an image is the force on the pad, and its stamp is that of the numbers.
    let images = of("/cell/touch/image");
    let (_, image) = images.last().unwrap();
    assert_eq!((&image["encoding"], &image["height"], &image["step"]), (&json!("32FC1"), &json!(16), &json!(64)));
    let sum: f64 = image["data"].as_array().unwrap().iter().map(|cell| cell.as_f64().unwrap()).sum();
    assert!(sum > 1.0, "{sum} N");
    let x_stamps: Vec<f64> = of("/cell/touch/x").iter().map(|(_, x)| stamp(&x["header"])).collect();
    let with = images.iter().filter(|(_, image)| x_stamps.contains(&stamp(&image["header"]))).count();
    assert!(with > images.len() / 2, "{with} of {}", images.len());
    let mut ages: Vec<f64> = images.iter().map(|(at, image)| at - stamp(&image["header"])).collect();
    ages.sort_by(f64::total_cmp);
    assert!(ages[0] > 0.0 && ages[ages.len() / 2] < 0.1, "{ages:?}");
    assert_transforms_are_poses(&of("/cell/move/sensor_pose"), &of("/tf"));
    let states = states(&listener);
    assert!(states.contains(&(0, "mode servo".into())), "{states:?}");
    assert_eq!(states.last().unwrap(), &(0, "it has ended: the time limit is reached".into()));
}

#[test]
fn diagnostics_say_what_holds_a_run_and_how_it_ends_and_the_next_run_follows() {
    let topics = json!({"/diagnostics": ["DiagnosticArray", "reliable"]});
    let Some(listener) = listener(82, &topics) else { return };
    let mut session = Session::new();
    let mut publisher = publish(&session, 82, &["--wait"]);
    // It waits for the run.
    sleep(Duration::from_secs(1));
    session.run(&["graphs/hybrid.toml", "--listen"]);
    let is = |level: u64, message: &str| {
        let message = message.to_owned();
        listener.wait(0, |line| {
            let status = &line["message"]["status"][0];
            status["level"] == level && status["message"].as_str().is_some_and(|said| said.starts_with(&message))
        })
    };
    let status = is(0, "mode servo")["message"]["status"][0].clone();
    assert_eq!(status["name"], "tactflow: hybrid");
    session.print(&["send", "stop"]);
    is(1, "the operator sent `stop`");
    session.runs[0].kill().unwrap();
    session.runs.remove(0).wait().unwrap();
    is(2, "it is gone, and has not said why");
    is(3, "no graph runs");
    let from = listener.count();
    session.run(&["graphs/force.toml"]);
    listener.wait(from, |line| line["message"]["status"][0]["name"] == "tactflow: force");
    publisher.kill().unwrap();
    let said = finish(publisher);
    assert_eq!(said.err.matches("waiting for a run").count(), 2, "{}", said.err);
}

#[test]
fn a_reader_that_hangs_delays_neither_the_run_nor_the_publisher() {
    let topics = json!({"/tactflow/pad/image": ["Image", "reliable"], "/diagnostics": ["DiagnosticArray", "reliable"]});
    let (Some(hangs), Some(reads)) = (listener(83, &topics), listener(83, &topics)) else { return };
    let mut session = Session::new();
    session.run(&["graphs/hybrid.toml", "--for", "6s"]);
    let publisher = publish(&session, 83, &["pad.image"]);
    hangs.wait(0, |line| line["topic"] == "/tactflow/pad/image");
    signal(hangs.id(), "STOP");
    let ran = finish(session.runs.remove(0));
    signal(hangs.id(), "CONT");
    assert!(ran.code == 0 && !ran.err.contains("late"), "{}", ran.err);
    assert_eq!(finish(publisher).code, 0);
    let arrived: Vec<f64> = messages(&reads, "/tactflow/pad/image").iter().map(|(at, _)| *at).collect();
    let longest = arrived.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!(arrived.len() > 100 && longest < 1.0, "{} images, a gap of {longest} s", arrived.len());
}

#[test]
fn what_cannot_be_published_is_named() {
    let mut session = Session::new();
    let none = session.say(&["ros2", "publish", "pad.image"]);
    assert!(none.code == 2 && none.err.contains("no graph runs in real time\nhelp: start one"), "{}", none.err);
    session.run(&["graphs/hybrid.toml"]);
    for (args, expected) in [
        (&["pad.imag"][..], "did you mean `pad.image`?"),
        (&["pad.image", "--prefix", "tactflow"], "`tactflow` is no beginning of topics"),
        (&["pad.image", "--frame", "base"], "write the frame of the graph and its name in ROS"),
        (&["pad.image", "--frame", "base=link0"], "no published port has the frame `base`; they have `pad`"),
        (&["pad.image", "--rate", "0"], "write a number from 0.1 to 1000"),
        (&["pad.image", "--domain", "200"], "200 is not in 0..=101"),
        (&["pad.image", "--network", "wlan0"], "invalid IP address"),
        (&["pad.image", "--network", "203.0.113.7"], "this machine has no address 203.0.113.7"),
    ] {
        let said = crate::tool::said(session.tool(&[&["ros2", "publish"], args].concat()).env("ROS_DOMAIN_ID", "84"));
        assert!(said.code == 2 && said.err.contains(expected), "{args:?}: {} {}", said.code, said.err);
    }
}
