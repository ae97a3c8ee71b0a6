//! The slope against closed forms, and when it is valid.

use nalgebra::{IsometryMatrix3, Matrix2, Rotation3, Translation3, Vector2, Vector3};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::random::Random;
use tactflow_runtime::signal::{
    Freshness, JacobianShape, Joint, JointsShape, PoseShape, ScalarShape, Shape, Twist, Unit,
};

use super::*;

const NOMINAL: &str = "nominal = 10.0\nmemory_s = 0.5\nmin_travel_m = 0.0003";

fn built(params: &str) -> Result<NodeRig, Mistakes> {
    let value = ScalarShape::of(Unit::NEWTON.per_tactel()).into();
    NodeRig::new::<StiffnessEstimate>(params, &[("value", value), ("pose", PoseShape::default().into())])
}

/// The pose of a sensor that is turned and that has moved along its z [m].
fn pose(z: f64) -> Pose {
    let turn = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
    let place = Vector3::new(0.5, -0.2, 0.3) + turn * Vector3::new(0.001, 0.002, z);
    Pose(IsometryMatrix3::from_parts(Translation3::from(place), turn))
}

fn show(rig: &mut NodeRig, z: f64, value: f64) -> (Option<f64>, bool) {
    rig.set("pose", pose(z));
    rig.set("value", value);
    rig.step_ms(4.0);
    (rig.get::<Scalar>("ratio").copied(), *rig.get::<Flag>("valid").unwrap())
}

/// The travel of a test signal of 2 Hz [m].
fn sine(i: u32) -> f64 {
    0.001 * libm::sin(0.004 * 2.0 * std::f64::consts::TAU * f64::from(i))
}

#[test]
fn a_spring_has_its_stiffness_wherever_it_begins() {
    for (stiffness, offset) in [(10.0, 0.0), (50.0, 0.3), (2.0, -7.0)] {
        let mut rig = built(NOMINAL).unwrap();
        let shown = (0..300).map(|i| show(&mut rig, 0.02 + sine(i), offset + stiffness * sine(i)));
        let (ratio, is_valid) = shown.last().unwrap();
        assert!(is_valid && (ratio.unwrap() - 0.1 * stiffness).abs() < 1e-9, "{stiffness}: {ratio:?}");
    }
}

proptest! {
    #[test]
    fn it_is_the_least_squares_line_with_decaying_weights(seed in 0..1000u64, count in 20..200usize) {
        let mut random = Random::new(seed, 0);
        let samples: Vec<[f64; 2]> = (0..count)
            .map(|_| [random.uniform(-1.0, 1.0), random.uniform(-0.3, 0.3)])
            .map(|[z, noise]| [0.002 * z, 0.02 * z + 0.02 * noise + 0.4])
            .collect();
        let params = "nominal = 10.0\nmemory_s = 0.1\nmin_travel_m = 1e-9\nmin_correlation = 0.0";
        let mut rig = built(params).unwrap();
        let ratio = samples.iter().map(|[z, value]| show(&mut rig, *z, *value)).last().unwrap().0;
        // The normal equations of value = a + b z, in metres and in millimetres.
        let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
        for (i, [z, value]) in samples.iter().enumerate() {
            let weight = libm::exp(-0.04 * (count - 1 - i) as f64);
            let row = Vector2::new(1.0, 1e3 * z);
            normal += row * row.transpose() * weight;
            right += row * (*value * weight);
        }
        let slope = normal.lu().solve(&right).unwrap()[1] * 1e3;
        prop_assert!((ratio.unwrap() - slope / 10.0).abs() < 1e-6, "{:?} of {}", ratio, slope / 10.0);
    }
}

#[test]
fn it_is_valid_only_with_enough_motion_that_the_feature_follows() {
    let mut random = Random::new(5, 0);
    let mut noise = move |size: f64| random.uniform(-size, size);
    let mut rig = built(NOMINAL).unwrap();
    assert!((0..200).all(|i| show(&mut rig, 0.1 * sine(i), 1.0 * sine(i)) == (None, false)), "hardly any motion");
    let found: Vec<_> = (0..300).map(|i| show(&mut rig, sine(i), 10.0 * sine(i) + noise(0.001))).collect();
    let (ratio, is_valid) = found[299];
    assert!(is_valid && (ratio.unwrap() - 1.0).abs() < 0.02, "{ratio:?}");
    let kept: Vec<_> = (0..2000).map(|_| show(&mut rig, 0.0, noise(0.001))).collect();
    let (last, is_valid) = kept[1999];
    assert!(!is_valid && (last.unwrap() - 1.0).abs() < 0.3, "it stays at the last valid one: {last:?}");
    for unrelated in [|_: f64, n: f64| n, |z: f64, _: f64| -10.0 * z] {
        let mut rig = built(NOMINAL).unwrap();
        let shown = (0..300).map(|i| show(&mut rig, sine(i), unrelated(sine(i), noise(0.05))));
        assert_eq!(shown.last(), Some((None, false)));
    }
}

