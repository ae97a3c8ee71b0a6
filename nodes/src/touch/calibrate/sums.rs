//! The range of the sums that two frames in a row have reached: a single frame of garbage does not change it.

/// The lowest and the highest sum that two frames in a row have reached.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sums {
    lowest: f64,
    highest: f64,
}

impl Default for Sums {
    fn default() -> Self {
        Self { lowest: f64::INFINITY, highest: f64::NEG_INFINITY }
    }
}

impl Sums {
    /// Adds the sums of two frames in a row.
    pub(super) fn add(&mut self, last: f64, now: f64) {
        self.lowest = self.lowest.min(last.max(now));
        self.highest = self.highest.max(last.min(now));
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
        sums.windows(2).for_each(|pair| seen.add(pair[0], pair[1]));
        seen.range()
    }

    #[test]
    fn only_what_two_frames_in_a_row_have_reached_counts() {
        assert_eq!(range(&[1.0, 1.0, 5.0, 6.0]), 4.0);
        assert_eq!(range(&[1.0, 1.0, 5.0, 6.0, 1000.0, 6.0, -1000.0, 6.0, 1000.0, 6.0]), 5.0);
        assert_eq!(range(&[1.0, 2.0, 1.0, 2.0]), -1.0);
    }
}
