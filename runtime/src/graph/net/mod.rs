//! The net of a flat graph: declarations, wires, and the order in which the nodes step.

mod connect;
mod declare;
mod order;
mod resolve;
mod wire;

use std::collections::BTreeSet;

use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::graph::load::FlatGraph;
use crate::graph::plan::{PortRef, Producer};
use crate::node::{NodeSpec, PortSpec, Word};
use crate::source::{Diagnostic, Key};

pub(crate) use wire::{CommandWire, Origin, Wire};

/// A flat graph with the declaration of each type, its wires and its order.
pub(crate) struct Net<'a> {
    pub(crate) flat: &'a FlatGraph,
    pub(crate) catalogue: &'a Catalogue,
    /// The type of each role; `None` if it is unknown.
    pub(crate) roles: Vec<Option<&'a RoleType>>,
    /// Index of each node's type in the catalogue, and its declaration; `None` if it is unknown.
    pub(crate) nodes: Vec<Option<(usize, &'a NodeSpec)>>,
    /// What the bench binds and only a scenario and the recorder may read: name, device and type.
    pub(crate) observed: Vec<(&'a Key, &'a Word, &'a RoleType)>,
    /// The wires of each node that lead somewhere.
    pub(crate) wires: Vec<Vec<Wire>>,
    /// The wires of commands and reports that lead somewhere.
    pub(crate) commands: Vec<CommandWire>,
    /// The nodes in the order in which they step.
    pub(crate) order: Vec<usize>,
}

impl<'a> Net<'a> {
    /// Looks up every type, connects every wire and orders the nodes.
    pub(crate) fn new(flat: &'a FlatGraph, catalogue: &'a Catalogue, found: &mut Vec<Diagnostic>) -> Self {
        let mut net = Self::declared(flat, catalogue, found);
        net.wires = net.connect(found);
        net.commands = net.connect_commands(found);
        net.order = net.ordered(found);
        net
    }

    /// The declaration of a node; `None` if its type is unknown.
    pub(crate) fn spec(&self, node: usize) -> Option<&'a NodeSpec> {
        self.nodes[node].map(|(_, spec)| spec)
    }

    /// The declaration of the input that a wire of a node leads to.
    pub(crate) fn input(&self, node: usize, wire: &Wire) -> &'a PortSpec {
        &self.spec(node).expect("only known nodes have wires").inputs[wire.input]
    }

    /// The declaration of a producer's outputs.
    pub(crate) fn outputs(&self, producer: Producer) -> Option<&[PortSpec]> {
        match producer {
            Producer::Role(i) => self.roles[i].map(|role| role.outputs.as_slice()),
            Producer::Node(i) => self.spec(i).map(|spec| spec.outputs.as_slice()),
        }
    }

    /// Full name of a producer.
    pub(crate) fn name(&self, producer: Producer) -> &str {
        match producer {
            Producer::Role(i) => &self.flat.roles[i].0.name,
            Producer::Node(i) => &self.flat.nodes[i].name,
        }
    }

    /// Declaration of what a command wire goes to.
    pub(crate) fn taken(&self, wire: &CommandWire) -> &PortSpec {
        let role = self.roles[wire.role].expect("only known roles have commands");
        &(if wire.is_report { &role.reports } else { &role.commands })[wire.command]
    }

    /// `role.command` of a command wire.
    pub(crate) fn taken_name(&self, wire: &CommandWire) -> String {
        format!("{}.{}", self.name(Producer::Role(wire.role)), self.taken(wire).name)
    }

    /// Declaration of the port a wire comes from.
    pub(crate) fn port(&self, source: PortRef) -> &PortSpec {
        &self.outputs(source.producer).expect("a wire comes from a known port")[source.port]
    }

    /// `node.port` of a source.
    pub(crate) fn port_name(&self, source: PortRef) -> String {
        format!("{}.{}", self.name(source.producer), self.port(source).name)
    }

    /// The nodes from which `nodes` follow, themselves included.
    pub(crate) fn upstream(&self, nodes: impl IntoIterator<Item = usize>) -> BTreeSet<usize> {
        let mut reached: BTreeSet<usize> = nodes.into_iter().collect();
        let mut open: Vec<usize> = reached.iter().copied().collect();
        while let Some(node) = open.pop() {
            let sources = self.wires[node].iter().filter_map(|wire| wire.source.producer.node());
            open.extend(sources.filter(|source| reached.insert(*source)));
        }
        reached
    }

    /// The nodes that read an output of a node.
    pub(crate) fn readers(&self, node: usize) -> impl Iterator<Item = usize> {
        let reads = move |wires: &[Wire]| wires.iter().any(|wire| wire.source.producer == Producer::Node(node));
        self.wires.iter().enumerate().filter(move |(_, wires)| reads(wires)).map(|(reader, _)| reader)
    }
}
