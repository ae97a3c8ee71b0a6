//! `ik_sink` against limits, ages and the twist it is asked for.

use proptest::prelude::*;
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::signal::{Jacobian, JacobianShape, Joints, PoseShape, Shape, Stamp, TwistShape};

use super::*;
use crate::arm::chain::Chain;
use crate::arm::model::chain_of;
use crate::arm::mount::Mount;

const LWR: &str = include_str!("../../../../graphs/robots/lwr4p.urdf");
const BENT: [f64; 7] = [0.2, 0.6, 0.1, -1.2, 0.3, 0.9, 0.0];

fn lwr() -> Chain {
    chain_of(LWR, "lwr_7_link", &Mount { xyz: [0.0, 0.02, 0.05], rpy: [0.1, 0.2, 0.3] }).unwrap()
}

fn rig(params: &str) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<IkSink>(params, &wires())
}

fn wires() -> [(&'static str, Shape); 4] {
    let joints = JointsShape { joints: lwr().joints().to_vec(), unit: Unit::RADIAN };
    [
        ("twist", TwistShape.into()),
        ("sensor_pose", PoseShape.into()),
        ("jacobian", JacobianShape(joints.clone()).into()),
        ("joints", joints.into()),
    ]
}

#[test]
fn a_sink_that_no_twist_is_wired_to_does_not_load() {
    let mistakes = NodeRig::new::<IkSink>("", &wires()[1..]).err().unwrap();
    let said: Vec<_> = mistakes.iter().map(|mistake| (mistake.code, &*mistake.message)).collect();
    assert_eq!(said, [(Code::MissingInput, "`ik_sink` needs `in.twist`, a twist")]);
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
    fn far_from_everything_the_sensor_moves_as_wanted(twist in prop::array::uniform6(-0.05..0.05f64)) {
        let (chain, mut rig) = (lwr(), rig("").unwrap());
        let columns = set_arm(&mut rig, &chain, &BENT);
        let wanted = spatial(&chain.forward(&BENT, &mut columns.clone()), twist);
        rig.set("twist", wanted);
        rig.step();
        let got = twist_of(&columns, &velocity(&rig));
        prop_assert!((got - wanted.0).norm() < 0.01 * wanted.0.norm(), "{} for {}", got, wanted.0);
    }

    #[test]
    fn a_twist_too_fast_is_slowed_down_but_not_turned(twist in prop::array::uniform6(-3.0..3.0f64)) {
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
    fn posture_never_moves_the_sensor(
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
    fn limits_hold_for_as_long_as_anything_random_pushes(
        twists in prop::collection::vec(prop::array::uniform6(-2.0..2.0f64), 20),
        posture in prop::array::uniform7(-2.0..2.0f64),
    ) {
        let chain = lwr();
        let mut rig = rig(&format!("posture = {posture:?}\nposture_gain = 3.0\nramp_ms = 20.0")).unwrap();
        let mut q = BENT;
        for twist in twists {
            for ms in 0..400 {
                let columns = set_arm(&mut rig, &chain, &q);
                let pose = chain.forward(&q, &mut columns.clone());
                // For a quarter of the time there is no twist, so that the ramp is in it too.
                if ms < 300 {
                    rig.set("twist", spatial(&pose, twist));
                } else {
                    rig.lose("twist");
                }
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
fn an_arm_that_is_free_drifts_to_its_posture() {
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
fn nothing_fresh_fades_to_nothing_and_comes_back() {
    let chain = lwr();
    let push = Twist([0.01, 0.0, 0.02, 0.0, 0.0, 0.1].into());
    let old = |rig: &NodeRig, ms: i64| Stamp { nanos: rig.tick.now - ms * 1_000_000, device: 0 };
    // The rig ticks at 1 kHz, so the greatest age is 5 ms.
    type Spoil = fn(&mut NodeRig, &dyn Fn(&NodeRig, i64) -> Stamp);
    let spoils: [(&str, Spoil); 4] = [
        ("the twist is lost", |rig, _| rig.lose("twist")),
        ("the twist is old", |rig, old| rig.edit("twist", old(rig, 6), |_: &mut Twist| {})),
        ("the joints are old", |rig, old| rig.edit("joints", old(rig, 6), |_: &mut Joints| {})),
        ("the Jacobian is old", |rig, old| rig.edit("jacobian", old(rig, 6), |_: &mut Jacobian| {})),
    ];
    for (what, spoil) in spoils {
        let mut rig = rig("ramp_ms = 10.0").unwrap();
        let fresh = |rig: &mut NodeRig| {
            set_arm(rig, &chain, &BENT);
            rig.set("twist", push);
        };
        for _ in 0..3 {
            fresh(&mut rig);
            rig.step();
        }
        let full = velocity(&rig);
        assert!(full.iter().any(|v| v.abs() > 0.01), "{what}");
        for tick in 1..15 {
            fresh(&mut rig);
            spoil(&mut rig, &old);
            rig.step();
            let left = (1.0 - 0.1 * f64::from(tick)).max(0.0);
            for (v, full) in velocity(&rig).iter().zip(full) {
                assert!((v - left * full).abs() < 1e-12, "{what}, tick {tick}: {v} of {full}");
            }
        }
        assert_eq!(velocity(&rig), [0.0; 7], "{what}");
        fresh(&mut rig);
        rig.step();
        assert_eq!(velocity(&rig), full, "{what}: it resumes");
    }
}

#[test]
fn a_held_twist_counts_until_it_is_too_old_and_generated_motion_never_is() {
    let chain = lwr();
    for (stamp, lasts) in [(None, 5), (Some(Stamp::TIMELESS), 50)] {
        let mut rig = rig("").unwrap();
        set_arm(&mut rig, &chain, &BENT);
        let stamp = stamp.unwrap_or(Stamp { nanos: rig.tick.now, device: 0 });
        rig.edit("twist", stamp, |twist: &mut Twist| *twist = Twist([0.01; 6].into()));
        rig.step();
        let full = velocity(&rig);
        for tick in 1..=50 {
            set_arm(&mut rig, &chain, &BENT);
            rig.step();
            assert_eq!(velocity(&rig) == full, tick <= lasts, "tick {tick}");
        }
    }
}

#[test]
fn bad_settings() {
    let cases = [
        ("damping = 0.0005", At::Param("damping".into()), "`damping` of less than 0.001 drowns in rounding"),
        (
            "limit_gain = 501",
            At::Param("limit_gain".into()),
            "a joint could cross its limit: `limit_gain` is more than 500 1/s",
        ),
        ("posture = [0, 0]", At::Param("posture".into()), "`posture` has 2 entries, but the arm has 7 joints"),
        (
            "posture = [0, 9, 0, 0, 0, 0, 0]",
            At::Param("posture".into()),
            "joint `lwr_a2_joint` cannot be at 9: it goes from -2.0944 to 2.0944",
        ),
    ];
    for (params, at, message) in cases {
        let mistakes = rig(params).err().expect(params);
        assert_eq!((mistakes.len(), &mistakes[0].at, mistakes[0].message.as_str()), (1, &at, message));
    }
    let joints = JointsShape { joints: lwr().joints().to_vec(), unit: Unit::RADIAN };
    let fewer = JointsShape { joints: joints.joints[..6].to_vec(), unit: Unit::RADIAN };
    let wires =
        [("sensor_pose", PoseShape.into()), ("jacobian", JacobianShape(fewer).into()), ("joints", joints.into())];
    let mistakes = NodeRig::new::<IkSink>("", &wires).err().unwrap();
    assert_eq!(mistakes[0].at, At::Input("jacobian".into()));
}
