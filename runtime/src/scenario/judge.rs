//! Combines the figures of many runs: the median, the worst, a confidence interval, and whether the bound is met.

use serde::Serialize;

use super::figure::{Bound, Figure};

/// The verdict on a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The figure is within its bound.
    Passed,
    /// The figure is outside its bound, or could not be measured.
    Failed,
    /// The figure has no bound.
    Informational,
}

/// One figure of a scenario over all runs.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureRow {
    /// Name of the check.
    pub check: String,
    /// The port or the mode that is checked.
    pub of: String,
    /// The mode to which the check is restricted.
    pub during: Option<String>,
    /// The mode or the flag that ends the check.
    pub until: Option<String>,
    /// The figure.
    pub figure: Figure,
    /// Unit of the figure.
    pub unit: String,
    /// The bound.
    pub bound: Bound,
    /// The value from the paper, if it reports one.
    pub paper: Option<f64>,
    /// The value that the task should reach, if there is one.
    pub goal: Option<f64>,
    /// Why it does not reach its goal.
    pub missed: Option<String>,
    /// The figure of each run, in the order of the seeds; `None` if it could not be measured.
    pub values: Vec<Option<f64>>,
    /// Number of runs without a tick to check, for example because the mode of `during` was never reached.
    pub not_checked: usize,
}

impl FigureRow {
    /// Returns the values from best to worst. A value that could not be measured is the worst.
    fn sorted(&self) -> Vec<f64> {
        let sign = if self.figure.is_better_high() { -1.0 } else { 1.0 };
        let mut values: Vec<f64> = self.values.iter().map(|v| v.map_or(f64::INFINITY, |v| sign * v)).collect();
        values.sort_by(f64::total_cmp);
        values.iter().map(|value| sign * value).collect()
    }

    /// Returns the median over the runs, or `None` if it falls among the runs that could not be measured.
    #[must_use]
    pub fn median(&self) -> Option<f64> {
        let sorted = self.sorted();
        let (low, high) = (sorted.get(sorted.len().saturating_sub(1) / 2)?, sorted.get(sorted.len() / 2)?);
        Some((low + high) / 2.0).filter(|median| median.is_finite())
    }

    /// Returns the worst value of all runs, or `None` if one of them could not be measured. The worst change is the one
    /// that is farthest from its target.
    #[must_use]
    pub fn worst(&self) -> Option<f64> {
        if let Bound::Near { target, .. } = self.bound {
            let values: Option<Vec<f64>> = self.values.iter().copied().collect();
            return values?.into_iter().max_by(|a, b| (a - target).abs().total_cmp(&(b - target).abs()));
        }
        self.sorted().last().copied().filter(|worst| worst.is_finite())
    }

    /// Returns the number of runs in which the figure could not be measured.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.values.iter().filter(|value| value.is_none()).count()
    }

    /// Returns a confidence interval of at least 95 % for the median over all possible seeds, the smaller number first.
    ///
    /// The interval lies between two order statistics, so it holds for every distribution. An end that could not be
    /// measured is infinite. Returns `None` for fewer than six runs.
    #[must_use]
    pub fn interval(&self) -> Option<(f64, f64)> {
        let sorted = self.sorted();
        let skipped = skipped(sorted.len())?;
        let (good, bad) = (sorted[skipped], sorted[sorted.len() - 1 - skipped]);
        Some((good.min(bad), good.max(bad)))
    }

    /// Returns the value to compare with the goal: the median, or the worst of all runs for a maximum or a minimum.
    #[must_use]
    pub fn reached(&self) -> Option<f64> {
        if matches!(self.figure, Figure::Max | Figure::Min) { self.worst() } else { self.median() }
    }

    /// Returns the goal that the figure does not reach.
    #[must_use]
    pub fn missed_goal(&self) -> Option<f64> {
        let goal = self.goal?;
        let is_reached = |value: f64| if self.figure.is_better_high() { value >= goal } else { value <= goal };
        (!self.reached().is_some_and(is_reached)).then_some(goal)
    }

    /// Compares the figure with its bound. A run without a tick to check fails, even if the figure has no bound.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        if self.not_checked > 0 {
            return Verdict::Failed;
        }
        let every = |holds: &dyn Fn(f64) -> bool| self.values.iter().all(|value| value.is_some_and(holds));
        let has_passed = match self.bound {
            Bound::None => return Verdict::Informational,
            Bound::Settles => every(&|_| true),
            Bound::Median(bound) => self.median().is_some_and(|median| median <= bound),
            Bound::AtMost(bound) => every(&|value| value <= bound),
            Bound::AtLeast(bound) => every(&|value| value >= bound),
            Bound::Near { target, tolerance } => every(&|value| (value - target).abs() <= tolerance),
        };
        if has_passed && !self.values.is_empty() { Verdict::Passed } else { Verdict::Failed }
    }
}

