//! The compiled graph: its plan, its view and its outline.

use std::collections::BTreeSet;

use crate::device::Driver;
use crate::graph::bench::CommissionedDevice;
use crate::graph::plan::{
    AllowedWarning, Plan, PlannedNode, PlannedPort, PlannedTask, PlannedView, Producer, RecordedPorts,
};
use crate::outline::Outline;
use crate::source::{Code, Diagnostic, Report, SourceMap};

/// A graph that was checked and built.
pub struct Compiled {
    /// What the engine needs.
    pub(crate) plan: Plan,
    /// The ports that a run shows.
    pub(crate) view: PlannedView,
    pub(crate) sources: SourceMap,
    pub(crate) warnings: Vec<Diagnostic>,
    pub(crate) outline: Outline,
    pub(crate) exports: Vec<(String, String)>,
    pub(crate) facts: Vec<(String, toml::Value)>,
    pub(crate) silences: Vec<String>,
    pub(crate) to_commission: Vec<CommissionedDevice>,
    pub(crate) recorded: RecordedPorts,
}

impl Compiled {
    /// Returns the warnings, or `None` if there are none.
    #[must_use]
    pub fn warnings(&self) -> Option<Report> {
        let report = || Report::new(self.sources.clone(), self.warnings.clone());
        (!self.warnings.is_empty()).then(report)
    }

    /// Returns the warnings of a graph whose ports of these names are read from outside, as the checks of a scenario do.
    pub(crate) fn warnings_of_read(&self, ports: &BTreeSet<String>) -> Option<Report> {
        let is_read = |node: &&PlannedNode| node.ports.iter().any(|port| ports.contains(&port.name));
        let mut open: Vec<&PlannedNode> = self.plan.nodes.iter().filter(is_read).collect();
        let mut used = BTreeSet::new();
        while let Some(node) = open.pop() {
            if used.insert(node.index) {
                let sources = node.inputs.iter().flat_map(|(_, wires)| wires).map(|wire| wire.source.producer.node());
                let sources = sources.flatten();
                open.extend(sources.filter_map(|source| self.plan.nodes.iter().find(|node| node.index == source)));
            }
        }
        let is_used = |warning: &Diagnostic| {
            let mut nodes = self.plan.nodes.iter().filter(|node| used.contains(&node.index));
            // A warning at a wire has the node as a note.
            let marks = |node: &PlannedNode| {
                node.span == warning.span || warning.notes.iter().any(|(place, _)| *place == node.span)
            };
            warning.code == Code::UnusedNode && nodes.any(marks)
        };
        let warnings: Vec<Diagnostic> = self.warnings.iter().filter(|warning| !is_used(warning)).cloned().collect();
        (!warnings.is_empty()).then(|| Report::new(self.sources.clone(), warnings))
    }

    /// Returns for each live device that moves what it does without commands, within which time and way.
    #[must_use]
    pub fn silences(&self) -> &[String] {
        &self.silences
    }

    /// Returns the devices that must be commissioned before they use all of their limits, each with the path of the file
    /// that declares it.
    pub fn to_commission(&self) -> impl Iterator<Item = (&CommissionedDevice, &str)> {
        self.to_commission.iter().map(|device| (device, self.sources.file_at(device.at).name.as_str()))
    }

    /// Returns the warnings that a section [allow] silences, each with its reason.
    #[must_use]
    pub fn allowed(&self) -> &[AllowedWarning] {
        &self.plan.allowed
    }

    /// Returns all ports: those of the roles, those of the nodes in step order, and the flags of modes.
    pub fn ports(&self) -> impl Iterator<Item = &PlannedPort> {
        let roles = self.plan.roles.iter().flat_map(|role| &role.ports);
        let flags = self.plan.tasks.iter().flat_map(|task| &task.flags).map(|(.., port)| port);
        roles.chain(self.plan.nodes.iter().flat_map(|node| &node.ports)).chain(flags)
    }

