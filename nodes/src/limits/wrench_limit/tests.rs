//! The ceiling of the whole tool: the speed into a load, its lever, the room to brake, and a compliant arm.

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{FeaturesShape, JacobianShape, Joint, JointsShape, PoseShape, Shape, TwistShape, Unit};

use super::*;
use crate::motion::braking::stopping_speed;
use crate::motion::pose::pose_of;

/// Two periods of the rig [s].
const DELAY: f64 = 0.002;
const PARAMS: &str = "wrench_n = 30.0\ndeceleration_m_per_s2 = 2.0\n";

fn shape(names: [&str; 6]) -> Shape {
    FeaturesShape::new(names.into_iter().zip([[Unit::NEWTON; 3], [Unit::NEWTON_METRE; 3]].concat())).into()
}

fn make(params: &str) -> Result<NodeRig, Mistakes> {
    let wires = [("twist", TwistShape.into()), ("wrench", shape(NAMES)), ("pose", PoseShape::default().into())];
    let joints = vec![Joint { name: "turn".into(), ..Joint::default() }];
    let jacobian = ("jacobian", JacobianShape(JointsShape { joints, unit: Unit::RADIAN }).into());
    NodeRig::new::<WrenchLimit>(&format!("{PARAMS}{params}"), &[&wires[..], &[jacobian]].concat())
}

/// What passes of a motion under a wrench.
fn pass(rig: &mut NodeRig, wrench: [f64; 6], linear: [f64; 3], angular: [f64; 3]) -> Option<Twist> {
    rig.set_features("wrench", &wrench.map(Some));
    rig.set("twist", Twist::new(linear.into(), angular.into()));
    rig.step();
    rig.get::<Twist>("twist").copied()
}

fn speed(rig: &mut NodeRig, wrench: [f64; 6], linear: [f64; 3]) -> f64 {
    pass(rig, wrench, linear, [0.0; 3]).unwrap().linear().norm()
}

#[test]
fn at_each_load_the_tool_stops_before_the_ceiling() {
    let mut rig = make("").unwrap();
    for load in [3.1, 10.0, 29.0] {
        let v = speed(&mut rig, [0.0, 0.0, -load, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
        let way = v * DELAY + v * v / 4.0;
        assert!((1e5 * way + load - 30.0).abs() < 1e-9, "{load} N at {v} m/s");
        // Away from the load and across it nothing is limited.
        assert_eq!(speed(&mut rig, [0.0, 0.0, -load, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0]), 1.0);
        assert_eq!(speed(&mut rig, [0.0, 0.0, -load, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0]), 1.0);
    }
    for load in [30.0, 31.0, 500.0] {
        assert_eq!(speed(&mut rig, [load, 0.0, 0.0, 0.0, 0.0, 0.0], [-1.0, 0.2, 0.0]), 0.0);
        assert_eq!(*rig.get::<Scalar>("wrench").unwrap(), 0.0);
        assert_eq!(speed(&mut rig, [load, 0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0]), 1.0);
    }
}

#[test]
fn before_a_touch_the_fastest_point_of_the_tool_has_room_to_brake_in_all_directions() {
    let capsule = "capsule = { ends_m = [[0.0, 0.0, 0.0], [0.0, 0.3, 0.0]], radius_m = 0.1 }\n";
    let mut rig = make(capsule).unwrap();
    let allowed = stopping_speed(30.0 / 1e5, 2.0, DELAY);
    for linear in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]] {
        assert!((speed(&mut rig, [0.0; 6], linear) - allowed).abs() < 1e-12);
    }
    // 1 rad/s about x: the far end moves at 0.3 m/s, and its surface by 0.1 m/s faster.
    let turned = pass(&mut rig, [0.0; 6], [0.0; 3], [1.0, 0.0, 0.0]).unwrap();
    assert!((turned.angular().norm() * 0.4 - allowed).abs() < 1e-12, "{turned:?}");
    assert_eq!(speed(&mut rig, [0.0; 6], [0.9 * allowed, 0.0, 0.0]), 0.9 * allowed);
}