#[test]
fn another_object_is_found_within_the_memory() {
    let mut rig = built(NOMINAL).unwrap();
    (0..500).for_each(|i| {
        show(&mut rig, sine(i), 10.0 * sine(i));
    });
    let stiffer = (500..1250).map(|i| show(&mut rig, sine(i), 50.0 * sine(i))).last().unwrap();
    assert!((stiffer.0.unwrap() - 5.0).abs() < 0.05, "{stiffer:?}");
}

#[test]
fn what_is_not_a_number_does_not_stay_and_a_long_absence_begins_afresh() {
    let mut rig = built(NOMINAL).unwrap();
    (0..300).for_each(|i| {
        show(&mut rig, sine(i), 10.0 * sine(i));
    });
    let (ratio, is_valid) = show(&mut rig, 0.0, f64::NAN);
    assert!(!is_valid && (ratio.unwrap() - 1.0).abs() < 1e-9);
    assert!(!show(&mut rig, f64::NAN, 0.0).1);
    let found = (0..300).map(|i| show(&mut rig, sine(i), 20.0 * sine(i))).last().unwrap();
    assert!((found.0.unwrap() - 2.0).abs() < 1e-9 && found.1);
    rig.lose("value");
    rig.step_ms(30.0);
    assert_eq!(rig.freshness("ratio"), Freshness::Lost);
    rig.step();
    assert_eq!(show(&mut rig, 0.0, 0.0), (None, false));
}

#[test]
fn wrong_parameters_are_refused() {
    for (bad, place) in [
        ("", "missing-key: `the node`"),
        ("nominal = 0", "bad-value: `0`"),
        ("nominal = 1\nmin_correlation = 1.5", "bad-value: `1.5`"),
    ] {
        assert_eq!(places(bad, &built(bad)), [place], "{bad}");
    }
}

/// Two joints: one moves the sensor along its z by 1 m per unit, and one moves it aside.
const TWO: [&str; 2] = ["along", "aside"];

fn joints() -> JointsShape {
    JointsShape { joints: TWO.map(|name| Joint { name: name.into(), ..Joint::default() }).into(), unit: Unit::RADIAN }
}

/// An estimate of the commanded travel.
fn commanding(params: &str) -> NodeRig {
    let wires: [(&str, Shape); 4] = [
        ("value", ScalarShape::of(Unit::NEWTON.per_tactel()).into()),
        ("pose", PoseShape::default().into()),
        ("jacobian", JacobianShape(joints()).into()),
        ("equilibrium", joints().into()),
    ];
    NodeRig::new::<StiffnessEstimate>(params, &wires).unwrap()
}

/// Shows a value while the equilibrium is `z` along the normal, of an arm that gives way by half of it.
fn command(rig: &mut NodeRig, z: f64, value: f64) -> (Option<f64>, bool) {
    follow(rig, z, 0.5 * z, value)
}

/// Shows a value while the equilibrium is `z` along the normal, and the sensor has moved by `measured`.
fn follow(rig: &mut NodeRig, z: f64, measured: f64, value: f64) -> (Option<f64>, bool) {
    let at = pose(0.0);
    let columns = [Vector3::z(), Vector3::x()].map(|axis| {
        let linear = at.0.rotation * axis;
        Twist::new(linear, Vector3::zeros())
    });
    rig.set("jacobian", Jacobian(columns.into()));
    rig.set("equilibrium", Joints([0.3 + z, 0.7 - 5.0 * z].into()));
    show(rig, measured, value)
}

#[test]
fn an_arm_that_is_pushed_or_swings_teaches_nothing() {
    // The part of the commanded travel that the sensor moves.
    for (part, is_valid) in
        [(0.2, true), (1.0, true), (1.15, true), (1.3, false), (8.0, false), (0.0, false), (-0.5, false)]
    {
        let mut rig = commanding(&format!("{NOMINAL}\nlag_ms = 40"));
        let mut value = 0.0;
        let mut last = 0.0;
        let found = (0..300).map(|i| {
            // As the travel, the value is late.
            value += -libm::expm1(-4.0 / 40.0) * (20.0 * sine(i) - value);
            last = part * sine(i);
            follow(&mut rig, sine(i), last, value)
        });
        let found = found.last().unwrap();
        assert_eq!(found.1, is_valid, "{part} of the travel: {found:?}");
        assert_eq!(found.0.is_some(), is_valid, "{part} of the travel: {found:?}");
    }
}

