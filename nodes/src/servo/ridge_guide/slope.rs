//! The slope of the eccentricity over a leg: the least-squares line through its samples.

/// Running sums over the samples of a leg.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Slope {
    /// Distance along the leg [m].
    pub(super) way: f64,
    count: f64,
    /// Means of the distance and of e so far; the sums of their products are about these means.
    mean: [f64; 2],
    spread: f64,
    common: f64,
}

impl Slope {
    /// Adds a sample of e after a `step` [m].
    pub(super) fn add(&mut self, step: f64, narrow: f64) {
        self.way += step;
        self.count += 1.0;
        let off = [self.way - self.mean[0], narrow - self.mean[1]];
        self.mean = [self.mean[0] + off[0] / self.count, self.mean[1] + off[1] / self.count];
        self.spread += off[0] * (self.way - self.mean[0]);
        self.common += off[1] * (self.way - self.mean[0]);
    }

    /// Returns the slope of the line that fits best [1/m]; 0 without a distance.
    pub(super) fn slope(&self) -> f64 {
        let slope = self.common / self.spread;
        if slope.is_finite() { slope } else { 0.0 }
    }
}
