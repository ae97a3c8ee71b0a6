//! Which components of each output anything reads, found from the commands back: a feature that the projector deletes is
//! read by nobody, and what a controller would gather for it would be gathered in vain.

use crate::graph::net::{Net, Wire};
use crate::graph::plan::Producer;
use crate::node::{AnyNode, Components};

/// Of each node what of its outputs is read, given the nodes as they are set. Of one that no wire reads all is: somebody
/// looks at the record.
pub(crate) fn wanted<'n>(net: &Net<'_>, built: &dyn Fn(usize) -> Option<&'n dyn AnyNode>) -> Vec<Vec<Components>> {
    let outputs = |node: usize| net.spec(node).map_or(0, |spec| spec.outputs.len());
    let first = |node| if net.readers(node).next().is_some() { Components::NONE } else { Components::ALL };
    let mut wanted: Vec<Vec<Components>> = (0..net.wires.len()).map(|node| vec![first(node); outputs(node)]).collect();
    for command in &net.commands {
        if let Producer::Node(node) = command.source.producer {
            wanted[node][command.source.port] = Components::ALL;
        }
    }
    let is_delayed = |node: usize, wire: &Wire| net.input(node, wire).need.is_delayed;
    // Who reads what the last tick left steps before the one it reads: that is taken as read as a whole.
    for (node, wires) in net.wires.iter().enumerate() {
        for wire in wires.iter().filter(|wire| is_delayed(node, wire)) {
            if let Some(source) = wire.source.producer.node() {
                wanted[source][wire.source.port] = Components::ALL;
            }
        }
    }
    for &node in net.order.iter().rev() {
        let uses = built(node).map(|built| built.uses(&wanted[node])).unwrap_or_default();
        for wire in &net.wires[node] {
            let Some(source) = wire.source.producer.node() else { continue };
            let of = &mut wanted[source][wire.source.port];
            *of = of.or(uses.get(wire.input).copied().unwrap_or(Components::ALL));
        }
    }
    wanted
}
