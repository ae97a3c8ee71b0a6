//! The mount of a pad on an arm, from one fixed point that the pad touches in several postures.
//!
//! In posture i the tip has the pose R_i, p_i in the base, and the contact is at s_i = (x_i, y_i, 0) in the frame of the
//! pad. Unknown are the mount R, t and the point c. The residual of a posture is r_i = R_i (R s_i + t) + p_i - c [m].
//!
//! For a given R this is linear in t and c. All of it is solved by the method of Levenberg and Marquardt ([`solve`]),
//! with R turned in its own frame: R exp([d]). It starts from the mount of the bench and from all quarter turns of it,
//! so the result does not depend on a bad start.
//!
//! The third column of R, z of the pad, is not observed, because all contacts have z = 0: it follows from the other two, so
//! that R is a rotation. An image that is mirrored by F = diag(-1, 1, 1) therefore fits as well, with R F diag(1, 1, -1) in
//! place of R: z of the pad then points into the tool. [`MountFit::faces_away_from`] finds it.
//!
//! The contacts must be at different places of the pad, or the rotation is not observable. It is then kept as the bench
//! states it. What is observable follows from the covariance of the solution under a noise of 0.5 mm, so from the postures
//! and not from the residual.

mod outlier;
mod solve;

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, SymmetricEigen, Vector3};

pub use outlier::{Outlier, outlier};
use solve::{Solution, Unknown, solve};

/// Minimum number of postures.
pub const MIN_TOUCHES: usize = 4;
/// Residual above which the result is doubtful [m].
pub const DOUBTFUL_RESIDUAL_M: f64 = 0.002;
/// Noise of a contact under which the postures must determine the mount [m].
const ASSUMED_NOISE_M: f64 = 0.0005;
/// Standard deviation of the rotation about any axis from which on it is not determined [rad].
const MAX_TURN_RAD: f64 = 0.05;
/// Standard deviation of the translation along any axis from which on it is not determined [m].
const MAX_SHIFT_M: f64 = 0.003;

/// A posture in which the pad touches the point.
#[derive(Debug, Clone, Copy)]
pub struct MountPosture {
    /// Pose of the tip in the base.
    pub tip: IsometryMatrix3<f64>,
    /// Centre of the contact on the pad, x and y in its frame [m].
    pub place: [f64; 2],
}

impl MountPosture {
    /// Returns where the touched point is in the base, with this mount of the pad.
    fn point(&self, mount: &IsometryMatrix3<f64>) -> Vector3<f64> {
        let [x, y] = self.place;
        (self.tip * mount * nalgebra::Point3::new(x, y, 0.0)).coords
    }
}

/// A mount and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct MountFit {
    /// Pose of the pad in the frame of the tip.
    pub mount: IsometryMatrix3<f64>,
    /// The touched point in the base [m].
    pub point: Vector3<f64>,
    /// Distance between the touched point and that of each posture [m].
    pub residuals: Vec<f64>,
    /// Standard deviations of the translation along x, y and z of the tip [m].
    pub shift_deviation: Vector3<f64>,
    /// Standard deviations of the rotation about x, y and z of the pad [rad], if it was determined.
    pub turn_deviation: Result<Vector3<f64>, KeptRotation>,
}

/// The contacts do not determine the rotation of the pad, so the fit keeps that of the bench.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeptRotation {
    /// Axis in the frame of the pad about which the rotation is known worst.
    pub axis: Vector3<f64>,
    /// Standard deviation of the rotation about it [rad].
    pub deviation: f64,
}

impl MountFit {
    /// Returns the root mean square of the residuals [m].
    #[must_use]
    pub fn rms(&self) -> f64 {
        (self.residuals.iter().map(|residual| residual * residual).sum::<f64>() / self.residuals.len() as f64).sqrt()
    }

    /// Whether z of the pad is more than a right angle away from z of another mount.
    #[must_use]
    pub fn faces_away_from(&self, other: &IsometryMatrix3<f64>) -> bool {
        let z = |mount: &IsometryMatrix3<f64>| mount.rotation * Vector3::z();
        z(&self.mount).dot(&z(other)) < 0.0
    }