#[test]
fn an_object_is_met_by_a_sensor_that_already_moves() {
    // A ramp, and a feature that follows it as a low-pass does, which has run for long before the contact.
    let mut rig = commanding(&format!("{NOMINAL}\nlag_ms = 70"));
    let ramp = |i: u32| 0.008 * 0.004 * f64::from(i);
    let found = (0..40).map(|i| command(&mut rig, ramp(i), 10.0 * ramp(i))).last().unwrap();
    assert!((found.0.unwrap() - 1.0).abs() < 1e-3, "{found:?}");
}

#[test]
fn the_commanded_travel_is_that_of_the_equilibrium_along_the_normal() {
    let mut rig = commanding(NOMINAL);
    let found = (0..300).map(|i| command(&mut rig, sine(i), 0.4 + 20.0 * sine(i))).last().unwrap();
    assert!(found.1 && (found.0.unwrap() - 2.0).abs() < 1e-9, "{found:?}");
    rig.lose("equilibrium");
    let (ratio, is_valid) = show(&mut rig, 0.0, 5.0);
    assert!(!is_valid && (ratio.unwrap() - 2.0).abs() < 1e-9, "what was commanded is not known: {ratio:?}");
    assert!(!command(&mut rig, sine(1), 0.0).1, "the first sample begins afresh");
}

#[test]
fn a_feature_that_lags_has_its_whole_slope() {
    // The feature follows the travel as a low-pass filter with 80 ms does.
    let slope = |lag_ms: f64| {
        let mut rig = commanding(&format!("{NOMINAL}\nmin_correlation = 0.0\nlag_ms = {lag_ms}"));
        let (mut value, mut found) = (0.0, None);
        for i in 0..600 {
            value += -libm::expm1(-4.0 / 80.0) * (10.0 * sine(i) - value);
            found = command(&mut rig, sine(i), value).0;
        }
        found
    };
    // The sine begins suddenly, but the travel as if the sensor had moved before.
    assert!((slope(80.0).unwrap() - 1.0).abs() < 2e-3, "{:?}", slope(80.0));
    // Of a low-pass at 2 Hz, the part in phase is 1 / (1 + (w T)²).
    let in_phase = 1.0 / (1.0 + (2.0 * std::f64::consts::TAU * 0.08_f64).powi(2));
    assert!((slope(0.0).unwrap() - in_phase).abs() < 0.03, "without the lag it looks soft: {:?}", slope(0.0));
}

#[test]
fn what_the_commanded_travel_needs_is_named() {
    let value = ScalarShape::of(Unit::NEWTON.per_tactel()).into();
    let wires = [("value", value), ("pose", PoseShape::default().into()), ("equilibrium", joints().into())];
    let made = NodeRig::new::<StiffnessEstimate>(NOMINAL, &wires);
    assert_eq!(places(NOMINAL, &made), ["missing-input: `the node`"]);
    let value = ScalarShape::of(Unit::NEWTON.per_tactel()).into();
    let deflection = ScalarShape::of(Unit::METRE).into();
    let wires = [("value", value), ("pose", PoseShape::default().into()), ("deflection", deflection)];
    let made = NodeRig::new::<StiffnessEstimate>(NOMINAL, &wires);
    assert_eq!(places(NOMINAL, &made), ["missing-input: `the node`"]);
}

#[test]
fn an_arm_that_swings_does_not_hide_what_its_contact_answers() {
    // A contact of 20 N per tactel and metre; the arm gives way by as much as the sensor moves.
    let params = format!("{NOMINAL}\narm_lag_ms = 50");
    let wires: [(&str, Shape); 5] = [
        ("value", ScalarShape::of(Unit::NEWTON.per_tactel()).into()),
        ("pose", PoseShape::default().into()),
        ("jacobian", JacobianShape(joints()).into()),
        ("equilibrium", joints().into()),
        ("deflection", ScalarShape::of(Unit::METRE).into()),
    ];
    let found = |knows_the_spring: bool| {
        let mut rig = NodeRig::new::<StiffnessEstimate>(&params, &wires).unwrap();
        let swing = |i: u32| 0.0008 * libm::sin(0.09 * f64::from(i));
        (0..18)
            .map(|i| {
                let commanded = 1e-4 * f64::from(i);
                // The sensor is farther than half of the command by its swing.
                let place = 0.5 * commanded + swing(i);
                if knows_the_spring {
                    rig.set("deflection", place);
                }
                follow(&mut rig, commanded, place, 20.0 * place).0
            })
            .last()
            .unwrap()
    };
    assert!((found(true).unwrap() - 1.0).abs() < 1e-6, "{:?}", found(true));
    assert!(found(false).unwrap() > 1.1, "{:?}", found(false));
}
