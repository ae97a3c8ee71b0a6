//! Twists and poses.

use nalgebra::{IsometryMatrix3, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// A velocity twist `[v; omega]` [m/s, rad/s].
///
/// A twist in a sensor's frame is the velocity of the sensor's origin in the sensor's axes. A twist in `base` is
/// spatial: the velocity at the base's origin (paper eq. 4).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[must_use]
pub struct Twist(pub Vector6<f64>);

impl Twist {
    /// Creates a twist from its linear part [m/s] and its angular part [rad/s].
    pub fn new(linear: Vector3<f64>, angular: Vector3<f64>) -> Self {
        Self(Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))
    }

    /// Returns the linear part [m/s].
    #[must_use]
    pub fn linear(&self) -> Vector3<f64> {
        Vector3::new(self.0[0], self.0[1], self.0[2])
    }

    /// Returns the angular part [rad/s].
    #[must_use]
    pub fn angular(&self) -> Vector3<f64> {
        Vector3::new(self.0[3], self.0[4], self.0[5])
    }
}

/// A pose: the rotation matrix and translation [m] that transform points of one frame to another.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose(pub IsometryMatrix3<f64>);

/// A shape without properties in a recording: an empty table.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct NoProperties {}

/// The shape of a twist, which has no properties: its frames belong to the wire.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(from = "NoProperties", into = "NoProperties")]
pub struct TwistShape;

impl From<TwistShape> for NoProperties {
    fn from(_: TwistShape) -> Self {
        Self {}
    }
}

impl From<NoProperties> for TwistShape {
    fn from(_: NoProperties) -> Self {
        Self
    }
}

/// The shape of a pose: what is known of it before a run. Its frames belong to the wire.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PoseShape {
    /// Origin at the start of a run, if it is known [m].
    pub start: Option<[f64; 3]>,
}
