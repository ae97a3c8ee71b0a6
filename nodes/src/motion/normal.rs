//! The motion of a sensor along its z, which points out of the pad toward the object.

use nalgebra::Vector3;
use tactflow_runtime::signal::{Jacobian, Pose};

/// Returns the speed of the sensor along its z for a unit speed of each joint [m/rad]: n · J.
///
/// `jacobian` is spatial: the velocity of the sensor's origin p is v + ω × p, and n · (ω × p) is ω · (p × n).
pub fn along_z(pose: &Pose, jacobian: &Jacobian) -> impl Iterator<Item = f64> {
    let normal: Vector3<f64> = pose.0.rotation.matrix().column(2).into();
    let arm = pose.0.translation.vector.cross(&normal);
    jacobian.0.iter().map(move |twist| twist.linear().dot(&normal) + twist.angular().dot(&arm))
}
