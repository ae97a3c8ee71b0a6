//! Warns about nodes whose outputs are not used, for example after a wire was deleted by mistake.
//!
//! A node is used if it is upstream of a command, a report, a node without outputs, a node that logs, a port in `show`,
//! a port in a condition of a mode, or an export of a part.

use crate::graph::net::Net;
use crate::graph::plan::{PlannedMode, PortRef, Producer};
use crate::node::may_fit;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports unused nodes. A graph without commands has none, since its outputs are recorded.
pub(crate) fn check(
    net: &Net<'_>,
    modes: &[PlannedMode],
    shown: impl Iterator<Item = PortRef>,
    diagnostics: &mut Diagnostics,
) {
    if net.commands.iter().all(|wire| wire.is_report) {
        return;
    }
    let is_sink = |node: &usize| net.spec(*node).is_some_and(|spec| spec.outputs.is_empty() || spec.logs);
    let sinks = (0..net.wires.len()).filter(is_sink);
    let driving = net.commands.iter().map(|wire| wire.source.producer);
    let watched = modes.iter().flat_map(|mode| &mode.exits).filter_map(|exit| exit.condition.port());
    let ports = shown.chain(watched).map(|source| source.producer);
    let used = driving.chain(ports).chain(net.exported()).chain(sinks.map(Producer::Node));
    let mut used = net.upstream(used.filter_map(Producer::node));
    // Nodes without readers come first. An unused cycle has none, so it is reported at one of its nodes.
    for is_cycle in [false, true] {
        for node in 0..net.wires.len() {
            if used.contains(&node) || !is_cycle && net.readers(node).next().is_some() {
                continue;
            }
            let key = &net.flat.nodes[node].block.key;
            // The name in its own file, so that a part that is used twice is reported once.
            let name = &key.name;
            let message = match is_cycle {
                false => format!("no output of `{name}` is used"),
                true => format!("`{name}` leads only to a cycle of unused nodes"),
            };
            let help = match suggest_wire(net, node) {
                Some(wire) => format!("add {wire}, or remove `{name}`"),
                None => format!("wire an output of `{name}` to another node, or remove it"),
            };
            diagnostics.push(Diagnostic::new(Code::UnusedNode, key.span.clone(), message).help(help));
            // Nodes that only this one reads are not reported again.
            used.extend(net.upstream([node]));
        }
    }
}

/// Suggests a wire to an unwired input of another node in the same scope.
fn suggest_wire(net: &Net<'_>, node: usize) -> Option<String> {
    let outputs = net.outputs(Producer::Node(node))?;
    let upstream = net.upstream([node]);
    let flat = &net.flat.nodes;
    let beside = (0..flat.len()).filter(|other| flat[*other].scope == flat[node].scope && !upstream.contains(other));
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
