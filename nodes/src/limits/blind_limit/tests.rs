//! `blind_limit` against what must not refill it, and against the ways in which a pad can move.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{FlagShape, ImageShape, PoseShape, Scalar, Shape, TwistShape, Unit};

use super::*;

/// Period of the rig [ms].
const MS: f64 = 4.0;
const PARAMS: &str = "blind_s = 5.0\nblind_mm = 50.0\ndeceleration_m_per_s2 = 1.0\ndeceleration_rad_per_s2 = 10.0";

/// A pad of 40 mm by 40 mm.
fn rig(more: &str) -> NodeRig {
    try_rig(more).unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

fn try_rig(more: &str) -> Result<NodeRig, Mistakes> {
    let pad = ImageShape { rows: 8, cols: 8, pitch: [0.005; 2], unit: Unit::NEWTON };
    let wires: [(&str, Shape); 4] = [
        ("twist", TwistShape.into()),
        ("contact", FlagShape.into()),
        ("image", pad.into()),
        ("pose", PoseShape::default().into()),
    ];
    NodeRig::new::<BlindLimit>(&format!("{PARAMS}\n{more}"), &wires)
}

/// What happened in some steps.
#[derive(Debug, Default)]
struct Course {
    /// Time in which the output was not zero [s].
    time: f64,
    /// Way of the fastest corner [m].
    way: f64,
}

/// Steps for `seconds` with a wanted twist. `contact` returns the flag at a time [ms]; with `None` it is absent.
fn run(rig: &mut NodeRig, seconds: f64, wanted: [f64; 6], contact: impl Fn(f64) -> Option<bool>) -> Course {
    let corners = corners(&ImageShape { rows: 8, cols: 8, pitch: [0.005; 2], unit: Unit::NEWTON });
    let mut course = Course::default();
    for step in 0..(seconds * 1e3 / MS) as usize {
        match contact(step as f64 * MS) {
            Some(contact) => rig.set("contact", contact),
            None => rig.lose("contact"),
        }
        rig.set("twist", Twist(wanted.into()));
        rig.set("image", Image::zeros(8, 8));
        rig.set("pose", Pose(IsometryMatrix3::translation(0.0, 0.0, 0.0)));
        rig.step_ms(MS);
        let twist = rig.get::<Twist>("twist").copied().unwrap_or_default();
        let speeds = corners.map(|corner| (twist.linear() + twist.angular().cross(&corner)).norm());
        let speed = speeds.into_iter().fold(0.0, f64::max);
        course.way += speed * MS * 1e-3;
        course.time += if speed > 1e-6 { MS * 1e-3 } else { 0.0 };
    }
    course
}

fn is_spent(rig: &NodeRig) -> bool {
    *rig.get::<Flag>("spent").unwrap()
}

#[test]
fn the_way_and_the_time_are_bounded_in_every_direction() {
    let motions = [
        [0.0, 0.0, 0.02, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.05, 0.0, 0.0, 0.0],
        [0.0, 0.0, -0.05, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.8],
        [0.0, 0.0, 0.0, 0.8, 0.0, 0.0],
        [0.03, 0.0, 0.0, 0.0, 0.4, 0.0],
        [0.0, 0.0, 0.001, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.001],
    ];
    for wanted in motions {
        let mut rig = rig("");
        let course = run(&mut rig, 20.0, wanted, |_| Some(false));
        assert!(course.way <= 0.05 + 1e-9 && course.time <= 5.0 + 1e-9, "{wanted:?}: {course:?}");
        assert!(course.way > 0.045 || course.time > 4.5, "{wanted:?} stops too early: {course:?}");
        assert!(is_spent(&rig) && rig.get::<Scalar>("left") == Some(&0.0), "{wanted:?}");
    }
}

#[test]
fn until_it_brakes_the_twist_passes_with_its_bits() {
    let mut rig = rig("");
    let wanted = Twist([0.0123, -0.0071, 0.0, 0.013, -0.0, 0.1].into());
    run(&mut rig, 0.4, wanted.0.into(), |_| Some(false));
    let bits = |twist: &Twist| twist.0.map(f64::to_bits);
    assert_eq!(bits(rig.get::<Twist>("twist").unwrap()), bits(&wanted));
    assert_eq!(rig.get::<Scalar>("blind"), Some(&1.0));
}

#[test]
fn flicker_does_not_refill_and_a_contact_that_lasts_does() {
    let push = [0.0, 0.0, 0.02, 0.0, 0.0, 0.0];
    let flicker = |ms: f64| Some(((ms / 20.0) as u64).is_multiple_of(2));
    let mut rig = rig("");
    let course = run(&mut rig, 20.0, push, flicker);
    assert!(course.way <= 0.05 + 1e-9 && is_spent(&rig), "{course:?}");
    // 40 ms is the time between its first and its last sample.
    run(&mut rig, 0.04, push, |_| Some(true));
    assert!(is_spent(&rig));
    run(&mut rig, 0.02, push, |_| Some(true));
    assert!(!is_spent(&rig));
    // In contact nothing is spent; without one the full way is there again.
    let touching = run(&mut rig, 10.0, push, |_| Some(true));
    assert!((touching.way - 0.2).abs() < 1e-3, "{touching:?}");
    let again = run(&mut rig, 20.0, push, |_| None);
    assert!(again.way > 0.045 && again.way <= 0.05 + 0.02 * MS * 1e-3, "{again:?}");
}

#[test]
fn rest_costs_nothing() {
    let mut rig = rig("");
    run(&mut rig, 600.0, [0.0; 6], |_| Some(false));
    let course = run(&mut rig, 2.0, [0.0, 0.0, -0.02, 0.0, 0.0, 0.0], |_| Some(false));
    assert!((course.way - 0.04).abs() < 1e-6, "a retreat after ten minutes: {course:?}");
}

#[test]
fn an_old_image_or_an_old_contact_is_none() {
    for stale in ["image", "contact"] {
        let mut rig = rig("max_age_ms = 20");
        run(&mut rig, 0.2, [0.0; 6], |_| Some(true));
        for _ in 0..3000 {
            rig.set("twist", Twist([0.0, 0.0, 0.02, 0.0, 0.0, 0.0].into()));
            if stale != "image" {
                rig.set("image", Image::zeros(8, 8));
            }
            if stale != "contact" {
                rig.set("contact", true);
            }
            rig.step_ms(MS);
        }
        assert!(is_spent(&rig), "{stale}");
    }
}

#[test]
fn the_operator_refills_it() {
    let mut rig = rig("");
    run(&mut rig, 20.0, [0.0, 0.0, 0.05, 0.0, 0.0, 0.0], |_| Some(false));
    assert!(is_spent(&rig));
    rig.tick.is_resumed = true;
    run(&mut rig, 0.004, [0.0; 6], |_| Some(false));
    rig.tick.is_resumed = false;
    assert!(!is_spent(&rig));
}

#[test]
fn nothing_counts_in_the_clear_box_and_the_motion_can_stop_behind_its_face() {
    let push = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0];
    let mut far = rig("clear_min_m = [-1, -1, -1]\nclear_max_m = [1, 1, 1]");
    assert!(run(&mut far, 20.0, push, |_| Some(false)).way > 0.9);
    // The same pad 1 mm before a face has the rest of the way as room, and the whole budget behind the face.
    let mut near = rig("clear_min_m = [-1, -1, -1]\nclear_max_m = [1, 1, 0.001]");
    assert!(run(&mut near, 20.0, push, |_| Some(false)).way > 0.9);
    let mut outside = rig("clear_min_m = [-1, -1, -1]\nclear_max_m = [1, 1, -0.001]");
    assert!(run(&mut outside, 20.0, push, |_| Some(false)).way <= 0.05 + 1e-9);
    // A corner of the pad sticks out.
    let mut corner = rig("clear_min_m = [-0.019, -1, -1]\nclear_max_m = [1, 1, 1]");
    assert!(run(&mut corner, 20.0, push, |_| Some(false)).way <= 0.05 + 1e-9);
}

