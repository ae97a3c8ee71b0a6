//! An inverse of a Jacobian that is exact far from singularities, and damps only the directions that are nearly lost.
//!
//! With A = J J^T = U diag(s²) U^T, it returns x = J^T U diag(h(s²)) U^T t, where h(s²) = 1/s² from the damping eps on
//! and (2 - s²/eps²)/eps² below. So a singular value s is inverted exactly, to 1/s, from eps on. Below eps its inverse
//! falls to 0 with s, and is at most 1.09/eps. The share f = s² h = 1 - (1 - s²/eps²)² of the direction remains. h and f
//! have continuous derivatives, so the result has no step where the damping begins.
//!
//! What is lost can turn a motion: the part of a slide that remains can point into the object. So the twist is asked
//! with another component along z of the sensor, with which the component that results is between 0 and the one that is
//! wanted. This holds while at most half of any direction is lost; [`least_lost`](super::least_lost) takes over before.
//!
//! Cost: one inverse of a 6x6 matrix proves that no direction needs damping. Only if it does not are the eigenvectors
//! computed, by Jacobi rotations.

/// Smallest damping for which double precision is enough.
pub const MIN_DAMPING: f64 = 1e-3;
/// Index of the component of a twist that pushes: along z of the sensor.
pub const PUSH: usize = 2;
/// The correction of a push is exact while at least this share of z remains [1].
const LEAST_SHARE: f64 = 0.5;
/// Most sweeps of Jacobi rotations. They converge quadratically: 6x6 matrices need 5 to 8 (Golub and Van Loan, *Matrix
/// Computations*, section 8.5).
const MAX_SWEEPS: usize = 12;

type Matrix = [[f64; 6]; 6];

/// How near a singularity the Jacobian is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearness {
    /// Smallest singular value. Above the damping it can be up to 22 % too small.
    pub sigma: f64,
    /// Fraction of its direction that the damping takes.
    pub damping: f64,
}

/// Writes to `out` the joint velocities [rad/s] that produce `twist` [m/s, rad/s], damped below the singular value
/// `damping`, for a Jacobian with these columns.
#[inline]
pub fn solve(columns: &[[f64; 6]], twist: &[f64; 6], damping: f64, out: &mut [f64]) -> Nearness {
    let gram = gram(columns);
    let square = damping * damping;
    let regular = inverse(gram, square).map(|inverse| (smallest(&inverse), inverse));
    let (back, nearness) = match regular {
        Some((least, inverse)) if least > square => {
            (apply(&inverse, twist), Nearness { sigma: least.sqrt(), damping: 0.0 })
        }
        _ => damp(gram, twist, square),
    };
    for (out, column) in out.iter_mut().zip(columns) {
        *out = dot(column, &back);
    }
    nearness
}

/// Returns J J^T, computed row by row so that a row stays in registers.
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

/// Returns the inverse of a symmetric matrix by Gauss-Jordan elimination in place, or `None` if a pivot shows that an
/// eigenvalue is below `least`: no pivot is smaller than the smallest eigenvalue.
#[inline]
fn inverse(mut m: Matrix, least: f64) -> Option<Matrix> {
    for k in 0..6 {
        let pivot = m[k][k];
        // A pivot that is not a number is no proof either.
        let is_proof = pivot > least;
        if !is_proof {
            return None;
        }
        let inverse = 1.0 / pivot;
        m[k][k] = 1.0;
        let row = m[k].map(|x| x * inverse);
        for other in &mut m {
            let factor = other[k];
            other[k] = 0.0;
            for j in 0..6 {
                other[j] -= factor * row[j];
            }
        }
        m[k] = row;
    }
    Some(m)
}

/// Returns a lower bound of the smallest eigenvalue of a matrix with this inverse: the first step of Laguerre's method
/// from 0, n / (S1 + sqrt((n - 1)(n S2 - S1²))), with S1 and S2 the sums of the inverse eigenvalues and of their
/// squares.
///
/// It is exact if one eigenvalue is much smaller than the others or all are equal, and at least 0.61 of the smallest
/// eigenvalue: with k equal ones and no others nearby it is 6 / (k + sqrt(5 k (6 - k))) of them.
#[inline]
fn smallest(inverse: &Matrix) -> f64 {
    let first: f64 = (0..6).map(|i| inverse[i][i]).sum();
    let mut squares = [0.0; 6];
    for row in inverse {
        for j in 0..6 {
            squares[j] += row[j] * row[j];
        }
    }
    let second: f64 = squares.iter().sum();
    6.0 / (first + (5.0 * (6.0 * second - first * first).max(0.0)).sqrt())
}

