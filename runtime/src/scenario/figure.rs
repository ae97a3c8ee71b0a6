//! What the figures of a scenario are, and the bounds on them.

use crate::node::Param;

/// A figure of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum Figure {
    /// Time at which the value has settled [s].
    Response,
    /// Distance between the steady state and the target.
    Error,
    /// Mean.
    Mean,
    /// Standard deviation.
    Std,
    /// Maximum.
    Max,
    /// Minimum.
    Min,
    /// Last value minus the first.
    Change,
    /// Distance between the first value and the last.
    Return,
    /// Total time in which a flag is absent or not set [s].
    Lost,
    /// Total time outside a mode after it was reached [s].
    Away,
    /// Whether the run ends in the expected mode: 1 or 0.
    Ends,
}

impl Figure {
    /// Returns the name of the figure in tables.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::CONTENTS.words[self as usize].0
    }

    /// Whether the figure is a time.
    #[must_use]
    pub const fn is_time(self) -> bool {
        matches!(self, Self::Response | Self::Lost | Self::Away)
    }

    /// Whether a larger value is better.
    pub(super) const fn is_better_high(self) -> bool {
        matches!(self, Self::Min | Self::Ends)
    }
}

/// The bound on a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bound {
    /// No bound: the figure is informational.
    None,
    /// The value settles in every run.
    Settles,
    /// The median over the runs is at most this.
    Median(f64),
    /// The figure is at most this in every run.
    AtMost(f64),
    /// The figure is at least this in every run.
    AtLeast(f64),
    /// The distance of the figure from `target` is at most `tolerance` in every run.
    Near {
        /// The expected value.
        target: f64,
        /// The largest error.
        tolerance: f64,
    },
}
