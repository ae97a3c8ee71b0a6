//! The inverse against the eigenvectors of nalgebra, and against what it promises near a singularity.

use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use proptest::prelude::*;

use super::*;

/// Returns the velocities for the twist as it is, without a correction of the push: with l = s² an eigenvalue of J J^T,
/// the closed form of the module. (The SVD of nalgebra is off by percents on some singular matrices.)
fn by_eigenvectors(columns: &[[f64; 6]], twist: &Vector6<f64>, damping: f64) -> DVector<f64> {
    let jacobian = DMatrix::from_fn(6, columns.len(), |i, j| columns[j][i]);
    let eigen = of_gram(columns).symmetric_eigen();
    let square = damping * damping;
    let gain = eigen.eigenvalues.map(|l| if l < square { (2.0 - l / square) / square } else { 1.0 / l });
    let along = eigen.eigenvectors.transpose() * twist;
    jacobian.transpose() * eigen.eigenvectors * along.component_mul(&gain)
}

fn of_gram(columns: &[[f64; 6]]) -> Matrix6<f64> {
    columns.iter().map(|column| Vector6::from(*column)).map(|column| column * column.transpose()).sum()
}

fn sigma(columns: &[[f64; 6]]) -> f64 {
    of_gram(columns).symmetric_eigenvalues().min().max(0.0).sqrt()
}

fn solved(columns: &[[f64; 6]], twist: &Vector6<f64>, damping: f64) -> (DVector<f64>, Nearness) {
    let mut got = vec![f64::NAN; columns.len()];
    let nearness = solve(columns, &(*twist).into(), damping, &mut got);
    (DVector::from_vec(got), nearness)
}

fn moved(columns: &[[f64; 6]], velocity: &DVector<f64>) -> Vector6<f64> {
    columns.iter().zip(velocity.iter()).map(|(column, v)| Vector6::from(*column) * *v).sum()
}

/// Columns of which some are the negative of others, so that the Jacobian is exactly singular.
fn any_columns() -> impl Strategy<Value = Vec<[f64; 6]>> {
    let columns = prop::collection::vec(prop::array::uniform6(-1.0..1.0f64), 1..10);
    (columns, 0..4usize).prop_map(|(mut columns, repeats)| {
        for i in 0..repeats.min(columns.len() - 1) {
            columns[i + 1] = columns[i].map(|x| -x);
        }
        columns
    })
}

/// Seven columns whose smallest singular value is between 0 and the damping, in any direction.
fn nearly_singular() -> impl Strategy<Value = Vec<[f64; 6]>> {
    let columns = prop::array::uniform7(prop::array::uniform6(-1.0..1.0f64));
    (columns, prop::array::uniform6(-1.0..1.0f64), 0.0..1.0f64).prop_filter_map(
        "a direction",
        |(columns, lost, part)| {
            let lost = Vector6::from(lost).try_normalize(0.1)?;
            let flat = |column: Vector6<f64>| column - lost * (lost.dot(&column) * (1.0 - 0.05 * part));
            Some(columns.map(|column| flat(Vector6::from(column)).into()).to_vec())
        },
    )
}

fn any_twist() -> impl Strategy<Value = Vector6<f64>> {
    prop::array::uniform6(-1.0..1.0f64).prop_map(Vector6::from)
}

