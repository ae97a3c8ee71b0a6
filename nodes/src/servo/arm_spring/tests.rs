//! The spring against an arm that is computed here: what it gives way, its swing, and what it learns.

use nalgebra::{IsometryMatrix3, Rotation3, Translation3};
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::signal::{JacobianShape, Joint, JointsShape, PoseShape, Shape, Twist};

use super::learned::{SETTLE_S, SMOOTH_S};
use super::*;

/// Period of the rig [s], and how far the joint moves the sensor along its z [m/rad].
const PERIOD: f64 = 0.004;
const ARM: f64 = 0.6;
/// Stiffness of the joint [N m/rad], so the compliance along z is 0.36 / 200 = 1.8 mm/N.
const JOINT: &str = "joint_n_m_per_rad = 200.0";
const COMPLIANCE: f64 = ARM * ARM / 200.0;

struct Cell {
    rig: NodeRig,
    /// How far the joint moves the sensor along its z [m/rad].
    arm: f64,
}

impl Cell {
    fn new(params: &str, unit: Unit) -> Self {
        let joints =
            JointsShape { joints: vec![Joint { name: "elbow".into(), ..Joint::default() }], unit: Unit::RADIAN };
        let wires: [(&str, Shape); 5] = [
            ("force", ScalarShape::of(unit).into()),
            ("pose", PoseShape::default().into()),
            ("jacobian", JacobianShape(joints.clone()).into()),
            ("position", joints.clone().into()),
            ("equilibrium", joints.into()),
        ];
        let rig = NodeRig::new::<ArmSpring>(params, &wires).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        Self { rig, arm: ARM }
    }

    /// Steps with a force [N], or without a contact, and with a lead along z [m]. Returns what the arm gives way, and its
    /// swing [m].
    fn step(&mut self, force: impl Into<Option<f64>>, lead: f64) -> Option<[f64; 2]> {
        let Self { rig, arm } = self;
        match force.into() {
            Some(force) => rig.set("force", force),
            None => rig.lose("force"),
        }
        // The sensor looks along the base's -x, at a place that makes the joint move it along its z.
        let turn = Rotation3::from_euler_angles(0.0, -std::f64::consts::FRAC_PI_2, 0.0);
        let place = Translation3::new(0.2, 0.0, *arm);
        rig.set("pose", Pose(IsometryMatrix3::from_parts(place, turn)));
        // A joint about -y through the base's origin.
        rig.set("jacobian", Jacobian([Twist([0.0, 0.0, 0.0, 0.0, -1.0, 0.0].into())].into()));
        rig.set("position", Joints([0.3].into()));
        rig.set("equilibrium", Joints([0.3 + if *arm == 0.0 { 0.0 } else { lead / *arm }].into()));
        rig.step_ms(1e3 * PERIOD);
        Some([*rig.get::<Scalar>("deflection")?, *rig.get::<Scalar>("swing")?])
    }
}

#[test]
fn an_arm_at_rest_gives_way_by_its_compliance_and_does_not_swing() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    for i in 0..500 {
        let force = 0.01 * f64::from(i);
        let [deflection, swing] = cell.step(force, COMPLIANCE * force).unwrap();
        assert!((deflection - COMPLIANCE * force).abs() < 1e-7, "{i}: {deflection}");
        assert!(swing.abs() < 1e-6, "{i}: {swing}");
    }
}

#[test]
fn a_lead_without_a_force_is_a_swing_and_what_stays_is_none() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    (0..100).for_each(|_| assert!(cell.step(2.0, 0.005).unwrap()[1].abs() < 1e-9, "where the contact begins"));
    // 2.4 Hz pass: the filters take 1 / (1 + 1 / (w T)²) and 1 / (1 + (w t)²) of the power.
    let omega = 15.0_f64;
    let swings: Vec<f64> = (0..2000)
        .map(|i| cell.step(2.0, 0.005 + 0.001 * libm::sin(omega * PERIOD * f64::from(i))).unwrap()[1])
        .collect();
    let most = swings[1500..].iter().fold(0.0, |most: f64, swing| most.max(swing.abs()));
    let passes = 1.0 / (1.0 + (omega * SETTLE_S).powi(-2)).sqrt() / (1.0 + (omega * SMOOTH_S).powi(2)).sqrt();
    assert!((most / (0.001 * passes) - 1.0).abs() < 0.03, "{most} of {}", 0.001 * passes);
    let stays = (0..500).map(|_| cell.step(2.0, 0.008).unwrap()[1]).last().unwrap();
    assert!(stays.abs() < 0.0003, "of 3 mm of friction, less than a tenth is a swing after 2 s: {stays}");
}

