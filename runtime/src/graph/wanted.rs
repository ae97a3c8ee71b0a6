//! Which components of each output anything reads, found from the commands back: a feature that the projector deletes is
//! read by nobody, and what a controller would gather for it would be gathered in vain.

use super::order::Wiring;
use super::plan::Producer;
use super::wires::{Model, Wire};
use crate::node::{AnyNode, Components};

/// Of each node what of its outputs is read, given the nodes as they are set. Of one that no wire reads all is: somebody
/// looks at the record.
pub(crate) fn wanted<'n>(
    model: &Model<'_>,
    Wiring { order, wires, commands }: &Wiring<'_>,
    built: &dyn Fn(usize) -> Option<&'n dyn AnyNode>,
) -> Vec<Vec<Components>> {
    let node_of = |wire: &Wire| match wire.source.producer {
        Producer::Node(node) => Some(node),
        Producer::Role(_) => None,
    };
    let all: Vec<&Wire> = wires.iter().flatten().collect();
    let outputs = |node: usize| model.nodes[node].as_ref().map_or(0, |(_, spec)| spec.outputs.len());
    let first =
        |node| if all.iter().any(|wire| node_of(wire) == Some(node)) { Components::NONE } else { Components::ALL };
    let mut wanted: Vec<Vec<Components>> = (0..wires.len()).map(|node| vec![first(node); outputs(node)]).collect();
    for command in *commands {
        if let Producer::Node(node) = command.source.producer {
            wanted[node][command.source.port] = Components::ALL;
        }
    }
    let is_delayed = |node: usize, wire: &Wire| {
        model.nodes[node].as_ref().is_some_and(|(_, spec)| spec.inputs[wire.input].need.is_delayed)
    };
    // Who reads what the last tick left steps before the one it reads: that is taken as read as a whole.
    for (node, wires) in wires.iter().enumerate() {
        for wire in wires.iter().filter(|wire| is_delayed(node, wire)) {
            if let Some(source) = node_of(wire) {
                wanted[source][wire.source.port] = Components::ALL;
            }
        }
    }
    for &node in order.iter().rev() {
        let uses = built(node).map(|built| built.uses(&wanted[node])).unwrap_or_default();
        for wire in &wires[node] {
            let Some(source) = node_of(wire) else { continue };
            let of = &mut wanted[source][wire.source.port];
            *of = of.or(uses.get(wire.input).copied().unwrap_or(Components::ALL));
        }
    }
    wanted
}