#[test]
fn a_torque_has_a_ceiling_of_its_own() {
    let mut rig = make("wrench_n_m = 2.0").unwrap();
    // 10 N at a lever of 0.2 m are 2 N m.
    assert_eq!(speed(&mut rig, [0.0, 0.0, -10.0, 0.0, 2.0, 0.0], [0.0, 0.0, 1.0]), 0.0);
    let v = speed(&mut rig, [0.0, 0.0, -5.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    assert!((v - stopping_speed(1.0 / (1e5 * 0.2), 2.0, DELAY)).abs() < 1e-12, "{v}");
}

#[test]
fn a_compliant_arm_is_a_spring_in_series() {
    let mut rig = make("joint_n_m_per_rad = 200.0").unwrap();
    // A joint about y of the base, 0.5 m aside of the tip: z of the tip moves by 0.5 m per radian.
    rig.set("pose", Pose(IsometryMatrix3::translation(-0.5, 0.0, 0.3)));
    rig.set("jacobian", Jacobian([Twist::new(Vector3::zeros(), Vector3::y())].into()));
    let v = speed(&mut rig, [0.0, 0.0, -10.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let way = 20.0 * (1e-5 + 0.25 / 200.0);
    assert!((v - stopping_speed(way, 2.0, DELAY)).abs() < 1e-9, "{v}");
    // Before the touch its mass counts.
    let v = speed(&mut rig, [0.0; 6], [0.0, 0.0, 1.0]);
    assert!((v - stopping_speed(30.0 / 1e5, 2.0, DELAY)).abs() < 1e-12, "{v}");
}

proptest! {
    /// The point of the contact moves into it as fast as is allowed, wherever the sensor is on the tip.
    #[test]
    fn the_point_of_the_contact_is_as_fast_as_allowed(
        force in prop::array::uniform3(4.0..9.0f64), point in prop::array::uniform3(-0.3..0.3f64),
        xyz in prop::array::uniform3(-0.2..0.2f64), rpy in prop::array::uniform3(-3.0..3.0f64),
        twist in prop::array::uniform6(-1.0..1.0f64),
    ) {
        let mut rig = make(&format!("mount = {{ xyz = {xyz:?}, rpy = {rpy:?} }}")).unwrap();
        let (f, p) = (Vector3::from(force), Vector3::from(point));
        let t = p.cross(&f);
        let [x, y, z, a, b, c] = twist;
        let wrench = [f.x, f.y, f.z, t.x, t.y, t.z];
        let out = pass(&mut rig, wrench, [x, y, z], [a, b, c]).unwrap();
        let mount = pose_of(xyz, rpy);
        // The velocity of the point in the axes of the tip.
        let into = |twist: Twist| {
            let (v, w) = (mount.rotation * twist.linear(), mount.rotation * twist.angular());
            -(v + w.cross(&(p - mount.translation.vector))).dot(&f) / f.norm()
        };
        let wanted = into(Twist::new([x, y, z].into(), [a, b, c].into()));
        let allowed = stopping_speed((30.0 - f.norm()) / 1e5, 2.0, DELAY);
        prop_assert!((into(out) - wanted.min(allowed)).abs() < 1e-9, "{} of {wanted}, {allowed}", into(out));
    }
}

#[test]
fn without_a_fresh_and_whole_wrench_nothing_moves() {
    let mut rig = make("max_age_ms = 3").unwrap();
    assert!(pass(&mut rig, [0.0; 6], [0.001, 0.0, 0.0], [0.0; 3]).is_some());
    for _ in 0..3 {
        rig.set("twist", Twist::new(Vector3::x() * 1e-3, Vector3::zeros()));
        rig.step();
    }
    assert!(rig.get::<Twist>("twist").is_some());
    rig.step();
    assert!(rig.get::<Twist>("twist").is_none(), "a wrench of 4 ms ago");
    rig.set_features("wrench", &[Some(0.0), Some(0.0), None, Some(0.0), Some(0.0), Some(0.0)]);
    rig.step();
    assert!(rig.get::<Twist>("twist").is_none(), "a component is absent");
    let nan = pass(&mut rig, [f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0; 3]).unwrap();
    assert!(nan.0.iter().all(|part| *part == 0.0) && rig.get::<Scalar>("wrench").unwrap().is_nan());
}

#[test]
fn other_features_than_a_wrench_are_refused() {
    let other = [("twist", TwistShape.into()), ("wrench", shape(["x", "y", "z", "a", "b", "c"]))];
    let made = NodeRig::new::<WrenchLimit>(PARAMS, &other);
    assert_eq!(places(PARAMS, &made).len(), 1);
    let bad = "capsule = { ends_m = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]], radius_m = -0.1 }";
    let made = make(bad);
    let found = places(&format!("{PARAMS}{bad}"), &made);
    assert!(found.len() == 1 && found[0].contains("-0.1"), "{found:?}");
}