#[test]
fn the_true_compliance_is_learned_up_to_three_times_the_stated_one_and_stays_after_the_contact() {
    let arms = [(0.07, 3.0, 0.07), (0.5, 3.0, 0.5), (2.0, 3.0, 2.0), (10.0, 0.4, 3.0), (-1.0, 2.0, 0.05)];
    for (times, most, learned) in arms {
        let mut cell = Cell::new(JOINT, Unit::NEWTON);
        let press = |cell: &mut Cell| {
            let force = |i: u32| most - most * libm::exp(-0.02 * f64::from(i));
            (0..3000).map(|i| cell.step(force(i), times * COMPLIANCE * force(i)).unwrap()[0]).last().unwrap()
        };
        let found = press(&mut cell) / (most * COMPLIANCE);
        assert!((found / learned - 1.0).abs() < 0.1, "{times}: {found}");
        assert_eq!(cell.step(None, 0.0), None, "without a contact");
        let again = cell.step(most, 0.0).unwrap()[0] / (most * COMPLIANCE);
        assert!((again / found - 1.0).abs() < 0.02, "{times}: {again} after {found}");
    }
}

#[test]
fn a_stiffness_that_is_not_the_stated_one_is_found() {
    let found = |times: f64, most: f64, samples: u32| {
        let mut cell = Cell::new(JOINT, Unit::NEWTON);
        for i in 0..samples {
            let force = most - most * libm::exp(-0.02 * f64::from(i));
            cell.step(force, times * COMPLIANCE * force);
        }
        cell.step(None, 0.0);
        // A light contact teaches nothing more, and takes nothing back.
        let found = cell.rig.found();
        for _ in 0..5000 {
            cell.step(0.1, times * COMPLIANCE * 0.1);
        }
        // The first press alone is too short, and what follows may complete it.
        assert!(samples < 250 || found == cell.rig.found(), "{found:?}, then {:?}", cell.rig.found());
        found
    };
    assert_eq!(
        found(0.25, 3.0, 1500).unwrap(),
        "the arm is 4.0 times as stiff as stated, as if its joints had 800 N m/rad: correct `stiffness` in its robot file, or \
         the controller if the device sends it this number"
    );
    assert!(found(2.0, 3.0, 1500).unwrap().starts_with("the arm is 2.0 times as soft as stated, as if"));
    assert!(found(0.02, 3.0, 1500).unwrap().starts_with("the arm is at least 20.0 times as stiff as stated: correct"));
    assert!(found(4.5, 1.0, 1500).unwrap().starts_with("the arm is at least 3.0 times as soft as stated: correct"));
    for times in [0.7, 1.0, 1.45] {
        assert_eq!(found(times, 3.0, 1500), None, "{times}");
    }
    assert_eq!(found(0.25, 3.0, 200), None, "the first press swings");
    assert_eq!(found(0.25, 0.1, 2000), None, "so small forces hardly bend the arm");
}

#[test]
fn a_stiff_arm_and_a_pad_without_newtons_say_nothing() {
    assert_eq!(Cell::new("", Unit::NEWTON).step(2.0, 0.01), None);
    assert_eq!(Cell::new(JOINT, Unit::RAW).step(2.0, 0.01), None);
}

#[test]
fn what_is_not_a_number_is_forgotten() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    assert!(cell.step(2.0, 0.004).is_some());
    assert_eq!(cell.step(f64::NAN, 0.004), None);
    assert_eq!(cell.step(2.0, f64::NAN), None);
    let [deflection, swing] = cell.step(2.0, 0.004).unwrap();
    assert!((deflection / (2.0 * COMPLIANCE) - 1.0).abs() < 0.02 && swing == 0.0);
}

#[test]
fn a_light_press_teaches_too_but_later() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    let mut factor =
        |_: u32| cell.step(0.3, COMPLIANCE * 0.3 * 0.5).map(|[deflection, _]| deflection / (0.3 * COMPLIANCE));
    // The contact begins with a lead that 0.3 N explain, so the factor stays.
    assert!((0..5000).filter_map(&mut factor).all(|factor| (factor - 1.0).abs() < 1e-6));
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    let mut press = |i: u32| {
        let force = 0.3 - 0.3 * libm::exp(-0.02 * f64::from(i));
        cell.step(force, 0.5 * COMPLIANCE * force).unwrap()[0] / (force * COMPLIANCE)
    };
    let found: Vec<f64> = (1..2501).map(&mut press).collect();
    let (early, late) = (found[50], found[2499]);
    assert!(early > 0.9 && late < 0.6, "after 0.2 s {early}, and at last {late}");
}

