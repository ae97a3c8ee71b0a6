//! Braking: how fast a motion toward a bound may be.

/// Returns the largest speed from which a stop within `distance` is possible: the v of v τ + v²/(2a) = d.
///
/// The motion keeps its speed for `delay` τ [s] before it brakes with `deceleration` a. Distance, speed and
/// deceleration are in one unit of length, for example m, m/s and m/s², or rad, rad/s and rad/s². The speed is infinite
/// for an infinite distance, and 0 for a distance that is not positive or not a number.
///
/// ```
/// use tactflow_nodes::motion::braking::stopping_speed;
///
/// assert_eq!(stopping_speed(0.5, 1.0, 0.0), 1.0);
/// assert_eq!(stopping_speed(1.5, 1.0, 1.0), 1.0);
/// assert_eq!(stopping_speed(-0.1, 1.0, 1.0), 0.0);
/// ```
#[must_use]
pub fn stopping_speed(distance: f64, deceleration: f64, delay: f64) -> f64 {
    if distance > 0.0 && distance.is_finite() {
        // The root in the form in which nothing cancels.
        return 2.0 * distance / (delay + (delay * delay + 2.0 * distance / deceleration).sqrt());
    }
    if distance > 0.0 { f64::INFINITY } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_stop_takes_exactly_the_distance(
            distance in 1e-12..3.0f64, deceleration in 0.1..50.0f64, delay in 1e-3..0.5f64,
        ) {
            let v = stopping_speed(distance, deceleration, delay);
            prop_assert!((v * delay + v * v / (2.0 * deceleration) - distance).abs() < 1e-9 * distance);
            let none = [-distance, 0.0, f64::NAN].map(|d| stopping_speed(d, deceleration, delay));
            prop_assert_eq!(none, [0.0; 3]);
            prop_assert_eq!(stopping_speed(f64::INFINITY, deceleration, delay), f64::INFINITY);
        }
    }
}
