//! The times of the samples behind each port: the longest ones of all devices whose samples it waits for.
//!
//! Only wires that wake a node count, as for the stamp of a value: what a node samples makes its outputs no older.

use crate::graph::bench::OpenedBench;
use crate::graph::net::{Net, Wire};
use crate::graph::plan::{Producer, SampleTimes};

/// The times of the samples behind all ports.
pub(crate) struct AllSampleTimes {
    roles: Vec<SampleTimes>,
    nodes: Vec<SampleTimes>,
    /// The times of what is computed in each tick, as the flags of modes.
    tick: SampleTimes,
}

impl AllSampleTimes {
    /// Finds them, given the period of the graph [s].
    pub(super) fn new(net: &Net<'_>, opened: &OpenedBench, period: f64) -> Self {
        let tick = SampleTimes { period, latency: 0.0 };
        let of_role = |bound: &Option<_>| {
            let stated = |bound| SampleTimes { period: opened.period(bound), latency: opened.latency(bound) };
            bound.as_ref().map_or(tick, |bound| stated(bound).max(tick))
        };
        let roles: Vec<SampleTimes> = opened.roles.iter().map(of_role).collect();
        let mut found = Self { roles, nodes: vec![tick; net.wires.len()], tick };
        for &node in &net.order {
            let wakes = |wire: &&Wire| net.input(node, wire).need.is_trigger;
            let is_delayed = |wire: &Wire| net.input(node, wire).need.is_delayed;
            let triggers = net.wires[node].iter().filter(wakes);
            let (late, prompt): (Vec<&Wire>, Vec<&Wire>) = triggers.partition(|wire| is_delayed(wire));
            let sources = prompt.iter().map(|wire| found.of(wire.source.producer));
            found.nodes[node] = match prompt.is_empty() {
                // A later node makes what is delayed, so all devices upstream of it count.
                true => late.iter().map(|wire| found.upstream(net, wire.source.producer)).fold(tick, SampleTimes::max),
                false => sources.fold(tick, SampleTimes::max),
            };
        }
        found
    }

    /// Returns the times of the samples behind the ports of a role or a node.
    pub(crate) fn of(&self, producer: Producer) -> SampleTimes {
        match producer {
            Producer::Role(role) => self.roles[role],
            Producer::Node(node) => self.nodes[node],
            Producer::Task(_) => self.tick,
        }
    }

    /// Returns the longest times of all roles that a producer descends from.
    fn upstream(&self, net: &Net<'_>, producer: Producer) -> SampleTimes {
        net.roles_of(producer).map(|role| self.roles[role]).fold(self.tick, SampleTimes::max)
    }
}
