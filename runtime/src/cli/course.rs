//! The course of a value over a run, in bounded memory.

/// Bars from low to high.
const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// Points that are kept for a line, at the most; half as many are drawn at least.
const ROOM: usize = 48;

/// A value over time in a fixed number of points, however long the run is: when they are full, two become one.
#[derive(Debug, Clone)]
pub(super) struct Course {
    points: Vec<Point>,
    room: usize,
    /// Ticks in a point.
    stride: u64,
    /// Ticks in the last point.
    ticks: u64,
}

/// What a value did in some ticks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Point {
    /// In how many of them it was there.
    count: f64,
    pub(super) mean: f64,
    /// Sum of the squared distances from the mean.
    squares: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Point {
    const NOTHING: Self = Self { count: 0.0, mean: 0.0, squares: 0.0, low: f64::INFINITY, high: f64::NEG_INFINITY };

    const fn of(value: f64) -> Self {
        Self { count: 1.0, mean: value, squares: 0.0, low: value, high: value }
    }

    /// Both together: without the cancellation that a sum of squares would have.
    fn and(self, other: Self) -> Self {
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

    /// Whether the value was there at all.
    pub(super) fn is_there(&self) -> bool {
        self.count > 0.0
    }

    /// Standard deviation.
    pub(super) fn deviation(&self) -> f64 {
        (self.squares / self.count).sqrt()
    }
}

impl Course {
    pub(super) fn new() -> Self {
        Self::with_room(ROOM)
    }

    /// One of as many points at the most, an even number.
    pub(super) fn with_room(room: usize) -> Self {
        Self { points: Vec::with_capacity(room), room, stride: 1, ticks: 0 }
    }

    /// The value of the next tick; what is no finite number is none.
    pub(super) fn add(&mut self, value: f64) {
        if self.points.is_empty() || self.ticks == self.stride {
            if self.points.len() == self.room {
                self.halve();
            }
            self.points.push(Point::NOTHING);
            self.ticks = 0;
        }
        self.ticks += 1;
        if let Some(point) = self.points.last_mut().filter(|_| value.is_finite()) {
            *point = point.and(Point::of(value));
        }
    }

    fn halve(&mut self) {
        for i in 0..self.room / 2 {
            self.points[i] = self.points[2 * i].and(self.points[2 * i + 1]);
        }
        self.points.truncate(self.room / 2);
        self.stride *= 2;
    }

    /// The points, which follow each other at equal distances.
    pub(super) fn points(&self) -> &[Point] {
        &self.points
    }

    /// What it did in the last share of its points, at least in one.
    pub(super) fn tail(&self, share: f64) -> Point {
        let count = (share * self.points.len() as f64).ceil() as usize;
        let first = self.points.len().saturating_sub(count.max(1));
        self.points[first..].iter().fold(Point::NOTHING, |all, point| all.and(*point))
    }

    /// The line: a bar a point, a blank where there was no value.
    pub(super) fn line(&self) -> String {
        let means = || self.points.iter().map(|point| point.is_there().then_some(point.mean));
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

    #[test]
    fn mean_and_deviation_are_those_of_all_values_however_the_points_were_joined() {
        let values: Vec<f64> = (0..1000).map(|i| 1e6 + f64::from(i * i % 17)).collect();
        let mut course = Course::with_room(16);
        values.iter().for_each(|value| course.add(*value));
        let mean = values.iter().sum::<f64>() / 1000.0;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 1000.0;
        let whole = course.tail(1.0);
        assert!((whole.mean - mean).abs() < 1e-9 * mean, "{} {mean}", whole.mean);
        assert!((whole.deviation() - variance.sqrt()).abs() < 1e-6, "{} {}", whole.deviation(), variance.sqrt());
        assert_eq!((whole.low, whole.high), (1e6, 1e6 + 16.0));
    }

    #[test]
    fn the_tail_is_the_end_and_what_is_not_finite_is_not_there() {
        let mut course = Course::with_room(10);
        [1.0, 1.0, 1.0, 1.0, f64::INFINITY, 5.0, 7.0].into_iter().for_each(|value| course.add(value));
        assert_eq!(course.tail(0.25).mean, 6.0);
        let whole = course.tail(1.0);
        assert!(whole.high == 7.0 && (whole.mean - 16.0 / 6.0).abs() < 1e-12, "{whole:?}");
        assert!(!course.points()[4].is_there());
        assert!(!Course::new().tail(0.2).is_there(), "a run of no ticks");
    }
}
