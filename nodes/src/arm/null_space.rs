//! The exact null space of a 6xn Jacobian, n > 6: joint motion that does not move the sensor.
//!
//! J^T = Q R is computed by Householder reflections. The last n - 6 columns of Q, Q_2, satisfy J Q_2 = 0 for any rank
//! of J. The projector Q_2 Q_2^T is applied as reflections and never formed. Unlike a damped projector, it moves the
//! sensor only by rounding errors.

/// Working memory for one joint: the six entries of its row of J^T, its motion, and padding to whole vector lanes.
pub type Row = [f64; 8];

/// Removes from `motion` [rad/s] the part that moves the sensor.
///
/// `columns` are the columns of the Jacobian, and `rows` is working memory; both have one entry per joint. With 6
/// joints or fewer the result is zero.
pub fn project(columns: &[[f64; 6]], rows: &mut [Row], motion: &mut [f64]) {
    if columns.len() <= 6 {
        motion.fill(0.0);
        return;
    }
    for ((row, [a, b, c, d, e, f]), motion) in rows.iter_mut().zip(columns).zip(&*motion) {
        *row = [*a, *b, *c, *d, *e, *f, *motion, 0.0];
    }
    let scales: [f64; 6] = std::array::from_fn(|k| eliminate(&mut rows[k..], k));
    motion[..6].fill(0.0);
    for (motion, row) in motion.iter_mut().zip(&*rows).skip(6) {
        *motion = row[6];
    }
    for k in (0..6).rev() {
        reflect(&rows[k..], k, scales[k], &mut motion[k..]);
    }
}

/// Makes step `k` of the factorisation, on the rows from `k` on: reflects all columns after column `k` and stores the
/// reflector v in column `k`. Returns its scale 2/(v^T v).
#[inline]
fn eliminate(rows: &mut [Row], k: usize) -> f64 {
    let mut along = [0.0; 8];
    for row in &*rows {
        for j in 0..8 {
            along[j] += row[k] * row[j];
        }
    }
    // v is the column with its norm added to the first entry, so v^T v = 2 norm (norm + |first|).
    let norm = along[k].sqrt();
    if norm == 0.0 {
        return 0.0;
    }
    let first = rows[0];
    let added = if first[k] < 0.0 { -norm } else { norm };
    let scale = 1.0 / (norm * (norm + first[k].abs()));
    for j in 0..8 {
        along[j] = scale * (along[j] + added * first[j]);
    }
    // The columns before `k` hold their own reflectors.
    along[..k].fill(0.0);
    rows[0][k] += added;
    for row in rows {
        let by = row[k];
        for j in 0..8 {
            row[j] -= by * along[j];
        }
        row[k] = by;
    }
    scale
}

/// Reflects `motion` by the reflector in column `k`.
#[inline]
fn reflect(rows: &[Row], k: usize, scale: f64, motion: &mut [f64]) {
    let along: f64 = rows.iter().zip(&*motion).map(|(row, x)| row[k] * x).sum();
    for (row, x) in rows.iter().zip(motion) {
        *x -= scale * along * row[k];
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    fn projected(columns: &[[f64; 6]], motion: &[f64]) -> DVector<f64> {
        let mut out = motion.to_vec();
        project(columns, &mut vec![[0.0; 8]; columns.len()], &mut out);
        DVector::from_vec(out)
    }

    /// Returns the matrix of the projector.
    fn projector(columns: &[[f64; 6]]) -> DMatrix<f64> {
        let joints = columns.len();
        let units = DMatrix::<f64>::identity(joints, joints);
        let images: Vec<_> =
            units.column_iter().map(|unit| projected(columns, unit.clone_owned().as_slice())).collect();
        DMatrix::from_columns(&images)
    }

    proptest! {
        // An orthogonal projector of rank n - 6 whose range does not move the sensor: with six independent rows, that
        // is the projector onto the null space.
        #[test]
        fn the_projected_motion_does_not_move_the_sensor(
            columns in prop::collection::vec(prop::array::uniform6(-1.0..1.0f64), 7..10),
            is_singular in any::<bool>(),
        ) {
            let mut columns = columns;
            if is_singular {
                for column in &mut columns {
                    column[5] = column[0] - column[1];
                }
            }
            let joints = columns.len();
            let jacobian = DMatrix::from_fn(6, joints, |i, j| columns[j][i]);
            let projector = projector(&columns);
            prop_assert!((&jacobian * &projector).norm() < 1e-12);
            prop_assert!((&projector - projector.transpose()).norm() < 1e-12);
            prop_assert!((&projector * &projector - &projector).norm() < 1e-12);
            prop_assert!((projector.trace() - (joints - 6) as f64).abs() < 1e-12);
        }
    }

    #[test]
    fn a_zero_jacobian_and_an_arm_without_a_null_space() {
        let still = projected(&[[0.0; 6]; 8], &[1.0; 8]);
        assert_eq!(still.as_slice(), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
        assert_eq!(projected(&[[0.5; 6]; 6], &[1.0; 6]), DVector::zeros(6));
    }
}