/// Two pads of 40 mm by 40 mm, the second one 1 m away along x.
fn two_pads(wires: &[&str]) -> Result<NodeRig, Mistakes> {
    let pad = ImageShape { rows: 8, cols: 8, pitch: [0.005; 2], unit: Unit::NEWTON };
    let shape = |name: &str| -> Shape {
        match name.rsplit('_').next() {
            Some("contact") => FlagShape.into(),
            Some("image") => pad.clone().into(),
            Some("pose") => PoseShape::default().into(),
            _ => TwistShape.into(),
        }
    };
    let all = ["twist", "contact", "image", "pose"].iter().chain(wires);
    let wires: Vec<(&str, Shape)> = all.map(|name| (*name, shape(name))).collect();
    NodeRig::new::<BlindLimit>(PARAMS, &wires)
}

const SECOND: [&str; 3] = ["second_contact", "second_image", "second_pose"];

/// Steps an arm with two pads. `contacts` returns the contact of each at a time [ms]. Returns the way of the fastest
/// corner of both pads [m].
fn run_two(rig: &mut NodeRig, seconds: f64, wanted: Twist, contacts: impl Fn(f64) -> [bool; 2]) -> f64 {
    let mut way = 0.0;
    for step in 0..(seconds * 1e3 / MS) as usize {
        let [first, second] = contacts(step as f64 * MS);
        rig.set("twist", wanted);
        for (name, contact) in [("contact", first), ("second_contact", second)] {
            rig.set(name, contact);
        }
        for name in ["image", "second_image"] {
            rig.set(name, Image::zeros(8, 8));
        }
        // The first pad is turned in the base, which must not matter.
        let first = IsometryMatrix3::new(Vector3::new(0.3, 0.1, 0.2), Vector3::new(0.4, -0.2, 1.0));
        rig.set("pose", Pose(first));
        rig.set("second_pose", Pose(first * IsometryMatrix3::translation(1.0, 0.0, 0.0)));
        rig.step_ms(MS);
        let twist = rig.get::<Twist>("twist").copied().unwrap_or_default();
        // Of the second pad the two outer corners are the farthest ones: 1.02 m along x and 0.02 m along y.
        let outer = [Vector3::new(1.02, 0.02, 0.0), Vector3::new(1.02, -0.02, 0.0)];
        let speed = outer.map(|corner| (twist.linear() + twist.angular().cross(&corner)).norm());
        way += speed[0].max(speed[1]) * MS * 1e-3;
    }
    way
}

