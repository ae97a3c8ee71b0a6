//! The plan: what the engine needs, with all names resolved and all nodes built.

mod live;
mod modes;
mod port;
mod record;
mod tasks;
mod view;

use std::fmt;
use std::ops::Range;

use crate::device::{Description, Driver};
use crate::graph::syntax::AgeLimit;
use crate::node::{AnyNode, Need};
use crate::signal::Shape;
use crate::source::Code;

pub use live::LiveParam;
pub(crate) use live::{LivePlan, Recipe};
pub(crate) use modes::{Condition, PlannedExit, PlannedMode, PlannedModes, Test, WatchedPort};
pub use port::PlannedPort;
pub(crate) use port::{PortRef, Producer};
pub use record::RecordedPorts;
pub(crate) use record::matches;
pub(crate) use tasks::{PlannedTask, Reach};
pub(crate) use view::{PlannedShow, PlannedView};

/// A role and the device bound to it.
pub(crate) struct PlannedRole {
    pub(crate) name: String,
    /// Index of the device.
    pub(crate) device: usize,
    /// Index of each output of the role among those of the device.
    pub(crate) numbers: Vec<usize>,
    pub(crate) ports: Vec<PlannedPort>,
    /// Maximum age of the newest sample, and the reaction to an older one.
    pub(crate) age: AgeLimit,
    /// Whether the role is for scenarios and recordings only, so that a run continues without it.
    pub(crate) is_observed: bool,
    /// Nominal sample period of the device [ns].
    pub(crate) period: i64,
}

/// An opened device.
pub(crate) struct PlannedDevice {
    pub(crate) name: String,
    pub(crate) driver: Driver,
    pub(crate) description: Description,
    /// Span of its name in the bench.
    pub(crate) span: Range<usize>,
}

/// A wire: its source and its age limit.
#[derive(Debug, Clone)]
pub(crate) struct PlannedWire {
    pub(crate) source: PortRef,
    pub(crate) age: Option<AgeLimit>,
    /// Span of the text that names the source.
    pub(crate) span: Range<usize>,
}

/// The nominal times of samples.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SampleTimes {
    /// Between two samples, at least the period of the graph [s].
    pub(crate) period: f64,
    /// From a measurement until the sample arrives, as the device [states](Description::latency) [s].
    pub(crate) latency: f64,
}

impl SampleTimes {
    /// Returns the longer one of each time.
    pub(crate) fn max(self, other: Self) -> Self {
        Self { period: self.period.max(other.period), latency: self.latency.max(other.latency) }
    }
}

/// A built node.
pub(crate) struct PlannedNode {
    /// Its index in the flat graph, which [`Producer::Node`] uses.
    pub(crate) index: usize,
    pub(crate) name: String,
    pub(crate) node: Box<dyn AnyNode>,
    pub(crate) inputs: Vec<(Need, Vec<PlannedWire>)>,
    pub(crate) ports: Vec<PlannedPort>,
    pub(crate) is_every_tick: bool,
    /// Whether its inputs are logged; see [`Node::LOGS`](crate::node::Node::LOGS).
    pub(crate) is_logged: bool,
    /// The limits that it holds; each has an output of the same name.
    pub(crate) holds: &'static [&'static str],
    /// Index of the flag that is set while a budget of the limiter is spent, and the role whose commands it limits.
    pub(crate) budget: Option<(usize, String)>,
    /// Index of the flag that is set once the task of the node must not go on.
    pub(crate) fails: Option<usize>,
    /// The innermost task around it.
    pub(crate) task: usize,
    /// Times of the samples behind its outputs.
    pub(crate) sample_times: SampleTimes,
    /// Whether its limits are in raw readings.
    pub(crate) is_uncalibrated: bool,
    /// Span of its name.
    pub(crate) span: Range<usize>,
}

impl PlannedNode {
    /// Returns the outputs of the node, each with its reference.
    pub(crate) fn outputs(&self) -> impl Iterator<Item = (PortRef, &PlannedPort)> {
        let producer = Producer::Node(self.index);
        self.ports.iter().enumerate().map(move |(port, planned)| (PortRef { producer, port }, planned))
    }
}

/// A command or a report of a device, and the port that drives it.
pub(crate) struct PlannedCommand {
    pub(crate) source: PortRef,
    /// The task whose file has the wire.
    pub(crate) task: usize,
    /// The tasks whose nodes make the motion, and the one whose file has the wire: the command rests while one does.
    pub(crate) tasks: Vec<usize>,
    pub(crate) device: usize,
    /// Whether it is a report: a value that moves nothing.
    pub(crate) is_report: bool,
    /// Its index among the commands, or the reports, of the device.
    pub(crate) port: usize,
    /// Names of the role and of the command.
    pub(crate) name: [String; 2],
    /// Shape of the value.
    pub(crate) shape: Shape,
    /// Age limit. In any case, an older command ramps to zero, and an older report is not sent.
    pub(crate) age: AgeLimit,
    /// Span of its wire.
    pub(crate) span: Range<usize>,
    /// Maximum acceleration of each joint [rad/s²], infinite without a bound. A report has none.
    pub(crate) accelerations: Vec<f64>,
}

/// What triggers a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Clock {
    /// The samples of a device, by its index.
    Device(usize),
    /// A timer.
    Rate,
}

/// A checked and built graph, from which an engine is created without errors.
pub(crate) struct Plan {
    pub(crate) roles: Vec<PlannedRole>,
    pub(crate) devices: Vec<PlannedDevice>,
    /// The nodes in the order in which they step.
    pub(crate) nodes: Vec<PlannedNode>,
    /// The commands of the devices, then the reports to them.
    pub(crate) commands: Vec<PlannedCommand>,
    pub(crate) clock: Clock,
    /// Nominal time between two ticks [ns].
    pub(crate) period: i64,
    /// The graph itself, and the parts that are tasks.
    pub(crate) tasks: Vec<PlannedTask>,
    pub(crate) reach: Reach,
    /// The parameters that may change while the graph runs.
    pub(crate) live: LivePlan,
    /// The warnings that [allow] silences.
    pub(crate) allowed: Vec<AllowedWarning>,
}

/// Warnings of one code that a section [allow] silences.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AllowedWarning {
    /// Their code.
    pub code: Code,
    /// Why they are right, as the author of the graph or of the bench wrote it.
    pub reason: String,
    /// How many there are.
    pub count: usize,
}

impl fmt::Display for AllowedWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { code, reason, count } = self;
        write!(f, "allowed: {count} warning{} of `{code}`: {reason}", if *count == 1 { "" } else { "s" })
    }
}
