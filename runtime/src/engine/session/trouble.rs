//! The troubles that a tick can have.

use std::ops::Range;

use crate::engine::core::AgedWire;
use crate::graph::Policy;
use crate::node::PortId;

/// A wire whose policy stops the commands or ends the run when its value is too old.
pub(crate) struct WatchedWire {
    pub(crate) aged: AgedWire,
    /// Policy for a value that is too old.
    pub(crate) stale: Policy,
    /// The receiving node, or the role of a command or report.
    pub(crate) node: String,
    /// The command or report; `None` for a node.
    pub(crate) port: Option<String>,
    /// Position of the wire in the source.
    pub(crate) span: Range<usize>,
    pub(crate) origin: Origin,
}

/// Where a trouble comes from, which decides the tasks that it concerns.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Origin {
    /// The whole run, such as its clock.
    Run,
    /// A role, by its index.
    Role(usize),
    /// A node, by the index of its runner.
    Runner(usize),
    /// A device, by its index.
    Device(usize),
    /// A task, by its index.
    Task(usize),
}

/// A budget of a limiter.
pub(crate) struct WatchedBudget {
    /// The role whose commands pass the limiter.
    pub(crate) role: String,
    /// Index of the limiter's runner.
    pub(crate) runner: usize,
    /// The flag that is set while the budget is spent.
    pub(crate) flag: PortId,
    pub(crate) is_spent: bool,
}

/// A node that can end its task.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WatchedFailure {
    /// Index of its runner.
    pub(crate) runner: usize,
    /// The flag that is set once its task must not go on.
    pub(crate) flag: PortId,
}

/// A trouble of a tick, as indices: only a trouble that halts or ends the run is described as a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Trouble {
    /// The newest sample of an inlet is too old.
    Stale(usize),
    /// The value of a watched wire is too old.
    StaleWire(usize),
    /// The value of a port, or the sample of its inlet, is not finite.
    NotFinite(usize),
    /// A node panicked, or waits for its reset.
    Panicked(usize),
    /// A device has failed.
    Device(usize),
    /// A device has stopped by itself, because its commands were not renewed.
    Lease(usize),
    /// The device has reported the port of an inlet as lost.
    Lost(usize),
    /// The clock device sends no samples.
    Clock,
    /// The tick began late, by this time [ns].
    Late(i64),
    /// A node has found that its task must not go on: the index of its runner.
    Found(usize),
    /// The operator sent `stop`.
    Operator,
}

/// Returns the message of a panic.
pub(crate) fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
