//! `ik_sink` against limits and the twist it is asked for.

use proptest::prelude::*;
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::node::{At, FilePath};
use tactflow_runtime::signal::{Jacobian, JacobianShape, Joints, PoseShape, Shape, Stamp, TwistShape};

use super::*;
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;

const LWR: &[u8] = include_bytes!("../../../../graphs/robots/lwr4p.urdf");
const BENT: [f64; 7] = [0.2, 0.6, 0.1, -1.2, 0.3, 0.9, 0.0];

fn lwr() -> Chain {
    let urdf = FilePath { path: "lwr4p.urdf".into(), span: 0..0, builtin: Some(LWR) };
    load(&urdf, "lwr_7_link", &Mount { xyz: [0.0, 0.02, 0.05], rpy: [0.1, 0.2, 0.3] }).unwrap()
}

fn rig(params: &str) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<IkSink>(params, &wires())
}

fn wires() -> [(&'static str, Shape); 4] {
    let joints = JointsShape { joints: lwr().joints().to_vec(), unit: Unit::RADIAN };
    [
        ("twist", TwistShape.into()),
        ("sensor_pose", PoseShape::default().into()),
        ("jacobian", JacobianShape(joints.clone()).into()),
        ("joints", joints.into()),
    ]
}

fn set_arm(rig: &mut NodeRig, chain: &Chain, q: &[f64; 7]) -> Vec<Twist> {
    let mut columns = vec![Twist::default(); 7];
    rig.set("sensor_pose", chain.forward(q, &mut columns));
    rig.set("jacobian", Jacobian(columns.clone().into()));
    rig.set("joints", Joints(q.to_vec().into()));
    columns
}

fn velocity(rig: &NodeRig) -> [f64; 7] {
    let velocity = rig.get::<Joints>("velocity").unwrap();
    (*velocity.0).try_into().unwrap()
}

fn twist_of(columns: &[Twist], velocity: &[f64; 7]) -> nalgebra::Vector6<f64> {
    columns.iter().zip(velocity).map(|(column, v)| column.0 * *v).sum()
}

/// A slow twist of the sensor's origin, as the adjoint would hand it over.
fn spatial(pose: &Pose, twist: [f64; 6]) -> Twist {
    let (v, w) = (nalgebra::Vector3::from_column_slice(&twist[..3]), nalgebra::Vector3::from_column_slice(&twist[3..]));
    let (v, w) = (pose.0.rotation * v, pose.0.rotation * w);
    Twist::new(v + pose.0.translation.vector.cross(&w), w)
}

proptest! {
    #[test]
    fn far_from_limits_and_singularities_the_sensor_follows_the_twist(twist in prop::array::uniform6(-0.05..0.05f64)) {
        let (chain, mut rig) = (lwr(), rig("").unwrap());
        let columns = set_arm(&mut rig, &chain, &BENT);
        let wanted = spatial(&chain.forward(&BENT, &mut columns.clone()), twist);
        rig.set("twist", wanted);
        rig.step();
        let got = twist_of(&columns, &velocity(&rig));
        prop_assert!((got - wanted.0).norm() < 0.01 * wanted.0.norm(), "{} for {}", got, wanted.0);
    }

    #[test]
    fn a_twist_that_is_too_fast_is_slowed_down_and_keeps_its_direction(twist in prop::array::uniform6(-3.0..3.0f64)) {
        let (chain, mut slow, mut fast) = (lwr(), rig("").unwrap(), rig("").unwrap());
        let columns = set_arm(&mut slow, &chain, &BENT);
        set_arm(&mut fast, &chain, &BENT);
        let pose = chain.forward(&BENT, &mut columns.clone());
        slow.set("twist", spatial(&pose, twist.map(|x| x * 1e-3)));
        fast.set("twist", spatial(&pose, twist));
        slow.step();
        fast.step();
        let (slow, fast) = (twist_of(&columns, &velocity(&slow)), twist_of(&columns, &velocity(&fast)));
        prop_assert!((slow.normalize() - fast.normalize()).norm() < 1e-9);
        prop_assert!(fast.norm() < 1001.0 * slow.norm());
    }

    #[test]
    fn the_drift_to_the_posture_never_moves_the_sensor(
        q in prop::array::uniform7(-1.9..1.9f64), twist in prop::array::uniform6(-0.02..0.02f64),
    ) {
        let chain = lwr();
        let (mut with, mut without) = (rig("posture = [0, 0.5, 0, -1, 0, 1, 0]").unwrap(), rig("").unwrap());
        let columns = set_arm(&mut with, &chain, &q);
        set_arm(&mut without, &chain, &q);
        let wanted = spatial(&chain.forward(&q, &mut columns.clone()), twist);
        with.set("twist", wanted);
        without.set("twist", wanted);
        with.step();
        without.step();
        let (with, without) = (twist_of(&columns, &velocity(&with)), twist_of(&columns, &velocity(&without)));
        prop_assert!((with - without).norm() < 1e-13, "{}", with - without);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]
    #[test]
    fn the_limits_hold_under_random_twists(
        twists in prop::collection::vec(prop::array::uniform6(-2.0..2.0f64), 20),
        posture in prop::array::uniform7(-2.0..2.0f64),
    ) {
        let chain = lwr();
        let mut rig = rig(&format!("posture = {posture:?}\nposture_gain = 3.0")).unwrap();
        let mut q = BENT;
        for twist in twists {
            for _ in 0..400 {
                let columns = set_arm(&mut rig, &chain, &q);
                let pose = chain.forward(&q, &mut columns.clone());
                rig.set("twist", spatial(&pose, twist));
                rig.step();
                for ((q, v), joint) in q.iter_mut().zip(velocity(&rig)).zip(chain.joints()) {
                    prop_assert!(v.abs() <= joint.speed, "{}: {}", joint.name, v);
                    *q += v * 1e-3;
                    prop_assert!((joint.lower..=joint.upper).contains(q), "{}: {}", joint.name, q);
                }
            }
        }
    }
}

#[test]
fn a_free_arm_drifts_to_its_posture() {
    let (chain, mut rig) = (lwr(), rig("posture = [0.2, 0.6, 0.6, -1.2, 0.3, 0.9, 0]\nposture_gain = 2").unwrap());
    let mut q = BENT;
    let start = chain.forward(&q, &mut [Twist::default(); 7]);
    for _ in 0..3000 {
        set_arm(&mut rig, &chain, &q);
        rig.set("twist", Twist::default());
        rig.step();
        for (q, v) in q.iter_mut().zip(velocity(&rig)) {
            *q += v * 1e-3;
        }
    }
    let end = chain.forward(&q, &mut [Twist::default(); 7]);
    assert!((end.0.to_homogeneous() - start.0.to_homogeneous()).norm() < 1e-3, "the sensor stays");
    assert!((q[2] - BENT[2]).abs() > 0.05, "and the elbow moves: {q:?}");
    assert!(velocity(&rig).iter().all(|v| v.abs() < 5e-3), "until it is as near as it can be");
}

#[test]
fn without_a_twist_there_is_no_velocity() {
    let (chain, mut rig) = (lwr(), rig("").unwrap());
    for is_there in [true, false, true] {
        set_arm(&mut rig, &chain, &BENT);
        if is_there {
            rig.set("twist", Twist([0.01; 6].into()));
        } else {
            rig.lose("twist");
        }
        rig.step();
        assert_eq!(rig.get::<Joints>("velocity").is_some(), is_there);
        assert_eq!(rig.get::<f64>("share").is_some(), is_there);
    }
}

#[test]
fn a_joint_at_its_limit_stops_the_task_and_lowers_the_share() {
    let (chain, push) = (lwr(), [0.0, 0.0, 0.05, 0.0, 0.0, 0.0]);
    let share = |q: &[f64; 7], scale: f64| {
        let mut rig = rig("").unwrap();
        let columns = set_arm(&mut rig, &chain, q);
        let pose = chain.forward(q, &mut columns.clone());
        rig.set("twist", spatial(&pose, push.map(|x| scale * x)));
        rig.step();
        (*rig.get::<f64>("share").unwrap(), velocity(&rig))
    };
    let (free, small) = share(&BENT, 1e-3);
    assert_eq!(free, 1.0);
    let (slowed, fast) = share(&BENT, 1000.0);
    assert!(slowed > 0.0 && slowed < 0.1, "{slowed}");
    for (fast, small) in fast.iter().zip(small) {
        assert!((fast - slowed * 1e6 * small).abs() < 1e-9, "{fast} of {small}");
    }
    // The joint that this push moves most stands at either end: toward one of them it would have to move on.
    let most = (0..7).max_by(|i, j| small[*i].abs().total_cmp(&small[*j].abs())).unwrap();
    let joint = &chain.joints()[most];
    let mut shares = [joint.lower, joint.upper].map(|end| {
        let mut q = BENT;
        q[most] = end;
        let (share, velocity) = share(&q, 1.0);
        assert_eq!(share == 0.0, velocity == [0.0; 7]);
        share
    });
    shares.sort_by(f64::total_cmp);
    assert_eq!(shares, [0.0, 1.0], "and the other end it leaves");
}

#[test]
fn an_input_that_is_nan_does_not_panic() {
    type Spoil = fn(&mut NodeRig, Stamp);
    let spoils: [Spoil; 4] = [
        |rig, now| rig.edit("twist", now, |twist: &mut Twist| twist.0[0] = f64::NAN),
        |rig, now| rig.edit("sensor_pose", now, |pose: &mut Pose| pose.0.translation.vector.x = f64::NAN),
        |rig, now| rig.edit("jacobian", now, |jacobian: &mut Jacobian| jacobian.0[0].0[0] = f64::NAN),
        |rig, now| rig.edit("joints", now, |joints: &mut Joints| joints.0[0] = f64::NAN),
    ];
    for spoil in spoils {
        let (chain, mut rig) = (lwr(), rig("posture = [0, 0.5, 0, -1, 0, 1, 0]").unwrap());
        set_arm(&mut rig, &chain, &BENT);
        rig.set("twist", Twist([0.01; 6].into()));
        let now = Stamp { nanos: rig.tick.now, device: 0 };
        spoil(&mut rig, now);
        rig.step();
    }
}

#[test]
fn a_bad_parameter_is_a_mistake() {
    let cases = [
        (
            "damping = 0.0005",
            At::Param("damping".into()),
            "`damping` is less than 0.001, which is too small for double precision",
        ),
        (
            "limit_gain = 501",
            At::Param("limit_gain".into()),
            "a joint could cross its limit: `limit_gain` is more than 500 1/s",
        ),
        ("posture = [0, 0]", At::Param("posture".into()), "`posture` has 2 entries, but the arm has 7 joints"),
        (
            "posture = [0, 9, 0, 0, 0, 0, 0]",
            At::Param("posture".into()),
            "joint `lwr_a2_joint` cannot be at 9: its range is -2.0944 to 2.0944 (rad, or m if prismatic)",
        ),
    ];
    for (params, at, message) in cases {
        let mistakes = rig(params).err().expect(params);
        assert_eq!((mistakes.len(), &mistakes[0].at, mistakes[0].message.as_str()), (1, &at, message));
    }
    let joints = JointsShape { joints: lwr().joints().to_vec(), unit: Unit::RADIAN };
    let fewer = JointsShape { joints: joints.joints[..6].to_vec(), unit: Unit::RADIAN };
    let wires = [
        ("twist", TwistShape.into()),
        ("sensor_pose", PoseShape::default().into()),
        ("jacobian", JacobianShape(fewer).into()),
        ("joints", joints.into()),
    ];
    let mistakes = NodeRig::new::<IkSink>("", &wires).err().unwrap();
    assert_eq!(mistakes[0].at, At::Input("jacobian".into()));
}
