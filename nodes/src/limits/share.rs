//! How much of a twist stays within two bounds, one on its linear and one on its angular part; and the largest there is.

use tactflow_runtime::signal::Twist;

/// Largest component of a twist that limiters reckon with: what is larger counts as this, so that no sum and no square of
/// finite numbers overflows [m/s, rad/s].
const LARGEST: f64 = 1e100;

/// The twist with every component within the largest that limiters reckon with.
#[must_use]
pub fn countable(twist: &Twist) -> Twist {
    // `clamp` passes on what is no number, which ends the run at the port that gave it.
    Twist(twist.0.map(|v| v.clamp(-LARGEST, LARGEST)))
}

/// The greatest factor up to 1 that brings the linear part to at most `linear` and the angular part to at most `angular`.
///
/// ```
/// use nalgebra::Vector3;
/// use tactflow_nodes::limits::share::share;
/// use tactflow_runtime::signal::Twist;
///
/// let twist = Twist::new(Vector3::new(0.3, 0.0, 0.4), Vector3::new(0.0, 1.0, 0.0));
/// assert_eq!(share(&twist, 1.0, 2.0), 1.0);
/// assert_eq!(share(&twist, 0.25, 2.0), 0.5);
/// assert_eq!(share(&twist, 0.25, 0.1), 0.1);
/// assert_eq!(share(&twist, 0.0, 2.0), 0.0);
/// ```
#[must_use]
pub fn share(twist: &Twist, linear: f64, angular: f64) -> f64 {
    part(norm(twist, 0), linear).min(part(norm(twist, 3), angular))
}

/// Length of the linear part (from component 0) or of the angular part (from 3), without overflow.
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

fn part(size: f64, bound: f64) -> f64 {
    if size <= bound { 1.0 } else { bound / size }
}

/// How many times the two bounds a twist is: the greater of both ratios.
#[must_use]
pub fn times(twist: &Twist, linear: f64, angular: f64) -> f64 {
    (norm(twist, 0) / linear).max(norm(twist, 3) / angular)
}
