//! The motion of a sensor along its z, which points out of the pad toward the object.

use nalgebra::Vector3;
use tactflow_runtime::signal::{Jacobian, Joints, Pose};

/// Returns the speed of the sensor along its z for a unit speed of each joint [m/rad]: n · J.
///
/// `jacobian` is spatial: the velocity of the sensor's origin p is v + ω × p, and n · (ω × p) is ω · (p × n).
pub fn along_z(pose: &Pose, jacobian: &Jacobian) -> impl Iterator<Item = f64> {
    let normal: Vector3<f64> = pose.0.rotation.matrix().column(2).into();
    let arm = pose.0.translation.vector.cross(&normal);
    jacobian.0.iter().map(move |twist| twist.linear().dot(&normal) + twist.angular().dot(&arm))
}

/// Returns the sum of the squares of how fast the sensor moves along its z for each joint [m²].
///
/// A force f along z turns joint i by f J_i / k, and that moves the sensor by J_i times as much: an arm whose joints have
/// the compliance 1/k gives way by this times f / k.
pub fn give(pose: &Pose, jacobian: &Jacobian) -> f64 {
    along_z(pose, jacobian).map(|part| part * part).sum()
}

/// Returns how far the equilibrium is ahead of the sensor's position, along the sensor's z [m]: n · J (q_eq - q).
#[must_use]
pub fn lead(pose: &Pose, jacobian: &Jacobian, position: &Joints, equilibrium: &Joints) -> f64 {
    let ahead = position.0.iter().zip(&equilibrium.0).map(|(q, q_eq)| q_eq - q);
    along_z(pose, jacobian).zip(ahead).map(|(part, ahead)| part * ahead).sum()
}