    /// Returns the exports of the parts, each with the full name of the port behind it.
    #[must_use]
    pub fn exports(&self) -> &[(String, String)] {
        &self.exports
    }

    /// Returns the port with a full name, as in a recording, or with the name of an export, as in a wire.
    #[must_use]
    pub fn port(&self, name: &str) -> Option<&PlannedPort> {
        let export = self.exports.iter().find(|(export, _)| export == name);
        let name = export.map_or(name, |(_, port)| port.as_str());
        self.ports().find(|port| port.name == name)
    }

    /// Finds the port at the start of a dotted name, and returns it with the rest of the name.
    ///
    /// The rest is empty, or it starts with a dot and names a part of the value, for example `.x`.
    #[must_use]
    pub fn port_prefix<'n>(&self, name: &'n str) -> Option<(&PlannedPort, &'n str)> {
        let ends = std::iter::once(name.len()).chain(name.rmatch_indices('.').map(|(at, _)| at));
        ends.into_iter().find_map(|end| Some((self.port(&name[..end])?, &name[end..])))
    }

    /// Returns the ports that the graph reports to its devices.
    pub fn reported(&self) -> impl Iterator<Item = &PlannedPort> {
        self.plan.commands.iter().filter(|wire| wire.is_report).filter_map(|report| {
            let ports = match report.source.producer {
                Producer::Role(role) => &self.plan.roles.get(role)?.ports,
                Producer::Node(index) => &self.plan.nodes.iter().find(|node| node.index == index)?.ports,
                // A report takes a pose, and a mode is a flag.
                Producer::Task(_) => return None,
            };
            ports.get(report.source.port)
        })
    }

    /// Returns the facts of the devices: `role.fact` and the value.
    #[must_use]
    pub fn facts(&self) -> &[(String, toml::Value)] {
        &self.facts
    }

    /// Returns the names of the modes in file order; those of a part that is a task have its name before theirs.
    pub fn modes(&self) -> impl Iterator<Item = &str> {
        let modes = self.plan.tasks.iter().filter_map(|task| task.modes.as_ref());
        modes.flat_map(|modes| &modes.modes).map(|mode| mode.name.as_str())
    }

    /// Returns the index of the task and the number of its mode with a name, as [`modes`](Self::modes) returns it.
    #[must_use]
    pub fn mode(&self, name: &str) -> Option<(usize, usize)> {
        let tasks = self.plan.tasks.iter().enumerate();
        let found = |(task, planned): (usize, &PlannedTask)| {
            let number = planned.modes.as_ref()?.modes.iter().position(|mode| mode.name == name)?;
            Some((task, number))
        };
        tasks.filter_map(found).next()
    }

    /// Returns the outline: the graph as it runs, with the origin of each value.
    #[must_use]
    pub const fn outline(&self) -> &Outline {
        &self.outline
    }

    /// Returns the outputs of a node.
    pub fn outputs(&self, node: &str) -> impl Iterator<Item = &PlannedPort> {
        self.plan.nodes.iter().filter(move |planned| planned.name == node).flat_map(|planned| &planned.ports)
    }

    /// Returns the names of the nodes in step order.
    pub fn order(&self) -> impl Iterator<Item = &str> {
        self.plan.nodes.iter().map(|node| node.name.as_str())
    }

    /// Returns whether a device is live, so that the graph runs only in real time.
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.plan.devices.iter().any(|device| matches!(device.driver, Driver::Live(_)))
    }

    /// Returns whether a device takes commands.
    #[must_use]
    pub fn moves(&self) -> bool {
        self.plan.devices.iter().any(|device| !device.description.commands.is_empty())
    }

    /// Returns the nominal time between two ticks [s].
    #[must_use]
    pub fn period(&self) -> f64 {
        self.plan.period as f64 * 1e-9
    }

    /// Returns the source texts of the graph.
    #[must_use]
    pub const fn sources(&self) -> &SourceMap {
        &self.sources
    }
}