#[test]
fn a_press_on_a_stiff_arm_is_no_swing_although_a_soft_one_is_stated() {
    for (stiffer, most) in [(2.0, 0.0008), (4.0, 0.0012), (15.0, 0.0015)] {
        let mut cell = Cell::new(JOINT, Unit::NEWTON);
        // 4 N within 0.2 s would bend the stated spring by 7 mm.
        let swing = (0..200).map(|i| {
            let force = 4.0 * f64::from(i.min(50)) / 50.0;
            cell.step(force, COMPLIANCE * force / stiffer).unwrap()[1]
        });
        let largest = swing.fold(0.0_f64, |largest, swing| largest.max(swing.abs()));
        assert!(largest < most, "{stiffer} times as stiff: {largest} m");
    }
}

#[test]
fn what_was_learned_holds_in_another_posture() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    let force = |i: u32| 3.0 - 3.0 * libm::exp(-0.02 * f64::from(i));
    for i in 0..3000 {
        cell.step(force(i), 2.0 * COMPLIANCE * force(i));
    }
    cell.step(None, 0.0);
    cell.arm = 0.3;
    let [deflection, _] = cell.step(3.0, 0.0).unwrap();
    assert!((deflection / (3.0 * COMPLIANCE) - 0.5).abs() < 0.03, "twice a quarter of the compliance: {deflection}");
}

#[test]
fn an_arm_that_the_force_cannot_bend_gives_way_by_nothing() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    cell.arm = 0.0;
    let [deflection, swing] = cell.step(2.0, 0.0).unwrap();
    assert!(deflection.abs() < 1e-12 && swing == 0.0, "{deflection}, {swing}");
    cell.arm = ARM;
    let [deflection, _] = cell.step(2.0, 0.0).unwrap();
    // 2 N for a period against the 0.1 N² s that the stated compliance weighs.
    let learned = 0.1 / (0.1 + 2.0 * 2.0 * PERIOD);
    assert!((deflection / (2.0 * COMPLIANCE) / learned - 1.0).abs() < 0.01, "it still learns: {deflection}");
}

#[test]
fn between_two_forces_nothing_swings() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    let before = cell.step(2.0, 0.004).unwrap();
    // The lead moves on while the pad is silent.
    cell.rig.set("equilibrium", Joints([0.4].into()));
    cell.rig.step_ms(1e3 * PERIOD);
    assert_eq!(cell.rig.get::<Scalar>("swing"), Some(&before[1]));
}

#[test]
fn a_frame_of_garbage_is_not_learned_and_is_no_swing() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    let force = |i: u32| 3.0 - 3.0 * libm::exp(-0.02 * f64::from(i));
    let before = (0..500).map(|i| cell.step(force(i), COMPLIANCE * force(i)).unwrap()).last().unwrap();
    assert_eq!(cell.step(1000.0, COMPLIANCE * 3.0), None);
    let after = cell.step(3.0, COMPLIANCE * 3.0).unwrap();
    assert!((after[0] - before[0]).abs() < 1e-5 && (after[1] - before[1]).abs() < 1e-5, "{before:?}, then {after:?}");
}

#[test]
fn a_contact_that_begins_with_garbage_begins_again() {
    let mut cell = Cell::new(JOINT, Unit::NEWTON);
    let force = |i: u32| 3.0 - 3.0 * libm::exp(-0.02 * f64::from(i));
    cell.step(1000.0, 0.0);
    let said: Vec<_> = (1..500).map(|i| cell.step(force(i), 0.001 + COMPLIANCE * force(i))).collect();
    let silent = said.iter().take_while(|said| said.is_none()).count();
    assert!((0.1..0.12).contains(&(PERIOD * silent as f64)), "silent for {silent} samples");
    assert!(said[silent..].iter().all(Option::is_some));
    let [deflection, swing] = said.last().unwrap().unwrap();
    assert!((deflection - COMPLIANCE * 3.0).abs() < 1e-5 && swing.abs() < 1e-5, "{deflection} m and {swing} m");
}