    /// Returns the largest residual [m] and the index of its posture.
    #[must_use]
    pub fn largest(&self) -> (f64, usize) {
        let residuals = self.residuals.iter().copied().zip(0..);
        residuals.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    }
}

/// Why the postures do not determine a mount.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MountUnfit {
    /// There are fewer than [`MIN_TOUCHES`].
    Few,
    /// The tip is turned too little between the postures.
    Alike {
        /// Axis in the frame of the tip along which the translation is known worst.
        axis: Vector3<f64>,
        /// Standard deviation along it [m].
        deviation: f64,
    },
}

/// Returns the mount that fits the postures best. `present` is the mount that the bench states.
///
/// # Errors
/// If the postures are too few or too alike.
pub fn fit(touches: &[MountPosture], present: &IsometryMatrix3<f64>) -> Result<MountFit, MountUnfit> {
    if touches.len() < MIN_TOUCHES {
        return Err(MountUnfit::Few);
    }
    let kept = solve(touches, &present.rotation, Unknown::Translation);
    check_shift(&kept)?;
    let best = best_of_all_starts(touches, present);
    let (deviation, axis) = worst(&best.turn_covariance(ASSUMED_NOISE_M));
    if deviation > MAX_TURN_RAD {
        return Ok(fitted(touches, &kept, Err(KeptRotation { axis, deviation })));
    }
    check_shift(&best)?;
    let turn = diagonal_roots(&best.turn_covariance(best.noise()));
    Ok(fitted(touches, &best, Ok(turn)))
}

/// Solves for rotation and translation from the rotation of the bench and from all quarter turns of it.
fn best_of_all_starts(touches: &[MountPosture], present: &IsometryMatrix3<f64>) -> Solution {
    let starts = quarter_turns().map(|turn| present.rotation * turn);
    let solutions = starts.map(|start| solve(touches, &start, Unknown::Pose));
    let best = solutions.min_by(|a, b| a.cost.total_cmp(&b.cost));
    best.unwrap_or_else(|| solve(touches, &present.rotation, Unknown::Pose))
}

/// Checks that the translation is determined along every axis.
fn check_shift(solution: &Solution) -> Result<(), MountUnfit> {
    let (deviation, axis) = worst(&solution.shift_covariance(ASSUMED_NOISE_M));
    if deviation > MAX_SHIFT_M { Err(MountUnfit::Alike { axis, deviation }) } else { Ok(()) }
}

fn fitted(touches: &[MountPosture], solution: &Solution, turn: Result<Vector3<f64>, KeptRotation>) -> MountFit {
    let mount = solution.mount;
    let residuals = touches.iter().map(|touch| (touch.point(&mount) - solution.point).norm()).collect();
    let shift_deviation = diagonal_roots(&solution.shift_covariance(solution.noise()));
    MountFit { mount, point: solution.point, residuals, shift_deviation, turn_deviation: turn }
}

/// Returns the largest standard deviation of a covariance, and its direction.
fn worst(covariance: &Matrix3<f64>) -> (f64, Vector3<f64>) {
    let eigen = SymmetricEigen::new(*covariance);
    let largest = eigen.eigenvalues.imax();
    let axis: Vector3<f64> = eigen.eigenvectors.column(largest).into();
    // The sign of an axis has no meaning; its largest coordinate is positive.
    (eigen.eigenvalues[largest].max(0.0).sqrt(), axis * axis[axis.iamax()].signum())
}

fn diagonal_roots(covariance: &Matrix3<f64>) -> Vector3<f64> {
    covariance.diagonal().map(|variance| variance.max(0.0).sqrt())
}

/// Returns the 24 rotations that take the axes of a frame to each other. The first one is the identity.
fn quarter_turns() -> impl Iterator<Item = Rotation3<f64>> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let signed = axes.into_iter().flat_map(|axis| [axis, -axis]);
    let pairs = signed.clone().flat_map(move |x| signed.clone().map(move |y| (x, y)));
    let right = pairs.filter(|(x, y)| x.dot(y) == 0.0);
    right.map(|(x, y)| Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)])))
}

#[cfg(test)]
mod tests;