proptest! {
    #[test]
    fn it_is_the_pseudo_inverse_from_the_damping_on(columns in any_columns(), twist in any_twist()) {
        let least = sigma(&columns);
        prop_assume!(least > 0.02);
        let (got, nearness) = solved(&columns, &twist, 0.99 * least);
        let jacobian = DMatrix::from_fn(6, columns.len(), |i, j| columns[j][i]);
        let wanted = jacobian.clone().pseudo_inverse(1e-9).unwrap() * twist;
        prop_assert!((&got - &wanted).norm() < 1e-10 * (1.0 + wanted.norm()), "off by {}", (&got - &wanted).norm());
        prop_assert_eq!(nearness.damping, 0.0);
        prop_assert!(nearness.sigma > 0.78 * least && nearness.sigma < (1.0 + 1e-9) * least, "{} of {}", nearness.sigma, least);
    }

    #[test]
    fn the_result_is_the_closed_form_of_a_corrected_push(
        columns in any_columns(), twist in any_twist(), damping in 0.01..0.3f64,
    ) {
        let (got, nearness) = solved(&columns, &twist, damping);
        // The correction asks for another push and nothing else, so one number explains all velocities.
        let plain = by_eigenvectors(&columns, &twist, damping);
        let per_push = by_eigenvectors(&columns, &Vector6::ith(PUSH, 1.0), damping);
        let more = if per_push.norm() > 0.0 { (&got - &plain).dot(&per_push) / per_push.norm_squared() } else { 0.0 };
        let off = (&got - &plain - &per_push * more).norm();
        // Rounding moves a small eigenvalue by 1e-16 of the largest one.
        let largest: f64 = columns.iter().flatten().map(|x| x * x).sum();
        let rounding = 64.0 * f64::EPSILON * (1.0 + largest / (damping * damping)) * (1.0 + more.abs() + twist.norm());
        prop_assert!(off <= rounding * (1.0 + 1.0 / damping), "off by {} with {}", off, more);
        if sigma(&columns) < damping {
            prop_assert!((nearness.sigma - sigma(&columns)).abs() < 1e-7);
            let share = 1.0 - (nearness.sigma / damping).powi(2);
            prop_assert!((nearness.damping - share * share).abs() < 1e-9);
        }
    }

    #[test]
    fn a_motion_of_which_little_is_lost_never_becomes_a_push(
        columns in nearly_singular(), twist in any_twist(), is_slide in any::<bool>(),
    ) {
        let mut twist = twist;
        if is_slide {
            twist[PUSH] = 0.0;
        }
        // A damping that takes half of the weakest direction: (1 - s²/eps²)² = 1/2.
        let damping = sigma(&columns) / (1.0 - 0.5f64.sqrt()).sqrt();
        prop_assume!(damping > MIN_DAMPING);
        let (got, nearness) = solved(&columns, &twist, damping);
        prop_assert!((nearness.damping - 0.5).abs() < 1e-6, "{:?}", nearness);
        let (push, wanted) = (moved(&columns, &got)[PUSH], twist[PUSH]);
        prop_assert!(push <= wanted.max(0.0) + 1e-9, "{} instead of {}", push, wanted);
        prop_assert!(push >= wanted.min(0.0) - 1e-9, "{} instead of {}", push, wanted);
    }

    #[test]
    fn the_velocities_are_bounded(columns in any_columns(), twist in any_twist(), damping in MIN_DAMPING..0.3f64) {
        let (got, _) = solved(&columns, &twist, damping);
        // 1.09/eps for the twist, and as much again for twice the push at most.
        prop_assert!(got.norm() <= 1.09 * 3.0 * twist.norm() / damping, "{} for {}", got.norm(), twist.norm());
    }

    #[test]
    fn a_small_change_of_the_jacobian_changes_the_velocities_little(
        columns in nearly_singular(), change in prop::array::uniform7(prop::array::uniform6(-1.0..1.0f64)),
        twist in any_twist(),
    ) {
        let near: Vec<[f64; 6]> = columns.iter().zip(change).map(|(column, change)| {
            std::array::from_fn(|i| column[i] + 1e-7 * change[i])
        }).collect();
        let (one, other) = (solved(&columns, &twist, 0.05).0, solved(&near, &twist, 0.05).0);
        // The gain changes by 2/eps² for each unit of the Jacobian, and the corrected push by three times as much.
        let steepest = 2.0 * 4.0 / (0.05 * 0.05);
        prop_assert!((&one - &other).norm() <= steepest * 1e-7 * 7.0 * twist.norm(), "{}", (one - other).norm());
    }

    #[test]
    fn the_eigenvectors_are_those_of_nalgebra(columns in any_columns()) {
        let (eigenvalues, directions) = eigen(gram(&columns));
        let wanted = of_gram(&columns);
        let size = 1.0 + wanted.norm();
        let mut sorted = eigenvalues;
        sorted.sort_by(f64::total_cmp);
        let mut of_nalgebra: Vec<f64> = wanted.symmetric_eigenvalues().iter().copied().collect();
        of_nalgebra.sort_by(f64::total_cmp);
        for (got, wanted) in sorted.iter().zip(of_nalgebra) {
            prop_assert!((got - wanted).abs() < 1e-13 * size, "{} is {}", got, wanted);
        }
        for (value, direction) in eigenvalues.iter().zip(directions) {
            let direction = Vector6::from(direction);
            prop_assert!((wanted * direction - direction * *value).norm() < 1e-13 * size);
            prop_assert!((direction.norm() - 1.0).abs() < 1e-13);
        }
    }
}

