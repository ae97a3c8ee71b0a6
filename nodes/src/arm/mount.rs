//! The pose of the sensor on the tip of an arm.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3};
use tactflow_runtime::node::Param;

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

/// Returns the pose with a translation [m] and with roll, pitch and yaw [rad]: Rz(yaw) Ry(pitch) Rx(roll).
pub(crate) fn pose_of(xyz: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> IsometryMatrix3<f64> {
    let ((sr, cr), (sp, cp), (sy, cy)) = (libm::sincos(roll), libm::sincos(pitch), libm::sincos(yaw));
    #[rustfmt::skip]
    let rotation = Matrix3::new(
        cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr,
        sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr,
        -sp,     cp * sr,                cp * cr,
    );
    IsometryMatrix3::from_parts(Translation3::from(xyz), Rotation3::from_matrix_unchecked(rotation))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn roll_pitch_and_yaw_are_rotations_about_fixed_axes(roll in -3.2..3.2, pitch in -3.2..3.2, yaw in -3.2..3.2) {
            let turn = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
            let wanted = turn(Vector3::z_axis(), yaw) * turn(Vector3::y_axis(), pitch) * turn(Vector3::x_axis(), roll);
            let got = pose_of([1.0, 2.0, 3.0], [roll, pitch, yaw]);
            prop_assert!((got.rotation.matrix() - wanted.matrix()).norm() < 1e-14);
            prop_assert_eq!(got.translation.vector, Vector3::new(1.0, 2.0, 3.0));
        }
    }
}
