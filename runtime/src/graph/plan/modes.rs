//! The modes of a graph as the tick needs them: conditions and configurations.

use std::ops::Range;

use super::port::PortRef;
use crate::graph::syntax::Sort;

/// The modes of a graph.
pub(crate) struct PlannedModes {
    pub(crate) modes: Vec<PlannedMode>,
    /// The one it starts in.
    pub(crate) start: usize,
}

/// A mode that is checked.
pub(crate) struct PlannedMode {
    pub(crate) name: String,
    pub(crate) exits: Vec<PlannedExit>,
    /// The nodes that have a configuration of its own: by their place in the order of the steps, with its number.
    pub(crate) configurations: Vec<(usize, usize)>,
}

/// What ends a mode.
#[derive(Debug, Clone)]
pub(crate) struct PlannedExit {
    pub(crate) sort: Sort,
    /// Mode to go to.
    pub(crate) to: Option<usize>,
    pub(crate) condition: Condition,
    /// How long it has to last [ns].
    pub(crate) lasts: i64,
    pub(crate) priority: u64,
    /// The condition in words.
    pub(crate) text: String,
    /// Where it stands.
    pub(crate) span: Range<usize>,
}

/// What is looked at.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Condition {
    /// A port, or one feature of it.
    Port(Watched, Test),
    /// Time in the mode [ns].
    Elapsed(i64),
    /// Way of a pose's origin in the mode [m].
    Travel(PortRef, f64),
    /// A word from outside.
    Sent(String),
    /// A signal that has not said yes for so long [ns].
    Lost(Watched, i64),
}

/// A port, or a feature of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Watched {
    pub(crate) source: PortRef,
    pub(crate) feature: Option<usize>,
}

/// What a value has to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Test {
    New,
    Absent,
    Present,
    /// A flag has to be so.
    Flag(bool),
    /// A number has to be in between; once it is, it may leave by the hysteresis.
    Between {
        least: f64,
        greatest: f64,
        hysteresis: f64,
    },
}
