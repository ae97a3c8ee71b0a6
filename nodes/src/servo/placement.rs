//! A pose that a guidance node takes as a parameter.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::node::Param;

use crate::motion::pose::pose_of;
use crate::usual::{USUAL_RAD, USUAL_REACH_M};

/// A pose in another frame, which the parameter names.
#[derive(Debug, Clone, PartialEq, Param)]
pub struct Placement {
    /// Origin, in the other frame.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M, default = [0.0; 3])]
    pub xyz: [f64; 3],
    /// Roll, pitch and yaw in the other frame: Rz(yaw) Ry(pitch) Rx(roll), as in a URDF.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = [0.0; 3])]
    pub rpy: [f64; 3],
}

impl Placement {
    /// The other frame itself.
    pub const NONE: Self = Self { xyz: [0.0; 3], rpy: [0.0; 3] };

    /// Returns the pose.
    #[must_use]
    pub fn pose(&self) -> IsometryMatrix3<f64> {
        pose_of(self.xyz, self.rpy)
    }
}
