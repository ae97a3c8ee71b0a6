//! Twists and poses.

use nalgebra::{IsometryMatrix3, Vector3, Vector6};

/// A velocity twist `[v; omega]` [m/s, rad/s]. `twist in pad` is that of the sensor's origin along the sensor's axes;
/// `twist in base` is spatial: at the base's origin, as eq. 4 gives it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Twist(pub Vector6<f64>);

impl Twist {
    /// A twist from its linear [m/s] and its angular part [rad/s].
    #[must_use]
    pub fn new(linear: Vector3<f64>, angular: Vector3<f64>) -> Self {
        Self(Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))
    }

    /// The linear part [m/s].
    #[must_use]
    pub fn linear(&self) -> Vector3<f64> {
        Vector3::new(self.0[0], self.0[1], self.0[2])
    }

    /// The angular part [rad/s].
    #[must_use]
    pub fn angular(&self) -> Vector3<f64> {
        Vector3::new(self.0[3], self.0[4], self.0[5])
    }
}

/// A pose: rotation matrix and translation [m] that take points of one frame to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose(pub IsometryMatrix3<f64>);

impl Default for Pose {
    fn default() -> Self {
        Self(IsometryMatrix3::identity())
    }
}

/// Nothing but its frames is known of a twist at load, and those are the wires'.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TwistShape;

/// Nothing but its frames is known of a pose at load, and those are the wires'.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PoseShape;
