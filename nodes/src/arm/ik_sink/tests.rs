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
    let urdf = FilePath { path: "lwr4p.urdf".into(), span: 0..0, builtin: Some(LWR.into()) };
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
        prop_assert!((got - wanted.0).norm() < 1e-12, "{} for {}", got, wanted.0);
        prop_assert_eq!(rig.get::<Twist>("lost"), Some(&Twist::default()));
        prop_assert_eq!(&*rig.get::<Joints>("limited").unwrap().0, &[0.0; 7]);
        prop_assert_eq!((rig.get::<f64>("share"), rig.get::<f64>("damping")), (Some(&1.0), Some(&0.0)));
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
        // Joints may exceed their limit by 1e-9 of the fastest one before they are cut off.
        let off = (slow.normalize() - fast.normalize()).norm();
        prop_assert!(off < 1e-7, "{}", off);
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
fn a_twist_that_is_too_fast_lowers_the_share_by_as_much_as_it_is_slowed_down() {
    let chain = lwr();
    for (speed, is_too_fast) in [(0.05, false), (50.0, true)] {
        let mut rig = rig("").unwrap();
        let columns = set_arm(&mut rig, &chain, &BENT);
        let pose = chain.forward(&BENT, &mut columns.clone());
        rig.set("twist", spatial(&pose, [0.0, 0.0, speed, 0.0, 0.0, 0.0]));
        rig.step();
        let share = *rig.get::<f64>("share").unwrap();
        assert_eq!((share < 0.1, share == 1.0), (is_too_fast, !is_too_fast), "{share} at {speed} m/s");
        let produced: [f64; 6] = at_sensor(&pose, &Twist(twist_of(&columns, &velocity(&rig))));
        assert!((produced[2] - share * speed).abs() < 1e-6, "{produced:?} is not {share} of {speed} m/s");
        assert!(produced.iter().enumerate().all(|(i, x)| i == 2 || x.abs() < 1e-6), "{produced:?}");
    }
}

/// Postures of which many are at a limit of a joint, or singular: the arm is stretched or its wrist is straight.
fn any_posture() -> impl Strategy<Value = [f64; 7]> {
    let joint = (0.0..1.0f64, 0..12u8);
    (prop::array::uniform7(joint), -1e-2..1e-2f64).prop_map(|(joints, near)| {
        let mut joints = joints.iter().zip(lwr().joints().to_vec()).map(|((part, kind), joint)| match kind {
            0 => joint.upper,
            1 => joint.lower,
            2 => joint.upper - 0.01 * part,
            3 | 4 => near,
            _ => joint.lower + part * (joint.upper - joint.lower),
        });
        std::array::from_fn(|_| joints.next().unwrap())
    })
}