/// Returns how many order statistics can be skipped at each end of `count` so that the interval between the next two
/// still contains the median with at least 95 %. Each sample lies below the median with a probability of one half.
fn skipped(count: usize) -> Option<usize> {
    /// Above this count, the normal approximation replaces the binomial distribution, whose smallest terms underflow.
    const MAX_BINOMIAL_COUNT: usize = 1000;
    if count > MAX_BINOMIAL_COUNT {
        return Some(((count as f64 - 2.0 * (count as f64).sqrt()) / 2.0) as usize - 1);
    }
    // `exactly` is the probability that exactly k samples lie below the median.
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

    fn row(figure: Figure, bound: Bound, values: &[f64]) -> FigureRow {
        let values = values.iter().map(|value| Some(*value).filter(|value| !value.is_nan())).collect();
        let (check, of, unit) = ("x".into(), "a.b".into(), "m".into());
        let (during, until, paper, goal, missed) = (None, None, None, None, None);
        FigureRow { check, of, during, until, figure, unit, bound, paper, goal, missed, values, not_checked: 0 }
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
    fn the_interval_is_the_shortest_that_contains_the_median_with_95_percent() {
        // From tables of the sign test: with ten samples, the interval lies between the second and the ninth.
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
    fn a_figure_passes_within_its_bound_and_fails_outside_it() {
        use Bound::{AtLeast, AtMost, Median, Near, None, Settles};
        use Figure::{Change, Max, Min, Response, Std};
        use Verdict::{Failed, Informational, Passed};
        const NEVER: f64 = f64::NAN;
        const CHANGE: Bound = Near { target: -2.0, tolerance: 0.5 };
        let cases: [(Figure, Bound, &[f64], Verdict); 16] = [
            (Std, None, &[NEVER], Informational),
            (Std, Median(2.0), &[1.0, 2.0, 9.0], Passed),
            (Std, Median(1.9), &[1.0, 2.0, 9.0], Failed),
            (Response, Median(1.0), &[0.5, 0.5, NEVER], Passed),
            (Response, Median(1.0), &[0.5, NEVER, NEVER], Failed),
            (Response, Settles, &[0.5, 9.0], Passed),
            (Response, Settles, &[0.5, NEVER], Failed),
            (Max, AtMost(1.0), &[0.5, 1.0], Passed),
            (Max, AtMost(1.0), &[0.5, 1.1], Failed),
            (Min, AtLeast(1.0), &[1.0, 1.0], Passed),
            (Min, AtLeast(1.0), &[1.0, NEVER], Failed),
            (Std, Median(1.0), &[], Failed),
            (Change, CHANGE, &[-2.5, -1.5], Passed),
            (Change, CHANGE, &[-2.5, -1.4], Failed),
            (Change, CHANGE, &[-2.6, -1.5], Failed),
            (Change, CHANGE, &[-2.0, NEVER], Failed),
        ];
        for (figure, bound, values, verdict) in cases {
            assert_eq!(row(figure, bound, values).verdict(), verdict, "{figure:?} {bound:?} {values:?}");
            let empty = FigureRow { not_checked: 1, ..row(figure, bound, values) };
            assert_eq!(empty.verdict(), Failed, "{figure:?} {bound:?} in a run without a tick to check");
        }
    }

    #[test]
    fn a_goal_is_compared_with_the_median_and_that_of_an_extreme_with_the_worst_run() {
        let missed = |figure: Figure, values: &[f64], goal: f64| {
            let row = FigureRow { goal: Some(goal), ..row(figure, Bound::None, values) };
            row.missed_goal()
        };
        assert_eq!(missed(Figure::Std, &[1.0, 2.0, 9.0], 2.0), None);
        assert_eq!(missed(Figure::Std, &[1.0, 2.0, 9.0], 1.9), Some(1.9));
        assert_eq!(missed(Figure::Response, &[0.5, f64::NAN, f64::NAN], 1.0), Some(1.0));
        assert_eq!(missed(Figure::Max, &[1.0, 2.0], 1.5), Some(1.5));
        assert_eq!(missed(Figure::Min, &[1.0, 2.0], 0.9), None);
        assert_eq!(missed(Figure::Min, &[1.0, 2.0], 1.1), Some(1.1));
        assert_eq!(row(Figure::Std, Bound::None, &[1.0]).missed_goal(), None, "without a goal");
    }

    #[test]
    fn the_worst_change_is_the_farthest_from_its_target() {
        let near = |target: f64, values: &[f64]| {
            let row = row(Figure::Change, Bound::Near { target, tolerance: 1.0 }, values);
            (row.median(), row.worst())
        };
        assert_eq!(near(-2.0, &[-3.5, -2.0, 0.0]), (Some(-2.0), Some(0.0)));
        assert_eq!(near(-1.0, &[-3.5, -2.0, 0.0]), (Some(-2.0), Some(-3.5)));
        assert_eq!(near(-1.0, &[-3.5, f64::NAN, 0.0]), (Some(0.0), None));
    }
}