#[test]
fn the_way_is_that_of_the_fastest_corner_of_both_pads() {
    let turn = Twist([0.0, 0.0, 0.0, 0.0, 0.0, 0.05].into());
    let mut rig = two_pads(&SECOND).unwrap();
    let way = run_two(&mut rig, 20.0, turn, |_| [false, false]);
    assert!(way <= 0.05 + 1e-9 && way > 0.045 && is_spent(&rig), "{way}");
}

#[test]
fn a_contact_of_either_pad_that_lasts_refills_and_turns_of_both_do_not() {
    let push = Twist([0.0, 0.0, 0.02, 0.0, 0.0, 0.0].into());
    for contacts in [[true, false], [false, true]] {
        let mut rig = two_pads(&SECOND).unwrap();
        let way = run_two(&mut rig, 10.0, push, |_| contacts);
        assert!((way - 0.2).abs() < 1e-3 && !is_spent(&rig), "{contacts:?}: {way}");
    }
    // Each of them touches for 20 ms in turn: something is always touched, and no contact lasts.
    let mut rig = two_pads(&SECOND).unwrap();
    let in_turn = |ms: f64| {
        let is_first = ((ms / 20.0) as u64).is_multiple_of(2);
        [is_first, !is_first]
    };
    run_two(&mut rig, 20.0, push, in_turn);
    assert!(is_spent(&rig));
}

#[test]
fn a_second_pad_needs_all_its_wires() {
    for one in SECOND {
        for wires in [vec![one], SECOND.iter().copied().filter(|name| *name != one).collect()] {
            assert_eq!(places("", &two_pads(&wires)), ["missing-input: `the node`"], "{wires:?}");
        }
    }
}

#[test]
fn what_cannot_be() {
    let cases = [
        ("clear_min_m = [0, 0, 0]", "bad-value: `clear_min_m`"),
        ("clear_max_m = [0, 0, 0]", "bad-value: `clear_max_m`"),
        ("clear_min_m = [0, 0, 0]\nclear_max_m = [1, 0, 1]", "bad-value: `clear_max_m`"),
    ];
    for (params, place) in cases {
        assert_eq!(places(params, &try_rig(params)), [place], "{params}");
    }
    for params in ["blind_s = 61", "blind_mm = 501", "blind_s = 0"] {
        let name = params.split(' ').next().unwrap();
        let all = PARAMS.lines().filter(|line| !line.starts_with(name)).collect::<Vec<_>>().join("\n");
        let wires: [(&str, Shape); 1] = [("twist", TwistShape.into())];
        assert!(NodeRig::new::<BlindLimit>(&format!("{all}\n{params}"), &wires).is_err(), "{params}");
    }
}
