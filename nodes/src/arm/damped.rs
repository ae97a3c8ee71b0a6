//! A damped inverse of a Jacobian that damps only what is near-singular, by one Cholesky factorisation of 6x6.
//!
//! With A = J J^T and one length eps for the damping,
//! x = J^T (A + eps² I) (A² + eps² A + eps⁴ I)^-1 t: each singular value s acts as
//! s (s² + eps²) / (s⁴ + eps² s² + eps⁴). That is 1/s up to eps⁴/s⁴ far above eps (0.4 % at s = 0.2 and eps = 0.05,
//! where plain damping s / (s² + eps²) costs 6 %), it falls to s/eps² at s = 0, and it is smooth in between: no
//! threshold, no switch, no decomposition.
//!
//! Numerics: the matrix that is factorised squares A, so its condition is that of J to the fourth power; eps⁴ below it
//! keeps it positive definite to rounding as long as eps is not below [`LEAST`].

/// Least damping that 64 bits carry.
pub const LEAST: f64 = 1e-3;

type Matrix = [[f64; 6]; 6];

/// Writes the joint velocities whose twist is `twist`, damped by `damping`, for a Jacobian of those columns.
pub fn solve(columns: &[[f64; 6]], twist: &[f64; 6], damping: f64, out: &mut [f64]) {
    let gram = gram(columns);
    let square = damping * damping;
    let mut system = times(&gram, &gram);
    for i in 0..6 {
        for j in 0..6 {
            system[i][j] += square * gram[i][j];
        }
        system[i][i] += square * square;
    }
    let y = cholesky_solve(system, *twist, 0.5 * square * square);
    let mut back = [0.0; 6];
    for i in 0..6 {
        for j in 0..6 {
            back[j] += gram[i][j] * y[i];
        }
    }
    for i in 0..6 {
        back[i] += square * y[i];
    }
    for (out, column) in out.iter_mut().zip(columns) {
        *out = dot(column, &back);
    }
}

/// J J^T, a row at a time so that a row stays in registers.
#[inline]
fn gram(columns: &[[f64; 6]]) -> Matrix {
    let mut gram = [[0.0; 6]; 6];
    for (i, out) in gram.iter_mut().enumerate() {
        let mut row = [0.0; 6];
        for column in columns {
            for j in 0..6 {
                row[j] += column[i] * column[j];
            }
        }
        *out = row;
    }
    gram
}

#[inline]
fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let mut out = [[0.0; 6]; 6];
    for (factors, out) in a.iter().zip(&mut out) {
        let mut row = [0.0; 6];
        for (factor, other) in factors.iter().zip(b) {
            for j in 0..6 {
                row[j] += factor * other[j];
            }
        }
        *out = row;
    }
    out
}

/// Solves M x = b for a symmetric M whose pivots are known to be at least `least`, but for rounding: Cholesky without
/// roots, M = L D L^T, as six roots cost more than the rest.
#[inline]
fn cholesky_solve(mut m: Matrix, mut b: [f64; 6], least: f64) -> [f64; 6] {
    let mut inverse = [0.0; 6];
    for k in 0..6 {
        inverse[k] = 1.0 / m[k][k].max(least);
        let pivots = m[k];
        for i in k + 1..6 {
            let factor = pivots[i] * inverse[k];
            for j in k + 1..6 {
                m[i][j] -= factor * pivots[j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..6).rev() {
        for j in k + 1..6 {
            b[k] -= m[k][j] * b[j];
        }
        b[k] *= inverse[k];
    }
    b
}

#[inline]
fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, Vector6};
    use proptest::prelude::*;

    use super::*;

    /// The closed form, singular value by singular value: with l = s² an eigenvalue of J^T J it is
    /// (l + eps²) / (l² + eps² l + eps⁴) on J^T t. (nalgebra's own SVD is off by percents on some singular matrices.)
    fn by_eigenvalues(columns: &[[f64; 6]], twist: &[f64; 6], damping: f64) -> DVector<f64> {
        let jacobian = DMatrix::from_fn(6, columns.len(), |i, j| columns[j][i]);
        let eigen = (jacobian.transpose() * &jacobian).symmetric_eigen();
        let square = damping * damping;
        let gain = eigen.eigenvalues.map(|l| (l + square) / (l * l + square * l + square * square));
        let pulled = jacobian.transpose() * Vector6::from(*twist);
        &eigen.eigenvectors * (eigen.eigenvectors.transpose() * pulled).component_mul(&gain)
    }

    /// Columns of which some are sums of others, so that the Jacobian is exactly singular.
    fn any_columns() -> impl Strategy<Value = Vec<[f64; 6]>> {
        let columns = prop::collection::vec(prop::array::uniform6(-1.0..1.0f64), 1..10);
        (columns, 0..4usize).prop_map(|(mut columns, repeats)| {
            for i in 0..repeats.min(columns.len() - 1) {
                columns[i + 1] = columns[i].map(|x| -x);
            }
            columns
        })
    }

    proptest! {
        #[test]
        fn it_is_the_closed_form_on_every_singular_value(
            columns in any_columns(), twist in prop::array::uniform6(-1.0..1.0f64), damping in 0.01..0.3f64,
        ) {
            let mut got = vec![0.0; columns.len()];
            solve(&columns, &twist, damping, &mut got);
            let wanted = by_eigenvalues(&columns, &twist, damping);
            let off = (DVector::from_vec(got) - &wanted).norm();
            // What rounding costs at the condition of the matrix that is factorised: 1e-10 for an arm at the default.
            let largest: f64 = columns.iter().flatten().map(|x| x * x).sum();
            let condition = 1.0 + (largest / (damping * damping)).powi(2);
            prop_assert!(off <= 4.0 * f64::EPSILON * condition * (1.0 + wanted.norm()), "off by {}", off);
        }

        #[test]
        fn the_least_damping_is_still_bounded(
            columns in any_columns(), twist in prop::array::uniform6(-1.0..1.0f64),
        ) {
            let mut got = vec![0.0; columns.len()];
            solve(&columns, &twist, LEAST, &mut got);
            // 2/3 / eps is the maximum over s of the closed form, at s = eps; the rest is rounding.
            let bound = 0.67 * Vector6::from(twist).norm() / LEAST;
            prop_assert!(DVector::from_vec(got).norm() <= bound);
        }
    }

    #[test]
    fn far_above_the_damping_it_costs_less_than_half_a_percent() {
        let columns: Vec<[f64; 6]> = (0..6).map(|i| std::array::from_fn(|j| if i == j { 0.2 } else { 0.0 })).collect();
        let mut got = [0.0; 6];
        solve(&columns, &[1.0; 6], 0.05, &mut got);
        assert!(got.iter().all(|x| (x * 0.2 - 1.0).abs() < 0.004), "{got:?}");
    }

    #[test]
    fn nothing_comes_of_a_jacobian_of_zeros() {
        let mut got = [1.0; 7];
        solve(&[[0.0; 6]; 7], &[1.0; 6], 0.05, &mut got);
        assert_eq!(got, [0.0; 7]);
    }
}
