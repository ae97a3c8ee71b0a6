//! The range of the sums that three frames in a row have reached: one or two frames of garbage do not change it.

/// The lowest and the highest sum that three frames in a row have reached.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    lowest: f64,
    highest: f64,
    /// The last two sums.
    last: [f64; 2],
}

impl Default for Sums {
    fn default() -> Self {
        Self { lowest: f64::INFINITY, highest: f64::NEG_INFINITY, last: [f64::NAN; 2] }
    }
}

impl Sums {
    /// Adds the sum of the next frame.
    pub(super) fn add(&mut self, sum: f64) {
        let [first, second] = self.last;
        if !first.is_nan() {
            self.lowest = self.lowest.min(first.max(second).max(sum));
            self.highest = self.highest.max(first.min(second).min(sum));
        }
        self.last = [second, sum];
    }

    /// Returns the range; it is negative as long as the sum only goes up and down.
    pub(super) fn range(&self) -> f64 {
        self.highest - self.lowest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The range after these sums.
    fn range(sums: &[f64]) -> f64 {
        let mut seen = Sums::default();
        sums.iter().for_each(|sum| seen.add(*sum));
        seen.range()
    }

    #[test]
    fn only_what_three_frames_in_a_row_have_reached_counts() {
        assert_eq!(range(&[1.0, 1.0]), f64::NEG_INFINITY);
        assert_eq!(range(&[1.0, 1.0, 1.0, 5.0, 6.0, 7.0]), 4.0);
        assert_eq!(range(&[1.0, 1.0, 1.0, 5.0, 1e3, 6.0, -1e3, -1e3, 6.0, 1e3, 1e3, 5.0, 5.0]), 5.0);
        assert_eq!(range(&[1.0, 2.0, 1.0, 2.0]), -1.0);
    }
}