/// Returns A^-1 t with the damping `square` = eps² of small eigenvalues of A = `gram`.
#[cold]
fn damp(gram: Matrix, twist: &[f64; 6], square: f64) -> ([f64; 6], Nearness) {
    let (eigenvalues, directions) = eigen(gram);
    let eigenvalues = eigenvalues.map(|l| l.max(0.0));
    let gains = eigenvalues.map(|l| if l >= square { 1.0 / l } else { (2.0 - l / square) / square });
    let shares: [f64; 6] =
        std::array::from_fn(|i| if eigenvalues[i] >= square { 1.0 } else { eigenvalues[i] * gains[i] });
    let mut along = directions.map(|direction| dot(&direction, twist));
    // The push that would result, and the one that an asked push of 1 gives.
    let (mut push, mut per_push) = (0.0, 0.0);
    for i in 0..6 {
        push += shares[i] * along[i] * directions[i][PUSH];
        per_push += shares[i] * directions[i][PUSH] * directions[i][PUSH];
    }
    let wanted = push.max(twist[PUSH].min(0.0)).min(twist[PUSH].max(0.0));
    let more = (wanted - push) / per_push.max(LEAST_SHARE);
    let mut back = [0.0; 6];
    for i in 0..6 {
        along[i] += more * directions[i][PUSH];
        for j in 0..6 {
            back[j] += gains[i] * along[i] * directions[i][j];
        }
    }
    let (least, share) = eigenvalues
        .iter()
        .zip(shares)
        .fold((f64::INFINITY, 1.0_f64), |(least, share), (l, s)| (least.min(*l), share.min(s)));
    (back, Nearness { sigma: least.sqrt(), damping: 1.0 - share })
}

/// Returns the eigenvalues of a symmetric matrix, and one eigenvector for each: the cyclic method of Jacobi.
fn eigen(mut m: Matrix) -> ([f64; 6], Matrix) {
    let mut vectors: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let size: f64 = m.iter().flatten().map(|x| x * x).sum();
    for _ in 0..MAX_SWEEPS {
        let off: f64 = (0..6).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| m[i][j] * m[i][j]).sum();
        if off <= f64::EPSILON * f64::EPSILON * size {
            break;
        }
        for p in 0..5 {
            for q in p + 1..6 {
                rotate(&mut m, &mut vectors, p, q);
            }
        }
    }
    (std::array::from_fn(|i| m[i][i]), vectors)
}

/// Makes the entry (`p`, `q`) zero by a rotation. The rows of `vectors` turn along.
fn rotate(m: &mut Matrix, vectors: &mut Matrix, p: usize, q: usize) {
    let entry = m[p][q];
    if entry == 0.0 {
        return;
    }
    // The smaller of the two angles (Golub and Van Loan, section 8.5.2).
    let half = (m[q][q] - m[p][p]) / (2.0 * entry);
    let root = (1.0 + half * half).sqrt();
    let tangent = if half >= 0.0 { 1.0 / (half + root) } else { 1.0 / (half - root) };
    let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
    let sine = tangent * cosine;
    let turned = |a: f64, b: f64| (cosine * a - sine * b, sine * a + cosine * b);
    for row in m.iter_mut() {
        (row[p], row[q]) = turned(row[p], row[q]);
    }
    for matrix in [m, vectors] {
        let rows = matrix[p].into_iter().zip(matrix[q]);
        for (k, (a, b)) in rows.enumerate() {
            (matrix[p][k], matrix[q][k]) = turned(a, b);
        }
    }
}

#[inline]
fn apply(m: &Matrix, x: &[f64; 6]) -> [f64; 6] {
    // The matrix is symmetric, so its rows are its columns.
    let mut out = [0.0; 6];
    for (row, x) in m.iter().zip(x) {
        for j in 0..6 {
            out[j] += x * row[j];
        }
    }
    out
}

#[inline]
fn dot(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

#[cfg(test)]
mod tests;
