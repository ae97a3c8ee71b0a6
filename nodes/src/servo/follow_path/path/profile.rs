//! The speed along a path: slower in corners, and braking before them and before the end.
//!
//! On an arc of radius r the speed v stays below sqrt(a r), so that v² / r is at most a. Before a slower element and
//! before the end, the path is braked with a: v² = v_next² + 2 a d, where d is the way to it.

use super::{Path, Station};

/// The speed that corners and the end allow.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Profile {
    /// Largest acceleration [m/s²].
    acceleration: f64,
    /// For each element, the speed that it allows in itself [m/s].
    within: Vec<f64>,
    /// For each element, the largest speed at its end [m/s].
    at_end: Vec<f64>,
}

impl Profile {
    /// Returns the profile of a path.
    pub(crate) fn new(path: &Path, acceleration: f64) -> Self {
        let within: Vec<f64> = path
            .elements()
            .iter()
            .map(|element| element.radius().map_or(f64::INFINITY, |radius| (acceleration * radius).sqrt()))
            .collect();
        let mut at_end = vec![0.0; within.len()];
        for i in (1..within.len()).rev() {
            let at_begin = braking_speed(at_end[i], acceleration, path.elements()[i].length);
            at_end[i - 1] = at_begin.min(within[i]).min(within[i - 1]);
        }
        Self { acceleration, within, at_end }
    }

    /// Returns the speed that is allowed at a station [m/s].
    pub(crate) fn speed(&self, path: &Path, station: Station) -> f64 {
        let (element, rest) = path.rest_of_element(station);
        braking_speed(self.at_end[element], self.acceleration, rest).min(self.within[element])
    }
}

/// Returns the speed from which a way [m] is enough to brake to `to` [m/s].
fn braking_speed(to: f64, acceleration: f64, way: f64) -> f64 {
    (to * to + 2.0 * acceleration * way).sqrt()
}
