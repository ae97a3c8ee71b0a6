//! A graph that is checked and built: the plan, what a run shows, and what can be asked of it.

use crate::device::Driver;
use crate::graph::outline::Outline;
use crate::graph::plan::{Plan, PlannedPort, PlannedView, Producer};
use crate::source::{Diagnostic, Report, SourceMap};

/// A graph that is checked and built, with everything that is known of it.
pub struct Compiled {
    /// What the tick needs.
    pub(crate) plan: Plan,
    /// What a run shows.
    pub(crate) view: PlannedView,
    pub(crate) sources: SourceMap,
    pub(crate) warnings: Vec<Diagnostic>,
    pub(crate) outline: Outline,
    pub(crate) exports: Vec<(String, String)>,
    pub(crate) facts: Vec<(String, toml::Value)>,
}

impl Compiled {
    /// What may not be as it was meant, though the graph loads; none if there is nothing.
    #[must_use]
    pub fn warnings(&self) -> Option<Report> {
        let report = || Report::new(self.sources.clone(), self.warnings.clone());
        (!self.warnings.is_empty()).then(report)
    }

    /// Every port of the graph: those of the roles, then those of the nodes in the order in which they step.
    pub fn ports(&self) -> impl Iterator<Item = &PlannedPort> {
        let roles = self.plan.roles.iter().flat_map(|role| &role.ports);
        roles.chain(self.plan.nodes.iter().flat_map(|node| &node.ports))
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
        self.plan.reports.iter().filter_map(|report| {
            let ports = match report.source.producer {
                Producer::Role(role) => &self.plan.roles.get(role)?.ports,
                Producer::Node(index) => &self.plan.nodes.iter().find(|node| node.index == index)?.ports,
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
        self.plan.modes.iter().flat_map(|modes| &modes.modes).map(|mode| mode.name.as_str())
    }

    /// The graph as it runs, with where each value comes from.
    #[must_use]
    pub const fn outline(&self) -> &Outline {
        &self.outline
    }

    /// The outputs of a node.
    pub fn outputs(&self, node: &str) -> impl Iterator<Item = &PlannedPort> {
        self.plan.nodes.iter().filter(move |planned| planned.name == node).flat_map(|planned| &planned.ports)
    }

    /// The names of the nodes in the order in which they step.
    pub fn order(&self) -> impl Iterator<Item = &str> {
        self.plan.nodes.iter().map(|node| node.name.as_str())
    }

    /// Whether any device runs on its own, so that only real time will do.
    #[must_use]
    pub fn is_live(&self) -> bool {
        self.plan.devices.iter().any(|device| matches!(device.driver, Driver::Live(_)))
    }

    /// Nominal time between two ticks [s].
    #[must_use]
    pub fn period(&self) -> f64 {
        self.plan.period as f64 * 1e-9
    }

    /// The texts the graph was read from.
    #[must_use]
    pub const fn sources(&self) -> &SourceMap {
        &self.sources
    }
}
