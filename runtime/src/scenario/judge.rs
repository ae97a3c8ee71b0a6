//! What many runs say together: the median, the worst, an interval, and whether that will do.

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// When it has settled [s].
    Response,
    /// How far the steady state is from what it shall settle to.
    Error,
    /// Its mean.
    Mean,
    /// Its standard deviation.
    Std,
    /// Its greatest value.
    Max,
    /// Its least value.
    Min,
    /// How long a flag is lost [s].
    Lost,
    /// How long the run is out of a mode that it had reached [s].
    Away,
    /// Whether the run ends as it should: 1 or 0.
    Ends,
}

impl Figure {
    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Response => "response",
            Self::Error => "error",
            Self::Mean => "mean",
            Self::Std => "std",
            Self::Max => "max",
            Self::Min => "min",
            Self::Lost => "lost",
            Self::Away => "away",
            Self::Ends => "ends",
        }
    }

    /// Whether it is a time.
    #[must_use]
    pub const fn is_time(self) -> bool {
        matches!(self, Self::Response | Self::Lost | Self::Away)
    }

    /// Whether less is worse.
    const fn is_better_high(self) -> bool {
        matches!(self, Self::Min | Self::Ends)
    }
}

/// What is asked of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// Nothing: it is told.
    None,
    /// That it is there in every run: it settles.
    Settles,
    /// That the median over the runs is at most so much.
    Median(f64),
    /// That it is at most so much in every run.
    AtMost(f64),
    /// That it is at least so much in every run.
    AtLeast(f64),
}

impl Bound {
    /// The number, if there is one.
    #[must_use]
    pub const fn number(self) -> Option<f64> {
        match self {
            Self::None | Self::Settles => None,
            Self::Median(bound) | Self::AtMost(bound) | Self::AtLeast(bound) => Some(bound),
        }
    }
}

/// What becomes of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// It is as asked.
    Met,
    /// It is not.
    Missed,
    /// Nothing was asked.
    Told,
}

/// One figure of a scenario over all runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the check.
    pub check: String,
    /// The port, or the mode.
    pub of: String,
    /// What is measured.
    pub figure: Figure,
    /// Its unit.
    pub unit: String,
    /// What is asked.
    pub bound: Bound,
    /// What the paper reports.
    pub paper: Option<f64>,
    /// The figure in each run, in the order of the seeds; none where it could not be measured.
    pub values: Vec<Option<f64>>,
}

impl Row {
    /// The values from good to bad; what could not be measured is as bad as can be.
    fn sorted(&self) -> Vec<f64> {
        let sign = if self.figure.is_better_high() { -1.0 } else { 1.0 };
        let mut values: Vec<f64> = self.values.iter().map(|v| v.map_or(f64::INFINITY, |v| sign * v)).collect();
        values.sort_by(f64::total_cmp);
        values.iter().map(|value| sign * value).collect()
    }

    /// Median over the runs; none if it lies among those that could not be measured.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let sorted = self.sorted();
        let (low, high) = (sorted.get(sorted.len().saturating_sub(1) / 2)?, sorted.get(sorted.len() / 2)?);
        Some((low + high) / 2.0).filter(|median| median.is_finite())
    }

    /// The worst of all runs; none if it could not be measured in one of them.
    #[must_use]
    pub fn worst(&self) -> Option<f64> {
        self.sorted().last().copied().filter(|worst| worst.is_finite())
    }

    /// How many runs it could not be measured in.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.values.iter().filter(|value| value.is_none()).count()
    }

    /// An interval, the lesser number first, in which the median of all seeds there are lies with at least 95 %, whatever
    /// the distribution: between two order statistics. An end that could not be measured is infinite; with fewer than six
    /// runs there is no such interval.
    #[must_use]
    pub fn interval(&self) -> Option<(f64, f64)> {
        let sorted = self.sorted();
        let skipped = skipped(sorted.len())?;
        let (good, bad) = (sorted[skipped], sorted[sorted.len() - 1 - skipped]);
        Some((good.min(bad), good.max(bad)))
    }

    /// Whether it is as asked.
    #[must_use]
    pub fn mark(&self) -> Mark {
        let every = |holds: &dyn Fn(f64) -> bool| self.values.iter().all(|value| value.is_some_and(holds));
        let is_met = match self.bound {
            Bound::None => return Mark::Told,
            Bound::Settles => every(&|_| true),
            Bound::Median(bound) => self.median().is_some_and(|median| median <= bound),
            Bound::AtMost(bound) => every(&|value| value <= bound),
            Bound::AtLeast(bound) => every(&|value| value >= bound),
        };
        if is_met && !self.values.is_empty() { Mark::Met } else { Mark::Missed }
    }
}

