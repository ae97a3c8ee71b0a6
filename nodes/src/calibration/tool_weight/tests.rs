//! Tests with tools whose wrenches are computed by hand, and against a singular value decomposition of all unknowns.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;
use crate::motion::pose::pose_of;
use tactflow_runtime::random::Random;

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;

/// Roll, pitch and yaw of tips whose +z, +x, +y and -x are down.
const SIDES_DOWN: [[f64; 3]; 4] =
    [[2.0 * QUARTER, 0.0, 0.0], [0.0, QUARTER, 0.0], [-QUARTER, 0.0, 0.0], [0.0, -QUARTER, 0.3]];

fn tip(rpy: [f64; 3]) -> Rotation3<f64> {
    pose_of([0.0; 3], rpy).rotation
}

/// The wrench of a tool by 4 by 4 of the formula, without the code under test: the third row of the rotation is the axis
/// up of the base in the tip.
fn measured(mass: f64, centre: [f64; 3], offset: [f64; 6], tip: &Rotation3<f64>) -> [f64; 6] {
    let row = tip.matrix().row(2).into_owned();
    let force = [0, 1, 2].map(|i| -9.80665 * mass * row[i]);
    let [x, y, z] = centre;
    let torque = [y * force[2] - z * force[1], z * force[0] - x * force[2], x * force[1] - y * force[0]];
    std::array::from_fn(|i| offset[i] + if i < 3 { force[i] } else { torque[i - 3] })
}

fn postures(rpys: &[[f64; 3]], read: impl Fn(&Rotation3<f64>) -> [f64; 6]) -> Vec<WeightPosture> {
    let posture = |rpy: &[f64; 3]| WeightPosture { tip: tip(*rpy), wrench: read(&tip(*rpy)) };
    rpys.iter().map(posture).collect()
}

/// 1 kg, 10 cm in front of the tip and 2 cm along its x, with an offset: read by hand.
#[test]
fn four_sides_give_the_tool_by_hand() {
    let g = 9.80665;
    let [fx, fy, fz, tx, ty, tz] = [0.5, -1.0, 2.0, 0.01, 0.02, -0.03];
    let readings = [
        [fx, fy, fz + g, tx, ty - 0.02 * g, tz],
        [fx + g, fy, fz, tx, ty + 0.1 * g, tz],
        [fx, fy + g, fz, tx - 0.1 * g, ty, tz + 0.02 * g],
        [fx - g, fy, fz, tx, ty - 0.1 * g, tz],
    ];
    let postures: Vec<_> =
        SIDES_DOWN.iter().zip(readings).map(|(rpy, wrench)| WeightPosture { tip: tip(*rpy), wrench }).collect();
    let found = fit(&postures).unwrap();
    assert!((found.mass - 1.0).abs() < 1e-12, "{found:?}");
    assert!((found.centre - Vector3::new(0.02, 0.0, 0.1)).norm() < 1e-12, "{found:?}");
    let off = found.offset.iter().zip([fx, fy, fz, tx, ty, tz]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-12 && found.force_residual < 1e-12 && found.torque_residual < 1e-12, "{found:?}");
    assert!(found.is_significant());
}

#[test]
fn postures_that_are_few_or_alike_are_refused() {
    let read = |tip: &Rotation3<f64>| measured(1.0, [0.0, 0.0, 0.1], [0.0; 6], tip);
    assert_eq!(fit(&postures(&SIDES_DOWN[..3], read)), Err(WeightUnfit::Few));
    // A turn about the vertical changes nothing. Two sides in turn leave the centre open along the line between them.
    for rpys in [[0.0, 0.5, 1.0, 1.5].map(|yaw| [0.3, 0.2, yaw]), [0, 1, 0, 1].map(|i| SIDES_DOWN[i])] {
        let Err(WeightUnfit::Alike { spread }) = fit(&postures(&rpys, read)) else { panic!("{rpys:?}") };
        assert!(spread < 1e-6, "{spread}");
    }
    // Tilts by 10 degrees in all directions: the spread is sin(10°) / sqrt(2), by hand.
    let tilts = [[0.1745, 0.0, 0.0], [0.0, 0.1745, 0.0], [-0.1745, 0.0, 0.0], [0.0, -0.1745, 0.0]];
    let Err(WeightUnfit::Alike { spread }) = fit(&postures(&tilts, read)) else { panic!() };
    assert!((spread - 0.1736 / 2.0_f64.sqrt()).abs() < 1e-3, "{spread}");
}

