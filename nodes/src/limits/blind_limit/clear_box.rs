//! A box of the base that is known to be empty.

use nalgebra::{Point3, Vector3};
use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::Pose;

/// A box of the base that is known to be empty.
#[derive(Debug, Clone, Copy)]
pub(super) struct ClearBox {
    min: [f64; 3],
    max: [f64; 3],
}

impl ClearBox {
    /// Creates the box, if both corners are given [m].
    pub(super) fn new(min: Option<[f64; 3]>, max: Option<[f64; 3]>) -> Result<Option<Self>, Mistakes> {
        let lone = |name: &str| {
            let mistake = Mistake::param(name, "a clear box needs both `clear_min_m` and `clear_max_m`");
            Err(mistake.help("state both facts in the bench, or neither").into())
        };
        let (min, max) = match (min, max) {
            (None, None) => return Ok(None),
            (Some(_), None) => return lone("clear_min_m"),
            (None, Some(_)) => return lone("clear_max_m"),
            (Some(min), Some(max)) => (min, max),
        };
        if let Some(i) = (0..3).find(|i| min[*i] >= max[*i]) {
            let message =
                format!("the clear box is empty along {}: from {} to {} m", ["x", "y", "z"][i], min[i], max[i]);
            return Err(Mistake::param("clear_max_m", message).into());
        }
        Ok(Some(Self { min, max }))
    }

    /// Returns the smallest distance of a corner of a pad from a face of the box [m]; not positive if a corner is
    /// outside.
    pub(super) fn room(&self, pose: &Pose, corners: &[Vector3<f64>]) -> f64 {
        let distance = |corner: &Vector3<f64>| {
            let point = pose.0 * Point3::from(*corner);
            (0..3).map(|i| (point[i] - self.min[i]).min(self.max[i] - point[i])).fold(f64::INFINITY, f64::min)
        };
        corners.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}
