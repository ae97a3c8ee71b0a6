//! Which components of each output are read, found from the commands backwards.
//!
//! A controller does not integrate a feature that no node downstream reads, for example one that a projector deletes.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::net::{Net, Wire};
use crate::graph::plan::Producer;
use crate::node::{AnyNode, Components};

/// The components of each output of one node.
type Outputs = Vec<Components>;

/// The components that are read, with the parameters of the graph. A mode changes them of a few nodes only.
pub(crate) struct Demand {
    /// The components that are read of each output of each node.
    wanted: Vec<Outputs>,
    /// The components that are read in every mode.
    always: Vec<Outputs>,
    /// The components of each input that each node uses.
    uses: Vec<Vec<Components>>,
    /// The wires that read from each node: the reader, and the index of the wire. A delayed wire always reads all.
    readers: Vec<Vec<(usize, usize)>>,
    /// The place of each node in the step order.
    places: Vec<usize>,
}

/// The nodes of which a mode reads other components than the graph without modes, and what it reads.
pub(crate) type DemandChanges = BTreeMap<usize, Outputs>;

impl Demand {
    /// Finds the components that are read of each output, given the configuration of each node.
    ///
    /// An output without a reader counts as read in full, since recordings contain it.
    pub(crate) fn find<'n>(net: &Net<'_>, built: &dyn Fn(usize) -> Option<&'n dyn AnyNode>) -> Self {
        let always = always_read(net);
        let (mut wanted, mut uses) = (always.clone(), vec![Vec::new(); net.wires.len()]);
        let (mut readers, mut places) = (vec![Vec::new(); net.wires.len()], vec![0; net.wires.len()]);
        for (place, &node) in net.order.iter().enumerate().rev() {
            places[node] = place;
            uses[node] = built(node).map(|built| built.uses(&wanted[node])).unwrap_or_default();
            for (i, wire) in net.wires[node].iter().enumerate().filter(|(_, wire)| !is_delayed(net, node, wire)) {
                let Some(source) = wire.source.producer.node() else { continue };
                readers[source].push((node, i));
                let of = &mut wanted[source][wire.source.port];
                *of = of.or(used(&uses[node], wire));
            }
        }
        Self { wanted, always, uses, readers, places }
    }

    /// Returns the components that are read of each output of a node, in a mode with these changes.
    pub(crate) fn of<'d>(&'d self, node: usize, changes: &'d DemandChanges) -> &'d [Components] {
        changes.get(&node).unwrap_or(&self.wanted[node])
    }

    /// Finds what changes if some nodes have another configuration: the `changed` ones.
    pub(crate) fn changes<'n>(
        &self,
        net: &Net<'_>,
        changed: impl Iterator<Item = usize>,
        built: &dyn Fn(usize) -> Option<&'n dyn AnyNode>,
    ) -> DemandChanges {
        let mut changes = DemandChanges::new();
        let mut uses: BTreeMap<usize, Vec<Components>> = BTreeMap::new();
        // The nodes to visit, by their places: each after all its readers.
        let mut open: BTreeSet<(usize, usize)> = changed.map(|node| (self.places[node], node)).collect();
        let mut is_visited = BTreeSet::new();
        while let Some((_, node)) = open.pop_last() {
            if !is_visited.insert(node) {
                continue;
            }
            let mut wanted = self.always[node].clone();
            for (reader, i) in &self.readers[node] {
                let wire = &net.wires[*reader][*i];
                let of = &mut wanted[wire.source.port];
                *of = of.or(used(uses.get(reader).unwrap_or(&self.uses[*reader]), wire));
            }
            let node_uses = built(node).map(|built| built.uses(&wanted)).unwrap_or_default();
            if node_uses != self.uses[node] {
                let sources = net.wires[node].iter().filter_map(|wire| wire.source.producer.node());
                open.extend(sources.map(|source| (self.places[source], source)));
                uses.insert(node, node_uses);
            }
            if wanted != self.wanted[node] {
                changes.insert(node, wanted);
            }
        }
        changes
    }
}

fn is_delayed(net: &Net<'_>, node: usize, wire: &Wire) -> bool {
    net.input(node, wire).need.is_delayed
}

fn used(uses: &[Components], wire: &Wire) -> Components {
    uses.get(wire.input).copied().unwrap_or(Components::ALL)
}

/// Returns the components that are read whatever the configurations of the nodes are.
fn always_read(net: &Net<'_>) -> Vec<Outputs> {
    let outputs = |node: usize| net.spec(node).map_or(0, |spec| spec.outputs.len());
    let first = |is_read: &bool| if *is_read { Components::NONE } else { Components::ALL };
    let is_read = net.read_nodes();
    let mut always: Vec<Outputs> =
        is_read.iter().enumerate().map(|(node, is_read)| vec![first(is_read); outputs(node)]).collect();
    for command in &net.commands {
        if let Producer::Node(node) = command.source.producer {
            always[node][command.source.port] = Components::ALL;
        }
    }
    // What another task reads is computed in every mode: the modes of the two change at different times.
    for (node, wires) in net.wires.iter().enumerate() {
        let task = net.flat.task_with_modes(node);
        let sources = wires.iter().filter_map(|wire| Some((wire.source.producer.node()?, wire.source.port)));
        let foreign = sources.filter(|(source, _)| net.flat.task_with_modes(*source) != task);
        foreign.for_each(|(source, port)| always[source][port] = Components::ALL);
    }
    // A node with a delayed input steps before its source, so a pass backwards reaches it too late: it counts as
    // reading all.
    for (node, wires) in net.wires.iter().enumerate() {
        for wire in wires.iter().filter(|wire| is_delayed(net, node, wire)) {
            if let Some(source) = wire.source.producer.node() {
                always[source][wire.source.port] = Components::ALL;
            }
        }
    }
    always
}