/// As many order statistics may be left out at each end of `count` so that the interval between the next two still holds
/// the median with at least 95 %: each lies below it with one half.
fn skipped(count: usize) -> Option<usize> {
    /// Above this the binomial is as good as normal, and its least terms are no numbers any more.
    const MANY: usize = 1000;
    if count > MANY {
        return Some(((count as f64 - 2.0 * (count as f64).sqrt()) / 2.0) as usize - 1);
    }
    // Probability that exactly k of them lie below the median, summed from below.
    let mut exactly = 0.5f64.powi(count as i32);
    let (mut below, mut skipped) = (0.0, None);
    for k in 0..count / 2 {
        below += exactly;
        if 2.0 * below > 0.05 {
            break;
        }
        skipped = Some(k);
        exactly *= (count - k) as f64 / (k + 1) as f64;
    }
    skipped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(figure: Figure, bound: Bound, values: &[f64]) -> Row {
        let values = values.iter().map(|value| Some(*value).filter(|value| !value.is_nan())).collect();
        Row { check: "x".into(), of: "a.b".into(), figure, unit: "m".into(), bound, paper: None, values }
    }

    #[test]
    fn medians_and_the_worst() {
        const NONE: f64 = f64::NAN;
        type Case = (Figure, &'static [f64], Option<f64>, Option<f64>);
        let cases: [Case; 8] = [
            (Figure::Std, &[3.0, 1.0, 2.0], Some(2.0), Some(3.0)),
            (Figure::Std, &[4.0, 1.0, 2.0, 3.0], Some(2.5), Some(4.0)),
            (Figure::Min, &[3.0, 1.0, 2.0], Some(2.0), Some(1.0)),
            (Figure::Std, &[NONE, 1.0, 2.0], Some(2.0), None),
            (Figure::Min, &[NONE, 1.0, 2.0], Some(1.0), None),
            (Figure::Response, &[NONE, 1.0, NONE], None, None),
            (Figure::Response, &[NONE, 1.0], None, None),
            (Figure::Response, &[], None, None),
        ];
        for (figure, values, median, worst) in cases {
            let row = row(figure, Bound::None, values);
            assert_eq!((row.median(), row.worst()), (median, worst), "{figure:?} of {values:?}");
        }
    }

    #[test]
    fn the_interval_holds_the_median_often_enough_and_no_shorter_one_does() {
        // From tables of the sign test: with ten samples, the second and the ninth.
        let cases = [
            (1, None),
            (5, None),
            (6, Some(0)),
            (8, Some(0)),
            (9, Some(1)),
            (10, Some(1)),
            (20, Some(5)),
            (100, Some(39)),
            (10_000, Some(4899)),
        ];
        for (count, expected) in cases {
            assert_eq!(skipped(count), expected, "of {count}");
        }
        let values: Vec<f64> = (1..=10).map(f64::from).collect();
        assert_eq!(row(Figure::Std, Bound::None, &values).interval(), Some((2.0, 9.0)));
        assert_eq!(row(Figure::Min, Bound::None, &values).interval(), Some((2.0, 9.0)));
        assert_eq!(row(Figure::Std, Bound::None, &values[..5]).interval(), None);
    }

    #[test]
    fn what_is_met_and_what_is_missed() {
        use Bound::{AtLeast, AtMost, Median, None, Settles};
        use Figure::{Max, Min, Response, Std};
        use Mark::{Met, Missed, Told};
        const NEVER: f64 = f64::NAN;
        let cases: [(Figure, Bound, &[f64], Mark); 12] = [
            (Std, None, &[NEVER], Told),
            (Std, Median(2.0), &[1.0, 2.0, 9.0], Met),
            (Std, Median(1.9), &[1.0, 2.0, 9.0], Missed),
            (Response, Median(1.0), &[0.5, 0.5, NEVER], Met),
            (Response, Median(1.0), &[0.5, NEVER, NEVER], Missed),
            (Response, Settles, &[0.5, 9.0], Met),
            (Response, Settles, &[0.5, NEVER], Missed),
            (Max, AtMost(1.0), &[0.5, 1.0], Met),
            (Max, AtMost(1.0), &[0.5, 1.1], Missed),
            (Min, AtLeast(1.0), &[1.0, 1.0], Met),
            (Min, AtLeast(1.0), &[1.0, NEVER], Missed),
            (Std, Median(1.0), &[], Missed),
        ];
        for (figure, bound, values, mark) in cases {
            assert_eq!(row(figure, bound, values).mark(), mark, "{figure:?} {bound:?} {values:?}");
        }
    }
}
