//! A value over a whole run, in bounded memory.

use super::number::is_flat;

/// Bars from low to high.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Maximum number of bins of a sparkline; a long run has at least half as many.
const SPARKLINE_BINS: usize = 48;

/// A value over time in at most `capacity` bins. When all bins are in use, neighbours are merged in pairs, or the oldest
/// bin is forgotten.
#[derive(Debug, Clone)]
pub(crate) struct Series {
    bins: Vec<SeriesBin>,
    capacity: usize,
    /// Ticks in each bin but the last.
    stride: u64,
    /// Ticks in the last bin.
    ticks: u64,
    /// Whether the oldest bin is forgotten.
    is_sliding: bool,
}

/// Statistics of a value over some ticks.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeriesBin {
    /// Number of ticks in which the value was present.
    count: f64,
    pub(crate) mean: f64,
    /// Sum of the squared distances from the mean.
    squares: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl SeriesBin {
    /// The bin of no ticks.
    const EMPTY: Self = Self { count: 0.0, mean: 0.0, squares: 0.0, low: f64::INFINITY, high: f64::NEG_INFINITY };

    const fn of(value: f64) -> Self {
        Self { count: 1.0, mean: value, squares: 0.0, low: value, high: value }
    }

    /// Merges two bins by Chan's formula, which avoids the cancellation of a plain sum of squares.
    fn merge(self, other: Self) -> Self {
        let count = self.count + other.count;
        if count == 0.0 {
            return self;
        }
        let (step, share) = (other.mean - self.mean, other.count / count);
        Self {
            count,
            mean: self.mean + step * share,
            squares: self.squares + other.squares + step * step * self.count * share,
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Merges the bins of a part of a run.
    pub(crate) fn merged<'b>(bins: impl IntoIterator<Item = &'b Self>) -> Self {
        bins.into_iter().fold(Self::EMPTY, |all, bin| all.merge(*bin))
    }

    /// Whether the value was present in any tick.
    pub(crate) fn is_present(&self) -> bool {
        self.count > 0.0
    }

    /// Returns the standard deviation.
    pub(crate) fn deviation(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }
}

impl Series {
    /// Creates a series for a sparkline.
    pub(crate) fn new() -> Self {
        Self::with_capacity(SPARKLINE_BINS)
    }

    /// Creates a series of at most `capacity` bins, an even number.
    pub(crate) fn with_capacity(capacity: usize) -> Self {
        Self { bins: Vec::with_capacity(capacity), capacity, stride: 1, ticks: 0, is_sliding: false }
    }

    /// Creates a series of the last `capacity` bins, each of `stride` ticks.
    pub(crate) fn sliding(capacity: usize, stride: u64) -> Self {
        Self { stride, is_sliding: true, ..Self::with_capacity(capacity) }
    }

    /// Adds the value of the next tick. A value that is not finite counts as absent.
    pub(crate) fn add(&mut self, value: f64) {
        if self.bins.is_empty() || self.ticks == self.stride {
            if self.bins.len() == self.capacity {
                match self.is_sliding {
                    true => _ = self.bins.remove(0),
                    false => self.halve(),
                }
            }
            self.bins.push(SeriesBin::EMPTY);
            self.ticks = 0;
        }
        self.ticks += 1;
        if let Some(bin) = self.bins.last_mut().filter(|_| value.is_finite()) {
            *bin = bin.merge(SeriesBin::of(value));
        }
    }

    fn halve(&mut self) {
        for i in 0..self.capacity / 2 {
            self.bins[i] = self.bins[2 * i].merge(self.bins[2 * i + 1]);
        }
        self.bins.truncate(self.capacity / 2);
        self.stride *= 2;
    }

    /// Returns the bins in the order of time; all but the last have equally many ticks.
    pub(crate) fn bins(&self) -> &[SeriesBin] {
        &self.bins
    }

    /// Returns the statistics of the last `share` of the bins, at least of one.
    pub(crate) fn tail(&self, share: f64) -> SeriesBin {
        let count = (share * self.bins.len() as f64).ceil() as usize;
        let first = self.bins.len().saturating_sub(count.max(1));
        SeriesBin::merged(&self.bins[first..])
    }

    /// Draws one bar for each bin, and a blank where the value was absent.
    pub(crate) fn sparkline(&self) -> String {
        let means = || self.bins.iter().map(|bin| bin.is_present().then_some(bin.mean));
        let (low, high) = means().flatten().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        let bar = |mean: f64| {
            let height = if is_flat(low, high) { 0.0 } else { (mean - low) / (high - low) };
            BARS[((height * BARS.len() as f64) as usize).min(BARS.len() - 1)]
        };
        means().map(|mean| mean.map_or(' ', bar)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sparkline(values: impl IntoIterator<Item = f64>) -> String {
        let mut series = Series::new();
        values.into_iter().for_each(|value| series.add(value));
        series.sparkline()
    }

    #[test]
    fn a_sparkline_climbs_with_a_ramp_and_is_blank_where_the_value_is_absent() {
        assert_eq!(sparkline((0..8).map(f64::from)), "▁▂▃▄▅▆▇█");
        assert_eq!(sparkline([1.0, f64::NAN, 2.0]), "▁ █");
        assert_eq!(sparkline([3.0; 4]), "▁▁▁▁");
        assert_eq!(sparkline([0.3, 0.1 + 0.2, 0.3]), "▁▁▁");
        assert_eq!(sparkline([f64::NAN; 3]), "   ");
    }

    #[test]
    fn a_long_run_keeps_its_shape() {
        let long = sparkline((0..100_000).map(f64::from));
        assert!((SPARKLINE_BINS / 2..=SPARKLINE_BINS).contains(&long.chars().count()));
        assert!(long.starts_with('▁') && long.ends_with('█'));
        assert!(long.chars().is_sorted());
    }

    #[test]
    fn mean_and_deviation_are_those_of_all_values_however_the_points_were_joined() {
        let values: Vec<f64> = (0..1000).map(|i| 1e6 + f64::from(i * i % 17)).collect();
        let mut series = Series::with_capacity(16);
        values.iter().for_each(|value| series.add(*value));
        let mean = values.iter().sum::<f64>() / 1000.0;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 1000.0;
        let whole = series.tail(1.0);
        assert!((whole.mean - mean).abs() < 1e-9 * mean, "{} {mean}", whole.mean);
        assert!((whole.deviation() - variance.sqrt()).abs() < 1e-6, "{} {}", whole.deviation(), variance.sqrt());
        assert_eq!((whole.low, whole.high), (1e6, 1e6 + 16.0));
    }

    #[test]
    fn a_sliding_series_has_the_last_ticks() {
        let mut series = Series::sliding(4, 10);
        (0..95).for_each(|i| series.add(f64::from(i)));
        let bins: Vec<[f64; 2]> = series.bins().iter().map(|bin| [bin.low, bin.high]).collect();
        assert_eq!(bins, [[60.0, 69.0], [70.0, 79.0], [80.0, 89.0], [90.0, 94.0]]);
    }

    #[test]
    fn the_tail_is_the_end_and_values_that_are_not_finite_are_absent() {
        let mut series = Series::with_capacity(10);
        [1.0, 1.0, 1.0, 1.0, f64::INFINITY, 5.0, 7.0].into_iter().for_each(|value| series.add(value));
        assert_eq!(series.tail(0.25).mean, 6.0);
        let whole = series.tail(1.0);
        assert!(whole.high == 7.0 && (whole.mean - 16.0 / 6.0).abs() < 1e-12, "{whole:?}");
        assert!(!series.bins()[4].is_present());
        assert!(!Series::new().tail(0.2).is_present(), "a run of no ticks");
    }
}
