//! Joint vectors and the Jacobian over them.

use super::spatial::Twist;
use super::unit::Unit;

/// One joint of an arm, as known at load.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Its name, as in the robot's model.
    pub name: String,
    /// Least position [rad].
    pub lower: f64,
    /// Greatest position [rad].
    pub upper: f64,
    /// Greatest speed [rad/s].
    pub speed: f64,
    /// Greatest acceleration [rad/s²]; infinite if nothing is known of it.
    pub acceleration: f64,
}

impl Default for Joint {
    fn default() -> Self {
        Self { name: String::new(), lower: 0.0, upper: 0.0, speed: 0.0, acceleration: f64::INFINITY }
    }
}

/// What is known of a joint vector, or of a Jacobian's columns, at load.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointsShape {
    /// The joints from the base to the tip.
    pub joints: Vec<Joint>,
    /// Unit of each value; of no meaning for a Jacobian.
    pub unit: Unit,
}

impl JointsShape {
    /// The same joints in another unit.
    #[must_use]
    pub fn in_unit(&self, unit: Unit) -> Self {
        Self { joints: self.joints.clone(), unit }
    }
}

/// One value a joint, from the base to the tip.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Joints(pub Box<[f64]>);

impl Joints {
    /// `count` zeros.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self(vec![0.0; count].into())
    }
}

/// The columns of a Jacobian: the twist that unit speed of each joint gives.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Jacobian(pub Box<[Twist]>);

impl Jacobian {
    /// `count` columns of zeros.
    #[must_use]
    pub fn zeros(count: usize) -> Self {
        Self(vec![Twist::default(); count].into())
    }
}
