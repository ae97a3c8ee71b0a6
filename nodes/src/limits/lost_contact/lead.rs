//! How far a compliant arm leans on what its sensor touches.

use tactflow_runtime::signal::{Jacobian, Joints, Pose};

/// Returns how far the equilibrium is ahead of the sensor's position, along the sensor's z [m]: n · J (q_eq - q).
///
/// `jacobian` is spatial: the velocity of the sensor's origin p is v + ω × p, and n · (ω × p) is ω · (p × n).
#[must_use]
pub fn lead(pose: &Pose, jacobian: &Jacobian, position: &Joints, equilibrium: &Joints) -> f64 {
    let normal = pose.0.rotation.matrix().column(2);
    let arm = pose.0.translation.vector.cross(&normal);
    let pairs = jacobian.0.iter().zip(position.0.iter().zip(&equilibrium.0));
    pairs.map(|(twist, (q, q_eq))| (twist.linear().dot(&normal) + twist.angular().dot(&arm)) * (q_eq - q)).sum()
}
