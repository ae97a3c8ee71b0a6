//! What a check hands to the engine: everything looked up, built and in order.

use std::ops::Range;

use super::modes::PlannedModes;
use super::policy::{Age, Policy, PolicyTable};
use super::shown::PlannedView;
use super::{Outline, Sources};
use crate::device::Driver;
use crate::diagnostic::{Diagnostic, Report};
use crate::node::{AnyNode, Need};
use crate::signal::Shape;

/// What a wire can come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Producer {
    /// A role, by its index in the graph file.
    Role(usize),
    /// A node, by its index in the flat graph.
    Node(usize),
}

/// One output of a role or a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Source {
    pub(crate) producer: Producer,
    pub(crate) port: usize,
}

/// A port with everything that is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPort {
    /// Its name: `node.port`.
    pub name: String,
    /// Its shape, units filled in.
    pub shape: Shape,
    /// Its frames, where the wires tell them.
    pub frames: Vec<Option<String>>,
}

/// A role and the device that fills it.
pub(crate) struct PlannedRole {
    pub(crate) name: String,
    /// Index of the device.
    pub(crate) device: usize,
    /// Number of the role's first output among the device's.
    pub(crate) first_port: usize,
    pub(crate) ports: Vec<PlannedPort>,
    /// How old the newest sample may be [ns], and what it does when it is older.
    pub(crate) max_age: i64,
    pub(crate) stale: Policy,
    /// Nominal time between two samples of the device [ns].
    pub(crate) period: i64,
}

/// A device, opened.
pub(crate) struct PlannedDevice {
    pub(crate) name: String,
    pub(crate) driver: Driver,
    pub(crate) outputs: Vec<Shape>,
    pub(crate) commands: Vec<Shape>,
    /// How many things it can be told.
    pub(crate) reports: usize,
    /// Where its name stands in the bench.
    pub(crate) span: Range<usize>,
}

/// Where a wire comes from, and how old what comes over it may be.
#[derive(Debug, Clone)]
pub(crate) struct PlannedWire {
    pub(crate) source: Source,
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
    /// Whether the tool logs its inputs; see [`Describe::LOGS`](crate::node::Describe::LOGS).
    pub(crate) is_logged: bool,
    /// The limits it holds; each has an output of that name.
    pub(crate) holds: &'static [&'static str],
    /// Where its name stands.
    pub(crate) span: Range<usize>,
}

/// A command of a device, and what drives it.
pub(crate) struct PlannedCommand {
    pub(crate) source: Source,
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
    pub(crate) source: Source,
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
pub struct Plan {
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
    pub(crate) sources: Sources,
    pub(crate) warnings: Vec<Diagnostic>,
    pub(crate) outline: Outline,
    pub(crate) modes: Option<PlannedModes>,
    pub(crate) policy: PolicyTable,
    pub(crate) exports: Vec<(String, String)>,
    pub(crate) facts: Vec<(String, toml::Value)>,
    /// What a run shows.
    pub(crate) view: PlannedView,
}

impl Plan {
    /// What may not be as it was meant, though the graph loads; none if there is nothing.
    #[must_use]
    pub fn warnings(&self) -> Option<Report> {
        let report = || Report::new(self.sources.clone(), self.warnings.clone());
        (!self.warnings.is_empty()).then(report)
    }

    /// Every port of the graph: those of the roles, then those of the nodes in the order in which they step.
    pub fn ports(&self) -> impl Iterator<Item = &PlannedPort> {
        let roles = self.roles.iter().flat_map(|role| &role.ports);
        roles.chain(self.nodes.iter().flat_map(|node| &node.ports))
    }

    /// What the parts of the graph export, as its wires name it, and the port behind each.
    #[must_use]
    pub fn exports(&self) -> &[(String, String)] {
        &self.exports
    }

    /// The port of that name, as the record names it or as the wires of the task do.
    #[must_use]
    pub fn port(&self, word: &str) -> Option<&PlannedPort> {
        let export = self.exports.iter().find(|(export, _)| export == word);
        let name = export.map_or(word, |(_, port)| port.as_str());
        self.ports().find(|port| port.name == name)
    }

    /// The ports that the graph reports to its devices.
    pub fn reported(&self) -> impl Iterator<Item = &PlannedPort> {
        self.reports.iter().filter_map(|report| {
            let ports = match report.source.producer {
                Producer::Role(role) => &self.roles.get(role)?.ports,
                Producer::Node(index) => &self.nodes.iter().find(|node| node.index == index)?.ports,
            };
            ports.get(report.source.port)
        })
    }

    /// What the devices state of themselves: `role.fact`, and the value.
    #[must_use]
    pub fn facts(&self) -> &[(String, toml::Value)] {
        &self.facts
    }

    /// The names of the modes, in the order of the file.
    pub fn modes(&self) -> impl Iterator<Item = &str> {
        self.modes.iter().flat_map(|modes| &modes.modes).map(|mode| mode.name.as_str())
    }

    /// The graph as it runs, with where each value comes from.
    #[must_use]
    pub const fn outline(&self) -> &Outline {
        &self.outline
    }

    /// The outputs of a node.
    pub fn outputs(&self, node: &str) -> impl Iterator<Item = &PlannedPort> {
        self.nodes.iter().filter(move |planned| planned.name == node).flat_map(|planned| &planned.ports)
    }

    /// The names of the nodes in the order in which they step.
    pub fn order(&self) -> impl Iterator<Item = &str> {
        self.nodes.iter().map(|node| node.name.as_str())
    }

    /// Whether any device runs on its own, so that only real time will do.
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.devices.iter().any(|device| matches!(device.driver, Driver::Live(_)))
    }

    /// Nominal time between two ticks [s].
    #[must_use]
    pub fn period(&self) -> f64 {
        self.period as f64 * 1e-9
    }

    /// The texts the graph was read from.
    #[must_use]
    pub const fn sources(&self) -> &Sources {
        &self.sources
    }
}
