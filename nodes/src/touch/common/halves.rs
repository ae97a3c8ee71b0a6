//! The frames of a pad at rest in two halves: a steady value has the same mean in both.

/// A difference of two means by more than this is a drift [standard deviations of the difference].
const SIGNIFICANT: f64 = 6.0;

/// A reading that is off its zero by more than this is a contact or a drift [standard deviations of the noise].
pub(crate) const FREE: f64 = 8.0;

/// The numbers of frames in the first and in the second half of a rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Halves(pub(crate) [usize; 2]);

impl Halves {
    /// Returns the halves of two frames or more.
    pub(crate) const fn of(frames: usize) -> Self {
        Self([frames / 2, frames - frames / 2])
    }

    /// Returns the number of the half to which a frame belongs.
    pub(crate) fn half(self, frame: usize) -> usize {
        usize::from(frame >= self.0[0])
    }

    /// Returns the largest difference of the two means of a steady value with this variance.
    pub(crate) fn largest_drift(self, variance: f64) -> f64 {
        let of_mean = |frames: usize| variance / frames as f64;
        SIGNIFICANT * self.0.map(of_mean).iter().sum::<f64>().sqrt()
    }
}

/// Returns the median, of an even count the larger one of the two in the middle, and 0 for no numbers. Sorts them partly.
pub(crate) fn upper_median(numbers: &mut [f64]) -> f64 {
    let middle = numbers.len() / 2;
    if numbers.is_empty() { 0.0 } else { *numbers.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
