//! Scaling a motion until it is within bounds, so that its direction is kept.

use tactflow_runtime::signal::Twist;
use tactflow_runtime::signal::line::{scale_to, step_toward};

/// Largest component of a twist that limiters compute with, so that no sum and no square overflows [m/s, rad/s].
const MAX_COMPONENT: f64 = 1e100;
/// A component below this fraction of the motion is not counted: otherwise rounding alone would stop a motion along a
/// bound [1].
const NEGLIGIBLE: f64 = 1e-9;

/// Returns the twist with every component within the largest one that limiters compute with.
pub fn countable(twist: &Twist) -> Twist {
    // `clamp` keeps a value that is not a number, which ends the run at the port that wrote it.
    Twist(twist.0.map(|v| v.clamp(-MAX_COMPONENT, MAX_COMPONENT)))
}

/// Returns the largest factor up to 1 that brings the linear part within `linear` [m/s] and the angular part within
/// `angular` [rad/s].
///
/// ```
/// use nalgebra::Vector3;
/// use tactflow_nodes::motion::bounds::scale_twist;
/// use tactflow_runtime::signal::Twist;
///
/// let twist = Twist::new(Vector3::new(0.3, 0.0, 0.4), Vector3::new(0.0, 1.0, 0.0));
/// assert_eq!(scale_twist(&twist, 1.0, 2.0), 1.0);
/// assert_eq!(scale_twist(&twist, 0.25, 2.0), 0.5);
/// assert_eq!(scale_twist(&twist, 0.25, 0.1), 0.1);
/// assert_eq!(scale_twist(&twist, 0.0, 2.0), 0.0);
/// ```
#[must_use]
pub fn scale_twist(twist: &Twist, linear: f64, angular: f64) -> f64 {
    scale_to(norm(twist, 0), linear).min(scale_to(norm(twist, 3), angular))
}

/// Returns the larger of two ratios: the linear part to `linear`, and the angular part to `angular`.
#[must_use]
pub fn twist_ratio(twist: &Twist, linear: f64, angular: f64) -> f64 {
    (norm(twist, 0) / linear).max(norm(twist, 3) / angular)
}

/// Moves `reached` toward `target` on a straight line, by at most `linear` [m/s] and `angular` [rad/s]. Returns the
/// part of the change that it made, up to 1.
pub fn approach_twist(reached: &mut Twist, target: &Twist, linear: f64, angular: f64) -> f64 {
    let scale = scale_twist(&Twist(target.0 - reached.0), linear, angular);
    *reached = Twist(reached.0.zip_map(&target.0, |from, to| step_toward(from, to, scale)));
    scale
}

/// Returns the largest factor up to 1 that brings each velocity within its bound.
///
/// `parts` are pairs of a velocity and its bound on the side that the velocity points to, with the sign of the velocity
/// or 0. `size` is the size of the whole motion; a velocity below 1e-9 of it is not counted.
pub fn scale_within(size: f64, parts: impl Iterator<Item = (f64, f64)>) -> f64 {
    let mut scale = 1.0_f64;
    for (velocity, bound) in parts {
        if velocity.abs() > NEGLIGIBLE * size && velocity.abs() > bound.abs() {
            scale = scale.min(bound / velocity);
        }
    }
    scale
}

/// Returns the largest factor up to 1 that brings each velocity within its interval `(min, max)`; each interval
/// contains
/// 0.
pub fn scale_into(velocity: &[f64], intervals: impl Iterator<Item = (f64, f64)>) -> f64 {
    let largest = velocity.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
    let toward = |(v, (min, max)): (&f64, (f64, f64))| (*v, if *v > 0.0 { max } else { min });
    scale_within(largest, velocity.iter().zip(intervals).map(toward))
}

/// Returns the length of the linear part (`from` 0) or of the angular part (`from` 3), without overflow.
fn norm(twist: &Twist, from: usize) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|i| twist.0[from + i].abs());
    let largest = x.max(y).max(z);
    if largest > f64::MIN_POSITIVE {
        let [x, y, z] = [x / largest, y / largest, z / largest];
        largest * (x * x + y * y + z * z).sqrt()
    } else {
        largest
    }
}