/// A diagonal Jacobian: each singular value is an entry, and each direction an axis.
fn diagonal(values: [f64; 6]) -> Vec<[f64; 6]> {
    (0..6).map(|i| std::array::from_fn(|j| if i == j { values[i] } else { 0.0 })).collect()
}

#[test]
fn only_the_lost_direction_is_damped() {
    let (got, nearness) = solved(&diagonal([0.2, 0.2, 0.2, 0.2, 0.2, 0.025]), &Vector6::repeat(1.0), 0.05);
    // A quarter of the square of the damping: the share is 1 - (3/4)².
    let wanted = [5.0, 5.0, 5.0, 5.0, 5.0, 0.4375 / 0.025];
    assert!(got.iter().zip(wanted).all(|(got, wanted)| (got - wanted).abs() < 1e-11), "{got}");
    assert!((nearness.sigma - 0.025).abs() < 1e-15 && (nearness.damping - 0.5625).abs() < 1e-12, "{nearness:?}");
}

#[test]
fn the_bound_of_the_smallest_singular_value_is_exact_for_equal_and_for_lone_ones() {
    let cases = [
        ([0.3; 6], 0.3, 1.0),
        ([1e4, 1e4, 0.3, 1e4, 1e4, 1e4], 0.3, 1.0),
        ([0.3, 0.3, 0.3, 1e4, 1e4, 1e4], 0.3, 0.786),
    ];
    for (values, least, part) in cases {
        let got = solved(&diagonal(values), &Vector6::zeros(), 0.05).1.sigma;
        // 6 / (3 + sqrt(45)) of the square for three equal ones.
        assert!((got / least - part).abs() < 1e-3, "{values:?}: {got}");
    }
}

#[test]
fn a_slide_of_which_little_is_lost_does_not_push() {
    // The plane of x and z has a weak direction along (1, 0, -1): what is lost along it would push.
    let (half, weak) = (0.5f64.sqrt(), 0.045);
    let mut columns = diagonal([0.3; 6]);
    columns[0] = [0.3 * half, 0.0, 0.3 * half, 0.0, 0.0, 0.0];
    columns[2] = [weak * half, 0.0, -weak * half, 0.0, 0.0, 0.0];
    let slide = Vector6::ith(0, 0.1);
    let plain = by_eigenvectors(&columns, &slide, 0.05);
    let lost = (1.0 - 0.9f64.powi(2)).powi(2);
    assert!((moved(&columns, &plain)[PUSH] - 0.05 * lost).abs() < 1e-12, "the oracle pushes");
    let (got, _) = solved(&columns, &slide, 0.05);
    assert!(moved(&columns, &got)[PUSH].abs() < 1e-15, "{got}");
}

#[test]
fn a_zero_jacobian_gives_zero_velocities() {
    let (got, nearness) = solved(&[[0.0; 6]; 7], &Vector6::repeat(1.0), 0.05);
    assert_eq!(got, DVector::zeros(7));
    assert_eq!(nearness, Nearness { sigma: 0.0, damping: 1.0 });
}