/// Up to 0.1 m/s and 0.5 rad/s; half of them are slides.
fn any_twist() -> impl Strategy<Value = [f64; 6]> {
    (prop::array::uniform6(-1.0..1.0f64), any::<bool>()).prop_map(|([a, b, c, d, e, f], is_slide)| {
        let part = f64::from(u8::from(!is_slide));
        [0.1 * a, 0.1 * b, 0.1 * part * c, 0.5 * part * d, 0.5 * part * e, 0.5 * part * f]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn a_motion_is_within_the_limits_and_never_pushes_and_the_rest_is_lost(
        q in any_posture(), twist in any_twist(), has_posture in any::<bool>(),
    ) {
        let chain = lwr();
        let mut rig = rig(if has_posture { "posture = [0, 0.5, 0, -1, 0, 1, 0]" } else { "" }).unwrap();
        let columns = set_arm(&mut rig, &chain, &q);
        let pose = chain.forward(&q, &mut columns.clone());
        rig.set("twist", spatial(&pose, twist));
        rig.step();
        let got = velocity(&rig);
        for ((v, joint), q) in got.iter().zip(chain.joints()).zip(q) {
            let (min, max) = interval(joint, [q; 2], 0.2);
            prop_assert!(*v >= min - 1e-12 && *v <= max + 1e-12, "{}: {} not in {}..{}", joint.name, v, min, max);
        }
        let produced: [f64; 6] = at_sensor(&pose, &Twist(twist_of(&columns, &got)));
        prop_assert!(produced[2] >= twist[2].min(0.0) - 1e-8 && produced[2] <= twist[2].max(0.0) + 1e-8, "{:?}", produced);
        let lost: [f64; 6] = rig.get::<Twist>("lost").unwrap().0.into();
        for i in 0..6 {
            prop_assert!((produced[i] + lost[i] - twist[i]).abs() < 1e-9, "{:?} and {:?} of {:?}", produced, lost, twist);
        }
        let (sigma, damping) = (*rig.get::<f64>("sigma").unwrap(), *rig.get::<f64>("damping").unwrap());
        prop_assert_eq!(damping > 0.0, sigma < 0.02);
        prop_assume!(weighted(&twist, &twist) > 0.0);
        let share = weighted(&produced, &twist) / weighted(&twist, &twist);
        prop_assert!((rig.get::<f64>("share").unwrap() - share.clamp(0.0, 1.0)).abs() < 1e-9, "not {}", share);
    }

    #[test]
    fn a_small_change_of_the_posture_changes_the_velocities_little(
        q in any_posture(), twist in any_twist(), change in prop::array::uniform7(-1e-6..1e-6f64),
    ) {
        let chain = lwr();
        let [one, other] = [0.0, 1.0].map(|part| {
            let mut rig = rig("posture = [0, 0.5, 0, -1, 0, 1, 0]").unwrap();
            let mut q: [f64; 7] = std::array::from_fn(|i| q[i] + part * change[i]);
            q.iter_mut().zip(chain.joints()).for_each(|(q, joint)| *q = q.clamp(joint.lower, joint.upper));
            let columns = set_arm(&mut rig, &chain, &q);
            rig.set("twist", spatial(&chain.forward(&q, &mut columns.clone()), twist));
            rig.step();
            velocity(&rig)
        });
        for (one, other) in one.iter().zip(other) {
            // A jump would be as large as the velocities, 1 rad/s; the steepest slope is 1/eps², for eps = 0.004.
            prop_assert!((one - other).abs() < 0.06, "{} and {}", one, other);
        }
    }
}

#[test]
fn a_joint_at_its_limit_gives_way_to_the_elbow_and_is_marked() {
    let chain = lwr();
    let (mut marked, mut followed) = (0, 0);
    for (i, is_upper) in (0..7).flat_map(|i| [(i, false), (i, true)]) {
        let mut q = BENT;
        q[i] = if is_upper { chain.joints()[i].upper } else { chain.joints()[i].lower };
        let mut rig = rig("").unwrap();
        let columns = set_arm(&mut rig, &chain, &q);
        let pose = chain.forward(&q, &mut columns.clone());
        rig.set("twist", spatial(&pose, [0.0, 0.0, 0.02, 0.0, 0.0, 0.0]));
        rig.step();
        let limited = rig.get::<Joints>("limited").unwrap().0.to_vec();
        let (share, at_limit) = (*rig.get::<f64>("share").unwrap(), velocity(&rig)[i]);
        assert!(limited.iter().enumerate().all(|(j, mark)| j == i || *mark == 0.0), "{limited:?}");
        if limited[i] == 0.0 {
            assert_eq!(share, 1.0, "nothing is in the way of joint {i}");
            continue;
        }
        marked += 1;
        followed += usize::from(share > 0.99);
        assert_eq!((limited[i] > 0.0, at_limit), (is_upper, 0.0), "joint {i} stands at its limit");
    }
    assert!(marked >= 4 && followed >= marked / 2, "{followed} of {marked} motions are followed all the same");
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

#[test]
fn an_equilibrium_at_its_limit_does_not_stop_the_arm() {
    let chain = lwr();
    let joints = JointsShape { joints: chain.joints().to_vec(), unit: Unit::RADIAN };
    let wires = wires().into_iter().chain([("equilibrium", joints.into())]).collect::<Vec<_>>();
    let mut rig = NodeRig::new::<IkSink>("", &wires).unwrap();
    let columns = set_arm(&mut rig, &chain, &BENT);
    let pose = chain.forward(&BENT, &mut columns.clone());
    // The spring of a held arm: one joint after the other has run ahead to its upper limit, the measured one has not.
    for i in 0..7 {
        let mut ahead = BENT;
        ahead[i] = chain.joints()[i].upper;
        rig.set("equilibrium", Joints(ahead.to_vec().into()));
        for twist in
            [[0.0, 0.0, -0.02, 0.0, 0.0, 0.0], [0.01, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.01, 0.01, 0.0, 0.1, 0.0]]
        {
            rig.set("twist", spatial(&pose, twist));
            rig.step();
            let got = velocity(&rig);
            assert!(got[i] <= 0.0, "joint {i} runs on at {} rad/s", got[i]);
            let share = *rig.get::<f64>("share").unwrap();
            assert!(share > 0.4, "joint {i} leaves {share} of {twist:?}");
        }
    }
}
