//! The tasks of a graph: the graph itself, and the parts that are tasks.

use super::modes::PlannedModes;
use super::port::{PlannedPort, PortRef};
use crate::graph::syntax::PolicyTable;

/// The graph itself, or a part that is a task.
pub(crate) struct PlannedTask {
    /// Its full name; empty for the graph itself.
    pub(crate) name: String,
    /// The task that contains it.
    pub(crate) parent: Option<usize>,
    pub(crate) modes: Option<PlannedModes>,
    /// The flags of its modes that the run provides: the number of the mode, and the port.
    pub(crate) flags: Vec<(usize, PortRef, PlannedPort)>,
    pub(crate) policy: PolicyTable,
    /// Whether it has commands or modes, so that the run waits for its end.
    pub(crate) is_active: bool,
    /// Whether its failure ends the run.
    pub(crate) ends_run: bool,
    /// Maximum time step between two samples; longer gaps count as this long [s].
    pub(crate) max_gap: f64,
    /// How long an input must be absent before the state of its node is reset [ns].
    pub(crate) reset_after: i64,
}

/// The tasks that a trouble concerns: those with a node or a command downstream of it.
///
/// It is empty for a graph with one task, which every trouble concerns.
#[derive(Debug, Clone, Default)]
pub(crate) struct Reach {
    /// Of each role.
    pub(crate) roles: Vec<Vec<usize>>,
    /// Of each node, in step order.
    pub(crate) nodes: Vec<Vec<usize>>,
}