#[test]
fn a_mass_below_the_noise_is_not_significant_and_a_negative_one_is() {
    let rpys = [SIDES_DOWN.as_slice(), &[[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]].concat();
    let mut random = Random::new(5, 0);
    let mut noisy = |mass: f64| {
        let mut postures = postures(&rpys, |tip| measured(mass, [0.0, 0.0, 0.05], [0.0; 6], tip));
        for posture in &mut postures {
            posture.wrench = posture.wrench.map(|value| value + 0.5 * random.normal());
        }
        fit(&postures).unwrap()
    };
    assert!(!noisy(0.02).is_significant());
    let negative = noisy(-1.0);
    assert!(negative.is_significant() && negative.mass < 0.0, "{negative:?}");
}

#[test]
fn the_sides_are_proposed_in_turn() {
    let mut done = Vec::new();
    for (rpy, side) in SIDES_DOWN.iter().zip(["+z", "+x", "+y", "-x"]) {
        assert_eq!(next_side(&done), side);
        let (found, angle) = side_down(&tip(*rpy));
        assert!(found == side && angle < 1e-6, "{found} {angle}");
        done.push(WeightPosture { tip: tip(*rpy), wrench: [0.0; 6] });
    }
    let alike = [WeightPosture { tip: tip([0.0, 1.45, 0.0]), wrench: [0.0; 6] }];
    assert_eq!(next_side(&alike), "+z", "the first side that is not near to +x");
}

/// The least squares of all ten unknowns at once by a QR decomposition.
fn by_qr(postures: &[WeightPosture]) -> DVector<f64> {
    let mut matrix = DMatrix::zeros(6 * postures.len(), 10);
    let mut right = DVector::zeros(6 * postures.len());
    for (i, WeightPosture { tip, wrench }) in postures.iter().enumerate() {
        let weight = tip.matrix().row(2).transpose() * -9.80665;
        for k in 0..3 {
            matrix[(6 * i + k, 0)] = weight[k];
            matrix[(6 * i + k, 1 + k)] = 1.0;
            matrix[(6 * i + 3 + k, 7 + k)] = 1.0;
            // k x w
            matrix[(6 * i + 3 + k, 4 + (k + 1) % 3)] = weight[(k + 2) % 3];
            matrix[(6 * i + 3 + k, 4 + (k + 2) % 3)] = -weight[(k + 1) % 3];
        }
        wrench.iter().enumerate().for_each(|(k, value)| right[6 * i + k] = *value);
    }
    let qr = matrix.qr();
    qr.r().solve_upper_triangular(&(qr.q().transpose() * right)).unwrap()
}

proptest! {
    #[test]
    fn any_tool_is_found_and_noise_is_fitted_as_by_qr(
        mass in 0.05..5.0_f64, centre in prop::array::uniform3(-0.3..0.3_f64),
        offset in prop::array::uniform6(-5.0..5.0_f64),
        rpys in prop::collection::vec(prop::array::uniform3(-3.0..3.0_f64), 4..9), seed in 0..1000_u64,
    ) {
        let exact = postures(&rpys, |tip| measured(mass, centre, offset, tip));
        let Ok(found) = fit(&exact) else { return Ok(()) };
        prop_assert!((found.mass - mass).abs() < 1e-9 && (found.centre - Vector3::from(centre)).norm() < 1e-8);
        prop_assert!(found.offset.iter().zip(offset).all(|(a, b)| (a - b).abs() < 1e-8));
        let mut random = Random::new(seed, 0);
        let noisy: Vec<_> = exact.iter().map(|posture| {
            WeightPosture { wrench: posture.wrench.map(|value| value + 0.1 * random.normal()), ..*posture }
        }).collect();
        let (found, wanted) = (fit(&noisy).unwrap(), by_qr(&noisy));
        prop_assert!((found.mass - wanted[0]).abs() < 1e-9, "{} {}", found.mass, wanted[0]);
        prop_assert!((found.centre * found.mass - wanted.fixed_rows::<3>(4)).norm() < 1e-9);
    }
}

/// The stated standard deviations are those of many fits with other noise.
#[test]
fn the_deviations_are_those_of_many_fits() {
    let rpys = [SIDES_DOWN.as_slice(), &[[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]].concat();
    let mut random = Random::new(7, 0);
    let mut squares = [0.0; 4];
    let mut stated = [0.0; 4];
    const RUNS: usize = 2000;
    for _ in 0..RUNS {
        let mut postures = postures(&rpys, |tip| measured(1.0, [0.02, -0.01, 0.08], [1.0; 6], tip));
        for WeightPosture { wrench, .. } in &mut postures {
            *wrench = std::array::from_fn(|i| wrench[i] + if i < 3 { 0.2 } else { 0.01 } * random.normal());
        }
        let found = fit(&postures).unwrap();
        let offs = [found.mass - 1.0, found.centre.x - 0.02, found.centre.y + 0.01, found.centre.z - 0.08];
        let deviations = found.centre_deviation;
        let deviations = [found.mass_deviation, deviations.x, deviations.y, deviations.z];
        for i in 0..4 {
            squares[i] += offs[i].powi(2) / RUNS as f64;
            stated[i] += deviations[i].powi(2) / RUNS as f64;
        }
    }
    for (square, stated) in squares.iter().zip(stated) {
        assert!((square / stated - 1.0).abs() < 0.1, "{square} {stated}");
    }
}
