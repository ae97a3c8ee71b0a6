//! How far a compliant arm leans on what its sensor touches.

use nalgebra::Vector3;
use tactflow_runtime::signal::{Jacobian, Joints, Pose};

/// Returns the speed of the sensor along its z for a unit speed of each joint [m/rad]: n · J.
///
/// `jacobian` is spatial: the velocity of the sensor's origin p is v + ω × p, and n · (ω × p) is ω · (p × n).
pub(in crate::limits) fn along_z(pose: &Pose, jacobian: &Jacobian) -> impl Iterator<Item = f64> {
    let normal: Vector3<f64> = pose.0.rotation.matrix().column(2).into();
    let arm = pose.0.translation.vector.cross(&normal);
    jacobian.0.iter().map(move |twist| twist.linear().dot(&normal) + twist.angular().dot(&arm))
}

/// Returns how far the equilibrium is ahead of the sensor's position, along the sensor's z [m]: n · J (q_eq - q).
#[must_use]
pub fn lead(pose: &Pose, jacobian: &Jacobian, position: &Joints, equilibrium: &Joints) -> f64 {
    let ahead = position.0.iter().zip(&equilibrium.0).map(|(q, q_eq)| q_eq - q);
    along_z(pose, jacobian).zip(ahead).map(|(part, ahead)| part * ahead).sum()
}
