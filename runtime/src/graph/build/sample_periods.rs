//! The time between two samples behind each port: that of the slowest device whose samples it waits for.
//!
//! Only wires that wake a node count, as for the stamp of a value: what a node samples makes its outputs no older.

use crate::graph::bench::OpenedBench;
use crate::graph::net::{Net, Wire};
use crate::graph::plan::Producer;

/// The nominal sample periods behind all ports [s], each at least the period of the graph.
pub(crate) struct SamplePeriods {
    roles: Vec<f64>,
    nodes: Vec<f64>,
    /// The period of the graph, at which the flags of modes are written [s].
    period: f64,
}

impl SamplePeriods {
    /// Finds them, given the period of the graph [s].
    pub(super) fn new(net: &Net<'_>, opened: &OpenedBench, period: f64) -> Self {
        let of_role = |bound: &Option<_>| bound.as_ref().map_or(period, |bound| opened.period(bound).max(period));
        let roles: Vec<f64> = opened.roles.iter().map(of_role).collect();
        let mut found = Self { roles, nodes: vec![period; net.wires.len()], period };
        for &node in &net.order {
            let wakes = |wire: &&Wire| net.input(node, wire).need.is_trigger;
            let is_delayed = |wire: &Wire| net.input(node, wire).need.is_delayed;
            let triggers = net.wires[node].iter().filter(wakes);
            let (late, prompt): (Vec<&Wire>, Vec<&Wire>) = triggers.partition(|wire| is_delayed(wire));
            let sources = prompt.iter().map(|wire| found.of(wire.source.producer));
            found.nodes[node] = match prompt.is_empty() {
                // A later node makes what is delayed, so all devices upstream of it count.
                true => late.iter().map(|wire| found.upstream(net, wire.source.producer)).fold(period, f64::max),
                false => sources.fold(period, f64::max),
            };
        }
        found
    }

    /// Returns the sample period behind the ports of a role or a node [s].
    pub(crate) fn of(&self, producer: Producer) -> f64 {
        match producer {
            Producer::Role(role) => self.roles[role],
            Producer::Node(node) => self.nodes[node],
            Producer::Task(_) => self.period,
        }
    }

    /// Returns the longest sample period of all roles that a producer descends from [s].
    fn upstream(&self, net: &Net<'_>, producer: Producer) -> f64 {
        net.roles_of(producer).map(|role| self.roles[role]).fold(0.0, f64::max)
    }
}
