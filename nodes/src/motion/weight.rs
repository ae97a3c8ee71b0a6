//! The weight of a tool on an arm, as a wrench in the frame of the tip.

use nalgebra::{Rotation3, Vector3};

/// Acceleration of gravity [m/s²].
pub const GRAVITY: f64 = 9.80665;

/// Returns the unit vector down, in the axes of a tip with this rotation in the base. The base stands upright.
#[must_use]
pub fn down(tip: &Rotation3<f64>) -> Vector3<f64> {
    tip.inverse() * -Vector3::z()
}

/// Returns the wrench of the weight of a tool of a mass [kg] with its centre at `centre` [m], in the frame of the tip:
/// f = m g d [N] with the direction d down, and t = c x f [N m].
///
/// ```
/// use nalgebra::{Rotation3, Vector3};
/// use tactflow_nodes::motion::weight::{GRAVITY, weight};
///
/// // The tip points up. The centre is 0.1 m along its x, so the weight turns it about +y.
/// let found = weight(2.0, &Vector3::new(0.1, 0.0, 0.3), &Rotation3::identity());
/// assert_eq!(found, [0.0, 0.0, -2.0 * GRAVITY, 0.0, 0.2 * GRAVITY, 0.0]);
/// ```
#[must_use]
pub fn weight(mass: f64, centre: &Vector3<f64>, tip: &Rotation3<f64>) -> [f64; 6] {
    let force = down(tip) * (mass * GRAVITY);
    let torque = centre.cross(&force);
    [force.x, force.y, force.z, torque.x, torque.y, torque.z]
}
