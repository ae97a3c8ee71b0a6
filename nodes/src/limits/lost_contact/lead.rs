//! How far a compliant arm leans on what its sensor touches.

use tactflow_runtime::signal::{Jacobian, Joints, Pose};

use crate::motion::normal::along_z;

/// Returns how far the equilibrium is ahead of the sensor's position, along the sensor's z [m]: n · J (q_eq - q).
#[must_use]
pub fn lead(pose: &Pose, jacobian: &Jacobian, position: &Joints, equilibrium: &Joints) -> f64 {
    let ahead = position.0.iter().zip(&equilibrium.0).map(|(q, q_eq)| q_eq - q);
    along_z(pose, jacobian).zip(ahead).map(|(part, ahead)| part * ahead).sum()
}
