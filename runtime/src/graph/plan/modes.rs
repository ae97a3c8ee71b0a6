//! The modes of a graph: conditions and configurations.

use std::ops::Range;

use super::port::PortRef;
use crate::graph::syntax::{ExitKind, PortState};

/// The modes of a graph.
pub(crate) struct PlannedModes {
    pub(crate) modes: Vec<PlannedMode>,
    /// Index of the start mode.
    pub(crate) start: usize,
}

/// A mode with its exits resolved.
pub(crate) struct PlannedMode {
    pub(crate) name: String,
    pub(crate) exits: Vec<PlannedExit>,
    /// Nodes that this mode changes: their index in step order, and the number of their configuration.
    pub(crate) configurations: Vec<(usize, usize)>,
}

/// An exit of a mode.
#[derive(Debug, Clone)]
pub(crate) struct PlannedExit {
    pub(crate) kind: ExitKind,
    /// Index of the target mode, or `None` if the exit ends the run.
    pub(crate) to: Option<usize>,
    pub(crate) condition: Condition,
    /// How long the condition must hold [ns].
    pub(crate) lasts: i64,
    pub(crate) priority: u64,
    /// The condition as text.
    pub(crate) text: String,
    /// Where the exit was written.
    pub(crate) span: Range<usize>,
}

/// The condition of an exit.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Condition {
    /// A test of a port, or of one feature of it.
    Port(WatchedPort, Test),
    /// The time in the mode reaches a bound [ns].
    Elapsed(i64),
    /// The distance that the origin of a pose travels in the mode exceeds a bound [m].
    Travel(PortRef, f64),
    /// The operator sent a word.
    Sent(String),
    /// No new sample of a signal was true for this long [ns].
    Lost(WatchedPort, i64),
}

impl Condition {
    /// Returns the port that it watches.
    pub(crate) const fn port(&self) -> Option<PortRef> {
        match self {
            Self::Port(watched, _) | Self::Lost(watched, _) => Some(watched.source),
            Self::Travel(pose, _) => Some(*pose),
            Self::Elapsed(_) | Self::Sent(_) => None,
        }
    }
}

/// A port, or one feature of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct WatchedPort {
    pub(crate) source: PortRef,
    pub(crate) feature: Option<usize>,
}

/// The test of a port.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Test {
    Is(PortState),
    /// The number is between `min` and `max`; it then stays so until it is outside by more than `hysteresis`.
    Between {
        min: f64,
        max: f64,
        hysteresis: f64,
    },
}
