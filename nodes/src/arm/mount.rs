//! The pose of the sensor on the tip of an arm.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::node::Param;

use crate::motion::pose::pose_of;
use crate::usual::{USUAL_LENGTH_M, USUAL_RAD};

/// Where the sensor's frame is in the frame of the tip.
#[derive(Debug, Clone, Param)]
pub struct Mount {
    /// Origin of the sensor's frame in the frame of the tip.
    #[param(unit = "m", usual = -USUAL_LENGTH_M..=USUAL_LENGTH_M, default = [0.0; 3])]
    pub xyz: [f64; 3],
    /// Roll, pitch and yaw of the sensor's frame in the frame of the tip: Rz(yaw) Ry(pitch) Rx(roll), as in a URDF.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = [0.0; 3])]
    pub rpy: [f64; 3],
}

impl Mount {
    /// The sensor's frame is the frame of the tip.
    pub const NONE: Self = Self { xyz: [0.0; 3], rpy: [0.0; 3] };

    /// Returns the pose of the sensor in the frame of the tip.
    #[must_use]
    pub fn pose(&self) -> IsometryMatrix3<f64> {
        pose_of(self.xyz, self.rpy)
    }
}
