//! The shipped tasks on a physics engine that nobody here wrote: MuJoCo moves the arm, with the inertia of its links and
//! drives and with friction in its joints. `.ci/edge` installs it and runs this.

use std::fmt::Write as _;
use std::io::Write as _;

use serde_json::Value;

use crate::lockstep::{Peer, command};
use crate::tool::said;

/// Objects: a soft ball, a rigid pen and a stiff box.
const OBJECTS: [(&str, &str); 3] = [
    ("ball", "--scene ball --radius 0.04 --stiffness 120"),
    ("pen", "--scene pen --radius 0.005 --size 0.05 0.05"),
    ("box", "--scene box --stiffness 1000"),
];
/// Places and angles of an object [m, m, rad].
const PLACES: [[f64; 3]; 4] = [[0.01, -0.006, 0.4], [-0.008, 0.009, -0.5], [0.004, 0.008, 0.7], [-0.01, -0.01, -0.1]];

/// What a task holds on each object: the slowest response of each controlled feature [s], counted from the first touch,
/// and the largest error of each at last [units and tactels].
struct Promise {
    task: &'static str,
    response_s: [(&'static str, f64); 3],
    error: [f64; 3],
}

const ANY: f64 = f64::INFINITY;
const PROMISES: [Promise; 4] = [
    Promise { task: "force", response_s: [("pressure", 1.2), ("x", ANY), ("y", ANY)], error: [0.012, ANY, ANY] },
    Promise { task: "position", response_s: [("pressure", ANY), ("x", 2.2), ("y", 2.2)], error: [ANY, 0.05, 0.08] },
    Promise { task: "hybrid", response_s: [("pressure", 1.6), ("x", 1.5), ("y", 1.2)], error: [0.016, 0.05, 0.06] },
    Promise { task: "rolling", response_s: [("pressure", 2.0), ("x", 2.0), ("y", 2.2)], error: [0.016, 0.03, 0.03] },
];

/// What is wrong with a run, for each thing that is; empty if all holds.
fn broken(seen: &Value, promise: &Promise) -> Vec<String> {
    let number = |value: &Value| value.as_f64().unwrap_or(ANY);
    let mut wrong = Vec::new();
    // A frame lasts 4 ms. Rolling meets a corner of the box first, and may leave it for a moment.
    if number(&seen["lost"]) > if promise.task == "rolling" { 25.0 } else { 0.0 } {
        wrong.push(format!("it left the object for {} frames", seen["lost"]));
    }
    for ((name, most), (error, largest)) in promise.response_s.iter().zip((0..3).zip(promise.error)) {
        let response = seen["response"][name].as_f64().unwrap_or(f64::MAX);
        if response > *most {
            wrong.push(format!("{name} took {response} s"));
        }
        let error = number(&seen["error"][error]).abs();
        if error > largest {
            wrong.push(format!("{name} is {error} off"));
        }
    }
    // The noise of the pad alone is 0.04.
    if promise.error[0] < ANY && number(&seen["deviation"][0]) > 0.046 {
        wrong.push(format!("the pressure deviates by {}", seen["deviation"][0]));
    }
    wrong
}

#[test]
#[ignore = "it needs MuJoCo: `.ci/edge` installs it"]
fn the_tasks_of_the_paper_hold_on_a_physics_engine() {
    let mut wrong = String::new();
    for promise in &PROMISES {
        for (object, scene) in OBJECTS {
            for (seed, [x, y, angle]) in PLACES.into_iter().enumerate() {
                let place = format!("--offset {x} {y} --angle {angle} --seed {seed}");
                let peer = Peer::of("../oracles/engine.py", &format!("{scene} {place} --seconds 10"));
                let said = said(&mut command(promise.task, &peer.port, &["--quiet"]));
                let seen = peer.seen();
                let wrongs = broken(&seen, promise);
                let line = format!("{} on {object}, {place}: {seen}\n", promise.task);
                std::io::stdout().write_all(line.as_bytes()).unwrap();
                if said.code != 0 || !wrongs.is_empty() {
                    writeln!(wrong, "{} on {object}, {place}: {wrongs:?} {}", promise.task, said.err).unwrap();
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}
