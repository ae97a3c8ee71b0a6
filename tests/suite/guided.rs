//! A guide in closed loop: a script slides the pad over a table, the task holds the pressure, and the guide's silence is no
//! failure.

use nalgebra::{IsometryMatrix3, Vector2, Vector3};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::Request;
use tactflow_runtime::signal::{Pose, Scalar, Twist};
use tactflow_tests::workspace;

use crate::course::{get, loaded};
use crate::tool::say;

fn request(set: &[&str]) -> Request {
    let set = set.iter().map(|set| (*set).to_owned()).collect();
    Request { set, ..Request::file(workspace().join("graphs/guided.toml")) }
}

/// What is seen after a tick.
struct Seen {
    time: f64,
    /// Place of the pad, seen from where the guidance began [m].
    place: Vector3<f64>,
    /// Angle from its orientation there [rad].
    turned: f64,
    /// The guidance, and the commanded motion [m/s].
    guidance: Option<Vector3<f64>>,
    commanded: Vector3<f64>,
    /// [N per tactel]
    pressure: f64,
}

fn run(engine: &mut Engine) -> Vec<Seen> {
    let (mut start, mut all) = (None::<IsometryMatrix3<f64>>, Vec::new());
    // The pad has samples for 20 s.
    while let Some(next) = engine.next().filter(|next| *next < 19_900_000_000) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        if engine.mode() != Some("guided") {
            continue;
        }
        let pose = get::<Pose>(engine, "move.state.sensor_pose").unwrap().0;
        let seen = start.get_or_insert(pose).inverse() * pose;
        let linear = |port: &str| get::<Twist>(engine, port).map(Twist::linear);
        all.push(Seen {
            time: next as f64 * 1e-9,
            place: seen.translation.vector,
            turned: seen.rotation.angle(),
            guidance: linear("guidance.twist"),
            commanded: linear("move.acceleration.twist").unwrap_or_default(),
            pressure: *get::<Scalar>(engine, "calm.value").unwrap(),
        });
    }
    all
}

#[test]
fn the_pad_goes_where_it_is_guided_and_the_pressure_is_held() {
    let mut engine = Engine::new(loaded(&request(&[])));
    let seen = run(&mut engine);
    assert!(engine.halts().is_empty(), "{:?}", engine.halts());
    let at = |time: f64| seen.iter().find(|seen| seen.time >= time).unwrap();
    assert!(seen[0].time < 4.5, "guided from {} s on", seen[0].time);
    // 8 mm/s for 2 s along x, then along -y; then 70 mm/s for 1 s, of which 10 mm/s are allowed. The velocity counts for 150 ms
    // after the guide is silent. The limits of the force slow it down at times.
    let commanded = |from: f64, to: f64| {
        let within = seen.windows(2).filter(|pair| (from..to).contains(&pair[0].time));
        within.map(|pair| pair[0].commanded.xy() * (pair[1].time - pair[0].time)).sum::<Vector2<f64>>() * 1e3
    };
    let (along, fast) = (8.0 * 2.13, 10.0 * 1.13 / f64::sqrt(2.0));
    for (from, to, expected) in [
        (4.6, 8.5, Vector2::new(along, 0.0)),
        (8.5, 12.5, Vector2::new(0.0, -along)),
        (12.5, 16.0, Vector2::new(-fast, fast)),
    ] {
        let found = commanded(from, to);
        assert!((found - expected).norm() < 0.6, "from {from} s to {to} s: {found:?} mm, and not {expected:?} mm");
    }
    // The arm is compliant, and the friction of the pad holds it back.
    let moved = (at(8.5).place - at(4.6).place) * 1e3;
    assert!((moved.x - along).abs() < 2.0 && moved.y.abs() < 1.0, "{moved:?} mm");
    for seen in seen.iter().filter(|seen| seen.time > 4.0) {
        assert!((seen.pressure - 0.03).abs() < 0.0075, "{} N per tactel at {} s", seen.pressure, seen.time);
        assert!(seen.turned < 0.02, "turned by {} rad at {} s", seen.turned, seen.time);
        let speed = seen.guidance.map_or(0.0, |velocity| velocity.norm());
        assert!(speed < 0.01 * (1.0 + 1e-12), "{speed} m/s at {} s", seen.time);
    }
}

#[test]
fn a_guide_that_is_silent_ends_its_motion_smoothly() {
    let mut engine = Engine::new(loaded(&request(&[])));
    let seen = run(&mut engine);
    // The guide is silent from 7 s on: its last sample is of 6.98 s, and counts for 150 ms.
    let last = seen.iter().rfind(|seen| seen.time < 8.0 && seen.guidance.is_some()).unwrap().time;
    assert!((7.12..7.14).contains(&last), "{last} s");
    // The motion never jumps: 2 m/s² in ticks of 4 ms, a half of which `bumpless` leaves to it.
    for pair in seen.windows(2) {
        let jump = (pair[1].commanded - pair[0].commanded).norm();
        assert!(jump < 2.0 * 0.004 * 1.01, "{jump} m/s at {} s", pair[1].time);
    }
    let rest = seen.iter().filter(|seen| (7.3..8.9).contains(&seen.time));
    let fastest = rest.map(|seen| seen.commanded.xy().norm()).fold(0.0, f64::max);
    assert!(fastest < 1e-3, "{fastest} m/s while nobody guides");
}

#[test]
fn where_the_policy_does_not_count_a_silent_guide_holds_the_arm() {
    let mut engine = Engine::new(loaded(&request(&["policy.roles.guide.stale=\"hold\""])));
    while let Some(next) = engine.next().filter(|next| *next < 9_000_000_000) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
    }
    assert!(engine.halts().iter().any(|halt| halt.fault.node == "guide"), "{:?}", engine.halts());
}

#[test]
fn no_wire_leads_from_a_guide_to_an_arm_but_through_the_node_that_bounds_it() {
    for set in ["nodes.sum.in.own=\"guide.velocity\"", "parts.move.in.twist=\"guide.velocity\""] {
        let checked = say(&["check", "graphs/guided.toml", "--set", set]);
        assert!(checked.code == 2 && checked.err.contains("guide.velocity"), "{set}: {}{}", checked.out, checked.err);
    }
}
