//! Steps on a straight line: they limit the length of a motion and keep its direction.

/// Returns the largest factor up to 1 that brings `size` within `bound`; both are in the same unit and not negative.
///
/// If `bound` is NaN, the factor is NaN, which [`f64::min`] ignores.
///
/// ```
/// use tactflow_runtime::signal::line::scale_to;
///
/// assert_eq!(scale_to(0.5, 2.0), 1.0);
/// assert_eq!(scale_to(4.0, 1.0), 0.25);
/// assert_eq!(scale_to(4.0, 0.0), 0.0);
/// ```
#[must_use]
pub fn scale_to(size: f64, bound: f64) -> f64 {
    if size <= bound { 1.0 } else { bound / size }
}

/// Returns the number at the share `scale` of the way between two numbers; exactly `to` if `scale` is at least 1.
///
/// ```
/// use tactflow_runtime::signal::line::step_toward;
///
/// assert_eq!(step_toward(1.0, 3.0, 0.25), 1.5);
/// assert_eq!(step_toward(0.1, 0.3, 1.0), 0.3);
/// ```
#[must_use]
pub fn step_toward(from: f64, to: f64, scale: f64) -> f64 {
    if scale < 1.0 { from + (to - from) * scale } else { to }
}

/// Moves `values` toward `target` on a straight line, each by no more than its acceleration allows in `dt` [s].
/// Returns whether they have reached it.
///
/// ```
/// use tactflow_runtime::signal::line::approach;
///
/// let mut velocity = [1.0, 0.5];
/// assert!(!approach(&mut velocity, |_| 0.0, &[5.0, 5.0], 0.1));
/// assert_eq!(velocity, [0.5, 0.25]);
/// ```
pub fn approach(values: &mut [f64], target: impl Fn(usize) -> f64, accelerations: &[f64], dt: f64) -> bool {
    let mut scale = 1.0_f64;
    for (i, (value, acceleration)) in values.iter().zip(accelerations).enumerate() {
        // An infinite acceleration times a `dt` of zero is NaN, which `min` ignores.
        scale = scale.min(scale_to((target(i) - value).abs(), acceleration * dt));
    }
    for (i, value) in values.iter_mut().enumerate() {
        *value = step_toward(*value, target(i), scale);
    }
    scale >= 1.0
}
