//! The mean of the samples in a ring.

use crate::touch::filter::Ring;

/// The time of a sample [ns], and its vector.
pub(super) type TimedVector = (i64, [f64; 2]);

/// Returns the mean vector of the samples.
pub(super) fn mean(ring: &Ring<TimedVector>) -> [f64; 2] {
    let parts = ring.parts();
    let count = (parts[0].len() + parts[1].len()) as f64;
    let sum = add_up(parts, |part| part);
    if sum[0].is_finite() {
        return sum.map(|sum| sum / count);
    }
    // The sum of very large samples is infinite, their mean is not.
    add_up(parts, |part| part / count).map(|mean| mean.clamp(f64::MIN, f64::MAX))
}

/// Returns the sums over both parts of the ring.
fn add_up(parts: [&[TimedVector]; 2], scale: impl Fn(f64) -> f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for samples in parts {
        for (_, [a, b]) in samples {
            sum = [sum[0] + scale(*a), sum[1] + scale(*b)];
        }
    }
    sum
}
