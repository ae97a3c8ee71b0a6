//! The node on a sensor that follows every command exactly, against the closed form of its decay.

use nalgebra::{Rotation3, Translation3, Unit};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{FlagShape, Freshness, PoseShape, Shape};

use super::*;

const BOTH: &str = "gain_per_s = 2.0\nspeed_m_per_s = 0.05\nspeed_rad_per_s = 0.5";
const TARGET: &str = "target = { xyz = [0.4, 0.1, 0.3], rpy = [0.2, -0.1, 0.4] }";
const MS: f64 = 4.0;

fn target() -> IsometryMatrix3<f64> {
    let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let rotation = turn(Vector3::z_axis(), 0.4) * turn(Vector3::y_axis(), -0.1) * turn(Vector3::x_axis(), 0.2);
    IsometryMatrix3::from_parts(Translation3::new(0.4, 0.1, 0.3), rotation)
}

fn rig(params: &str, is_gated: bool) -> NodeRig {
    let pose: (&str, Shape) = ("pose", PoseShape::default().into());
    let gate: (&str, Shape) = ("gate", FlagShape.into());
    let wires = if is_gated { vec![pose, gate] } else { vec![pose] };
    NodeRig::new::<HoldPose>(params, &wires).unwrap_or_else(|mistakes| panic!("{mistakes:?}"))
}

/// Shows a pose and returns the twist.
fn show(rig: &mut NodeRig, pose: &IsometryMatrix3<f64>) -> Option<Twist> {
    rig.set("pose", Pose(*pose));
    rig.step_ms(MS);
    rig.get::<Twist>("twist").copied()
}

/// Moves a sensor by its own twist for one sample.
fn moved(pose: &IsometryMatrix3<f64>, twist: &Twist) -> IsometryMatrix3<f64> {
    let dt = MS * 1e-3;
    pose * IsometryMatrix3::from_parts(Translation3::from(twist.linear() * dt), Rotation3::new(twist.angular() * dt))
}

proptest! {
    #[test]
    fn distance_and_angle_decay_exponentially_on_a_straight_line(
        way in prop::array::uniform3(-0.01..0.01), axis in prop::array::uniform3(-1.0..1.0), angle in 0.01..0.2,
    ) {
        let axis = Unit::new_normalize(Vector3::from(axis) + Vector3::new(0.0, 0.0, 1.5));
        let start = IsometryMatrix3::from_parts(
            Translation3::from(target().translation.vector + Vector3::from(way)),
            target().rotation * Rotation3::from_axis_angle(&axis, angle),
        );
        let mut rig = rig(&format!("{BOTH}\n{TARGET}"), false);
        let mut pose = start;
        let distance = Vector3::from(way).norm();
        for i in 0..250 {
            let twist = show(&mut rig, &pose).unwrap();
            // Each sample leaves 1 - g dt of both.
            let left = (1.0 - 2.0 * MS * 1e-3_f64).powi(i);
            let found = *rig.get::<Scalar>("distance").unwrap();
            prop_assert!((found - left * distance).abs() < 1e-12, "{found} against {}", left * distance);
            let found = *rig.get::<Scalar>("angle").unwrap();
            prop_assert!((found - left * angle).abs() < 1e-9, "{found} against {}", left * angle);
            let off = (pose.translation.vector - target().translation.vector) - Vector3::from(way) * left;
            prop_assert!(off.norm() < 1e-12, "beside the line: {off:?}");
            pose = moved(&pose, &twist);
        }
    }

    #[test]
    fn no_part_is_faster_than_its_speed(
        place in prop::array::uniform3(-2.0..2.0), turn in prop::array::uniform3(-3.0..3.0),
    ) {
        let pose = IsometryMatrix3::from_parts(Translation3::from(place), Rotation3::new(Vector3::from(turn)));
        let twist = show(&mut rig(&format!("{BOTH}\n{TARGET}"), false), &pose).unwrap();
        prop_assert!(twist.linear().norm() <= 0.05 * (1.0 + 1e-12) && twist.angular().norm() <= 0.5 * (1.0 + 1e-12));
        let toward = pose.rotation.inverse() * (target().translation.vector - pose.translation.vector);
        prop_assert!(twist.linear().cross(&toward).norm() < 1e-9);
    }
}

#[test]
fn without_a_target_it_holds_where_it_begins() {
    let mut rig = rig(BOTH, true);
    let here = target();
    let pushed = here * Translation3::new(0.003, 0.0, 0.0);
    let cases: [(&str, bool, f64, Option<f64>); 7] = [
        ("before the gate", false, 0.0, None),
        ("it begins", true, 0.0, Some(0.0)),
        ("pushed by 3 mm", true, 0.003, Some(-0.006)),
        ("a pause", false, 0.003, None),
        ("it goes on", true, 0.003, Some(-0.006)),
        ("the gate is lost", false, 0.003, None),
        ("for long", false, 0.003, None),
    ];
    for (what, gate, push, expected) in cases {
        if what == "for long" {
            rig.step_ms(30.0);
        }
        rig.set("gate", gate);
        let found = show(&mut rig, if push == 0.0 { &here } else { &pushed }).map(|twist| twist.0[0]);
        match (found, expected) {
            (Some(found), Some(expected)) => assert!((found - expected).abs() < 1e-12, "{what}: {found}"),
            _ => assert_eq!(found, expected, "{what}"),
        }
    }
    rig.set("gate", true);
    assert_eq!(show(&mut rig, &pushed).map(|twist| twist.linear().norm()), Some(0.0), "a new hold, at the new place");
}

#[test]
fn a_speed_of_zero_frees_a_part_and_there_counts_the_others() {
    let near = target() * Translation3::new(0.1, 0.0, 0.0);
    let turned = target() * Rotation3::new(Vector3::new(0.1, 0.0, 0.0));
    let cases = [
        ("speed_m_per_s = 0.1", &turned, true, [0.0, 0.0]),
        ("speed_m_per_s = 0.1", &near, false, [0.1, 0.0]),
        ("speed_rad_per_s = 0.1", &near, true, [0.0, 0.0]),
        ("speed_rad_per_s = 0.1", &turned, false, [0.0, 0.1]),
    ];
    for (speed, pose, is_there, [linear, angular]) in cases {
        let mut rig = rig(&format!("{speed}\n{TARGET}"), false);
        let twist = show(&mut rig, pose).unwrap();
        assert!((twist.linear().norm() - linear).abs() < 1e-9, "{speed}: {twist:?}");
        assert!((twist.angular().norm() - angular).abs() < 1e-9, "{speed}: {twist:?}");
        assert_eq!(rig.get::<Flag>("there"), Some(&is_there), "{speed}");
    }
    let mut rig = rig(TARGET, false);
    assert_eq!(show(&mut rig, &near), None);
    assert_eq!((rig.get::<Flag>("there"), rig.freshness("twist")), (Some(&false), Freshness::Absent));
}

#[test]
fn a_bad_parameter_is_a_mistake_at_its_place() {
    let cases = [
        ("gain_per_s = 0", "bad-value: `0`"),
        ("speed_m_per_s = -1", "bad-value: `-1`"),
        ("target = { xyz = [0, 0, nan] }", "bad-value: `nan`"),
        ("within_mm = 1", "unknown-key: `within_mm`"),
    ];
    for (bad, place) in cases {
        let wires: [(&str, Shape); 1] = [("pose", PoseShape::default().into())];
        assert_eq!(places(bad, &NodeRig::new::<HoldPose>(bad, &wires)), [place], "{bad}");
    }
}
