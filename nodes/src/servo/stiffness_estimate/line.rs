//! A straight line through the newest samples (z, p), whose weights decay with their age t as exp(-t / T).
//!
//! This is recursive least squares with forgetting and an unknown offset: only the changes dp and dz count. Means and
//! central sums are updated with each sample (West, Communications of the ACM 22, 1979), which cancels nothing far from the origin:
//!
//! ```text
//! W = λ W + 1     d = (z, p) - mean     mean += d / W     S = λ S + (1 - 1/W) d d'     λ = exp(-dt / T)
//! ```
//!
//! The slope is S_zp / S_zz, the excitation sqrt(S_zz / W), and the correlation S_zp / sqrt(S_zz S_pp).

/// A straight line through samples with decaying weights.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Line {
    /// Sum of the weights.
    weight: f64,
    /// Mean of travel [m] and value, from the newest travel.
    mean: [f64; 2],
    /// Central sums: travel by travel, travel by value, value by value.
    sums: [f64; 3],
}

impl Line {
    /// Adds a sample that is `travel` [m] after the last one; all older weights decay by the factor `decay`.
    pub(super) fn add(&mut self, travel: f64, value: f64, decay: f64) {
        // The travel counts from the newest sample, so it never becomes too large for its differences.
        self.mean[0] -= travel;
        self.weight = decay * self.weight + 1.0;
        let (z, p) = (-self.mean[0], value - self.mean[1]);
        self.mean[0] += z / self.weight;
        self.mean[1] += p / self.weight;
        let part = 1.0 - 1.0 / self.weight;
        for (sum, product) in self.sums.iter_mut().zip([z * z, z * p, p * p]) {
            *sum = decay * *sum + part * product;
        }
    }

    /// Returns the line with one sample more, without any travel.
    pub(super) fn with(mut self, value: f64) -> Self {
        self.add(0.0, value, 1.0);
        self
    }

    /// Whether all sums are finite: a sample that is not a number would stay in them.
    pub(super) fn is_finite(&self) -> bool {
        self.mean.iter().chain(&self.sums).all(|sum| sum.is_finite())
    }

    /// Returns the slope, or `None` if the samples do not determine it.
    pub(super) fn slope(&self, min_travel: f64, min_correlation: f64) -> Option<f64> {
        let [zz, zp, pp] = self.sums;
        let is_excited = zz >= min_travel * min_travel * self.weight;
        let is_correlated = zp > 0.0 && zp * zp >= min_correlation * min_correlation * zz * pp;
        (self.weight > 0.0 && is_excited && is_correlated).then(|| zp / zz)
    }
}
