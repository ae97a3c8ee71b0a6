//! What a check hands to the engine: everything looked up, built and in order.

mod modes;
mod port;
mod view;

use std::ops::Range;

use crate::device::{Description, Driver};
use crate::graph::syntax::{Age, Policy, PolicyTable};
use crate::node::{AnyNode, Need};
use crate::signal::Shape;

pub(crate) use modes::{Condition, PlannedExit, PlannedMode, PlannedModes, Test, Watched};
pub use port::PlannedPort;
pub(crate) use port::{PortRef, Producer};
pub(crate) use view::{PlannedShow, PlannedView};

/// A role and the device that fills it.
pub(crate) struct PlannedRole {
    pub(crate) name: String,
    /// Index of the device.
    pub(crate) device: usize,
    /// Number of each of the role's outputs among those of the device.
    pub(crate) numbers: Vec<usize>,
    pub(crate) ports: Vec<PlannedPort>,
    /// How old the newest sample may be [ns], and what it does when it is older.
    pub(crate) max_age: i64,
    pub(crate) stale: Policy,
    /// Whether only a scenario and the recorder read it, so that a run goes on without it.
    pub(crate) is_observed: bool,
    /// Nominal time between two samples of the device [ns].
    pub(crate) period: i64,
}

/// A device, opened.
pub(crate) struct PlannedDevice {
    pub(crate) name: String,
    pub(crate) driver: Driver,
    pub(crate) description: Description,
    /// Where its name stands in the bench.
    pub(crate) span: Range<usize>,
}

/// Where a wire comes from, and how old what comes over it may be.
#[derive(Debug, Clone)]
pub(crate) struct PlannedWire {
    pub(crate) source: PortRef,
    pub(crate) age: Option<Age>,
    /// Where it is written.
    pub(crate) span: Range<usize>,
}

/// A node, built.
pub(crate) struct PlannedNode {
    /// Its index in the flat graph, by which wires know it.
    pub(crate) index: usize,
    pub(crate) name: String,
    pub(crate) node: Box<dyn AnyNode>,
    pub(crate) inputs: Vec<(Need, Vec<PlannedWire>)>,
    pub(crate) ports: Vec<PlannedPort>,
    pub(crate) is_every_tick: bool,
    /// Whether the tool logs its inputs; see [`Node::LOGS`](crate::node::Node::LOGS).
    pub(crate) is_logged: bool,
    /// The limits it holds; each has an output of that name.
    pub(crate) holds: &'static [&'static str],
    /// Where its name stands.
    pub(crate) span: Range<usize>,
}

/// A command of a device, and what drives it.
pub(crate) struct PlannedCommand {
    pub(crate) source: PortRef,
    pub(crate) device: usize,
    /// Its number among the device's commands.
    pub(crate) command: usize,
    /// Names of the role and of the command.
    pub(crate) name: [String; 2],
    /// How old it may be, and what more than a ramp is done when it is older.
    pub(crate) age: Age,
    /// Where its wire is written.
    pub(crate) span: Range<usize>,
    /// Greatest acceleration of each joint [rad/s²]; infinite where nothing bounds it.
    pub(crate) accelerations: Vec<f64>,
}

/// What a device is told without moving it.
pub(crate) struct PlannedReport {
    pub(crate) source: PortRef,
    /// Shape of what the wire brings.
    pub(crate) shape: Shape,
    pub(crate) device: usize,
    /// Its number among the device's reports.
    pub(crate) report: usize,
    /// Names of the role and of the report.
    pub(crate) name: [String; 2],
    /// How old it may be, and what more than falling silent is done when it is older.
    pub(crate) age: Age,
    /// Where its wire is written.
    pub(crate) span: Range<usize>,
}

/// What makes the graph tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Clock {
    /// The samples of a device.
    Device(usize),
    /// A rate.
    Rate,
}

/// A graph that is checked and built: it cannot fail to wire.
pub(crate) struct Plan {
    pub(crate) roles: Vec<PlannedRole>,
    pub(crate) devices: Vec<PlannedDevice>,
    /// In the order in which they step.
    pub(crate) nodes: Vec<PlannedNode>,
    pub(crate) commands: Vec<PlannedCommand>,
    pub(crate) reports: Vec<PlannedReport>,
    pub(crate) clock: Clock,
    /// Nominal time between two ticks [ns].
    pub(crate) period: i64,
    /// Greatest time between two samples that counts as one step [s].
    pub(crate) max_gap: f64,
    /// How long something must be absent before the state behind it is reset [ns].
    pub(crate) reset_after: i64,
    pub(crate) modes: Option<PlannedModes>,
    pub(crate) policy: PolicyTable,
}
