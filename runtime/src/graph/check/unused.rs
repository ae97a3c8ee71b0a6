//! Nodes whose work is lost: in a graph that drives a command, nothing follows from them that anything uses.
//!
//! A wire that was deleted by mistake leaves such a node behind. What is used is what a command or a report follows from,
//! what a node without outputs reads or one that logs, what the graph shows, and what a part exports: whether a task takes
//! it is the task's business.

use crate::graph::net::Net;
use crate::graph::plan::{PortRef, Producer};
use crate::node::may_fit;
use crate::source::{Code, Diagnostic};

/// What is to be looked at; nothing in a graph without commands, which is there to be recorded.
pub(crate) fn unused(net: &Net<'_>, shown: impl Iterator<Item = PortRef>) -> Vec<Diagnostic> {
    if net.commands.iter().all(|wire| wire.is_report) {
        return Vec::new();
    }
    let is_sink = |node: &usize| net.spec(*node).is_some_and(|spec| spec.outputs.is_empty() || spec.logs);
    let sinks = (0..net.wires.len()).filter(is_sink);
    let driving = net.commands.iter().map(|wire| wire.source.producer);
    let used =
        driving.chain(shown.map(|source| source.producer)).chain(net.exported()).chain(sinks.map(Producer::Node));
    let mut used = net.upstream(used.filter_map(Producer::node));
    let mut found = Vec::new();
    // Those that nothing reads come first; a cycle has none, and is told by one of its nodes.
    for is_circle in [false, true] {
        for node in 0..net.wires.len() {
            if used.contains(&node) || !is_circle && net.readers(node).next().is_some() {
                continue;
            }
            let key = &net.flat.nodes[node].block.key;
            // As its own file calls it: a part that is used twice is told of once.
            let name = &key.name;
            let message = match is_circle {
                false => format!("nothing reads any output of `{name}`"),
                true => format!("nothing that is used follows from `{name}`"),
            };
            let help = match open_input(net, node) {
                Some(wire) => format!("add {wire}, or take it out"),
                None => "wire an output of it to another node, or take it out".to_owned(),
            };
            found.push(Diagnostic::new(Code::UnreadNode, key.span.clone(), message).help(help));
            // What only it reads needs no word of its own.
            used.extend(net.upstream([node]));
        }
    }
    found
}

/// An input beside the node that could read it and is not wired: the wire to write.
fn open_input(net: &Net<'_>, node: usize) -> Option<String> {
    let outputs = net.outputs(Producer::Node(node))?;
    let above = net.upstream([node]);
    let flat = &net.flat.nodes;
    let beside = (0..flat.len()).filter(|other| flat[*other].scope == flat[node].scope && !above.contains(other));
    let mut inputs = beside.flat_map(|other| {
        let open = net.spec(other).into_iter().flat_map(|spec| spec.inputs.iter().enumerate()).filter(
            move |(index, input)| input.need.is_many || net.wires[other].iter().all(|wire| wire.input != *index),
        );
        open.map(move |(_, input)| (other, input))
    });
    inputs.find_map(|(other, input)| {
        let output = outputs.iter().find(|output| may_fit(output, input))?;
        let name = if input.need.is_many { "NAME" } else { &*input.name };
        let (from, to) = (&flat[node].block.key.name, &flat[other].block.key.name);
        Some(format!("`in.{name} = \"{from}.{}\"` to `{to}`", output.name))
    })
}
