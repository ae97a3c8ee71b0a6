//! Joint vectors and Jacobians.

use serde::{Deserialize, Serialize};

use super::spatial::Twist;
use super::unit::Unit;

/// The name and limits of one joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Joint {
    /// Name in the robot's model.
    pub name: String,
    /// Minimum position [rad].
    pub lower: f64,
    /// Maximum position [rad].
    pub upper: f64,
    /// Maximum speed [rad/s].
    pub speed: f64,
    /// Maximum acceleration [rad/s²]; infinite if it is unknown.
    pub acceleration: f64,
    /// Position at which a run starts, if it is known [rad].
    pub start: Option<f64>,
}

impl Default for Joint {
    fn default() -> Self {
        Self { name: String::new(), lower: 0.0, upper: 0.0, speed: 0.0, acceleration: f64::INFINITY, start: None }
    }
}

/// The shape of a joint vector, or of the columns of a Jacobian.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct JointsShape {
    /// The joints from the base to the tip.
    pub joints: Vec<Joint>,
    /// Unit of each value; unused for a Jacobian.
    pub unit: Unit,
}

impl JointsShape {
    /// Returns the same joints with another unit.
    #[must_use]
    pub fn in_unit(&self, unit: Unit) -> Self {
        Self { joints: self.joints.clone(), unit }
    }
}

/// A joint vector: one value per joint, from the base to the tip.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joints(pub Box<[f64]>);

impl Joints {
    /// Creates a vector of `count` zeros.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self(vec![0.0; count].into())
    }
}

/// A Jacobian. Each column is the twist at unit speed of one joint.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Jacobian(pub Box<[Twist]>);

impl Jacobian {
    /// Creates a Jacobian with `count` columns of zeros.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self(vec![Twist::default(); count].into())
    }
}
