//! The course of a value over a run, in one line of text.

/// Bars from low to high.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Points that are kept at the most; half as many are drawn at least.
const ROOM: usize = 48;

/// A value over time in a fixed number of points, however long the run is: when they are full, two become one.
#[derive(Debug, Clone)]
pub(super) struct Course {
    /// Sum and number of the values of each point.
    points: Vec<(f64, u32)>,
    /// Ticks in a point.
    stride: u64,
    /// Ticks in the last point.
    ticks: u64,
}

impl Course {
    pub(super) fn new() -> Self {
        Self { points: Vec::with_capacity(ROOM), stride: 1, ticks: 0 }
    }

    /// The value of the next tick; NaN for none.
    pub(super) fn add(&mut self, value: f64) {
        if self.points.is_empty() || self.ticks == self.stride {
            if self.points.len() == ROOM {
                self.halve();
            }
            self.points.push((0.0, 0));
            self.ticks = 0;
        }
        self.ticks += 1;
        if let Some((sum, count)) = self.points.last_mut().filter(|_| !value.is_nan()) {
            *sum += value;
            *count += 1;
        }
    }

    fn halve(&mut self) {
        for i in 0..ROOM / 2 {
            let ((a, m), (b, n)) = (self.points[2 * i], self.points[2 * i + 1]);
            self.points[i] = (a + b, m + n);
        }
        self.points.truncate(ROOM / 2);
        self.stride *= 2;
    }

    /// The line: a bar a point, a blank where there was no value.
    pub(super) fn line(&self) -> String {
        let means = || self.points.iter().map(|(sum, count)| (*count > 0).then(|| sum / f64::from(*count)));
        let (low, high) = means().flatten().fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        // What differs by rounding alone is flat.
        let is_flat = high - low <= 1e-12 + 1e-9 * high.abs().max(low.abs());
        let bar = |mean: f64| {
            let height = if is_flat { 0.0 } else { (mean - low) / (high - low) };
            BARS[((height * BARS.len() as f64) as usize).min(BARS.len() - 1)]
        };
        means().map(|mean| mean.map_or(' ', bar)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(values: impl IntoIterator<Item = f64>) -> String {
        let mut course = Course::new();
        values.into_iter().for_each(|value| course.add(value));
        course.line()
    }

    #[test]
    fn a_ramp_climbs_and_absence_is_blank() {
        assert_eq!(line((0..8).map(f64::from)), "▁▂▃▄▅▆▇█");
        assert_eq!(line([1.0, f64::NAN, 2.0]), "▁ █");
        assert_eq!(line([3.0; 4]), "▁▁▁▁");
        assert_eq!(line([0.3, 0.1 + 0.2, 0.3]), "▁▁▁");
        assert_eq!(line([f64::NAN; 3]), "   ");
    }

    #[test]
    fn a_long_run_keeps_its_shape() {
        let long = line((0..100_000).map(f64::from));
        assert!((ROOM / 2..=ROOM).contains(&long.chars().count()));
        assert!(long.starts_with('▁') && long.ends_with('█'));
        assert!(long.chars().is_sorted());
    }
}
