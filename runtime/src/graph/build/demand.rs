//! Which components of each output are read, found from the commands backwards.
//!
//! A controller does not integrate a feature that no node downstream reads, for example one that a projector deletes.

use crate::graph::net::{Net, Wire};
use crate::graph::plan::Producer;
use crate::node::{AnyNode, Components};

/// The components that are read of each output of each node.
pub(crate) type Demand = Vec<Vec<Components>>;

/// Returns the components that are read of each output, given the configuration of each node.
///
/// An output without a reader counts as read in full, since recordings contain it.
pub(crate) fn find_demand<'n>(net: &Net<'_>, built: &dyn Fn(usize) -> Option<&'n dyn AnyNode>) -> Demand {
    let outputs = |node: usize| net.spec(node).map_or(0, |spec| spec.outputs.len());
    let first = |node| if net.readers(node).next().is_some() { Components::NONE } else { Components::ALL };
    let mut demand: Demand = (0..net.wires.len()).map(|node| vec![first(node); outputs(node)]).collect();
    for command in &net.commands {
        if let Producer::Node(node) = command.source.producer {
            demand[node][command.source.port] = Components::ALL;
        }
    }
    let is_delayed = |node: usize, wire: &Wire| net.input(node, wire).need.is_delayed;
    // A node with a delayed input steps before its source, so this pass reaches it too late: it counts as reading all.
    for (node, wires) in net.wires.iter().enumerate() {
        for wire in wires.iter().filter(|wire| is_delayed(node, wire)) {
            if let Some(source) = wire.source.producer.node() {
                demand[source][wire.source.port] = Components::ALL;
            }
        }
    }
    for &node in net.order.iter().rev() {
        let uses = built(node).map(|built| built.uses(&demand[node])).unwrap_or_default();
        for wire in &net.wires[node] {
            let Some(source) = wire.source.producer.node() else { continue };
            let of = &mut demand[source][wire.source.port];
            *of = of.or(uses.get(wire.input).copied().unwrap_or(Components::ALL));
        }
    }
    demand
}
