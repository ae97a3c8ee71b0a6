//! The posture that does not fit the others.

use nalgebra::IsometryMatrix3;

use super::{DOUBTFUL_RESIDUAL_M, MIN_TOUCHES, MountFit, MountPosture, fit};

/// By how much the residual falls without the posture that is wrong [1].
const MIN_IMPROVEMENT: f64 = 4.0;

/// A posture that does not fit the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Its index.
    pub index: usize,
    /// Root mean square of the residuals without it [m].
    pub rms: f64,
}

/// Returns the posture without which the residual becomes small, if that of all postures is doubtful and there is one
/// more posture than a fit needs.
#[must_use]
pub fn outlier(touches: &[MountPosture], present: &IsometryMatrix3<f64>, all: &MountFit) -> Option<Outlier> {
    if touches.len() <= MIN_TOUCHES || all.rms() < DOUBTFUL_RESIDUAL_M {
        return None;
    }
    let without = |index: usize| {
        let rest: Vec<MountPosture> = [&touches[..index], &touches[index + 1..]].concat();
        Some(Outlier { index, rms: fit(&rest, present).ok()?.rms() })
    };
    let best = (0..touches.len()).filter_map(without).min_by(|a, b| a.rms.total_cmp(&b.rms))?;
    (best.rms * MIN_IMPROVEMENT < all.rms()).then_some(best)
}
