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
