//! Warns about nodes whose outputs are not used, for example after a wire was deleted by mistake.
//!
//! A node is used if it is upstream of a command, a report, a node without outputs, a node that logs, a port in `show`,
//! a port in a condition of a mode, or an export of a part.

use std::cell::LazyCell;
use std::collections::{BTreeMap, BTreeSet};

use crate::graph::load::FlatNode;
use crate::graph::net::{Net, Wire};
use crate::graph::plan::{PlannedMode, PortRef, Producer};
use crate::node::{PortSpec, may_fit};
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
    let (is_read, mut open_inputs) = (net.read_nodes(), None);
    // Nodes without readers come first. An unused cycle has none, so it is reported at one of its nodes.
    for is_cycle in [false, true] {
        for node in 0..net.wires.len() {
            if used[node] || !is_cycle && is_read[node] {
                continue;
            }
            let key = &net.flat.nodes[node].block.key;
            // The name in its own file, so that a part that is used twice is reported once.
            let name = &key.name;
            let message = match is_cycle {
                false => format!("no output of `{name}` is used"),
                true => format!("`{name}` leads only to a cycle of unused nodes"),
            };
            let help = match open_inputs.get_or_insert_with(|| OpenInputs::of(net)).suggest_wire(net, node) {
                Some(wire) => format!("write {wire}, or remove `{name}`"),
                None => format!("wire an output of `{name}` to another node, or remove it"),
            };
            diagnostics.push(match namesake(net, node).or_else(|| bypass(net, node)) {
                Some(diagnostic) => diagnostic.note(key.span.clone(), message),
                None => Diagnostic::new(Code::UnusedNode, key.span.clone(), message).help(help),
            });
            // Nodes that only this one reads are not reported again.
            net.mark_upstream([node], &mut used);
        }
    }
}

/// Reports a wire that has the name of an unused node in the same file, and that reads another one.
fn namesake(net: &Net<'_>, node: usize) -> Option<Diagnostic> {
    let FlatNode { scope, block, .. } = &net.flat.nodes[node];
    let name = &block.key.name;
    let outputs = net.outputs(Producer::Node(node))?;
    let upstream = net.upstream([node]);
    let (reader, wire) = net.wires.iter().enumerate().find_map(|(reader, wires)| {
        let is_here = net.flat.nodes[reader].scope == *scope && !upstream[reader];
        // Of another input, the author of the graph does not choose the name.
        let is_free = |wire: &&Wire| wire.key.name == *name && net.input(reader, wire).need.is_many;
        Some((reader, wires.iter().find(|wire| is_here && is_free(wire))?))
    })?;
    let output = outputs.iter().find(|output| may_fit(output, net.input(reader, wire)))?;
    let (wired, reader) = (&wire.origin.word, &net.flat.nodes[reader].block.key.name);
    let message = format!("`in.{name}` of `{reader}` reads `{}`, and nothing reads `{name}`", wired.value);
    let diagnostic = Diagnostic::new(Code::UnusedNode, wired.span.clone(), message);
    Some(diagnostic.instead(&wired.value, &format!("{name}.{}", output.name)))
}

/// Reports the only wire that could read an unused node and reads what that node reads instead.
fn bypass(net: &Net<'_>, node: usize) -> Option<Diagnostic> {
    let FlatNode { scope, block, .. } = &net.flat.nodes[node];
    let (name, outputs) = (&block.key.name, net.outputs(Producer::Node(node))?);
    let sources: BTreeSet<PortRef> = net.wires[node].iter().map(|wire| wire.source).collect();
    let upstream = LazyCell::new(|| net.upstream([node]));
    let all = net.wires.iter().enumerate().flat_map(|(reader, wires)| wires.iter().map(move |wire| (reader, wire)));
    let past = all.filter(|(_, wire)| wire.origin.scope == *scope && sources.contains(&wire.source));
    let mut found = past.filter_map(|(reader, wire)| {
        let output = outputs.iter().find(|output| may_fit(output, net.input(reader, wire)))?;
        (!upstream[reader]).then_some((wire, output))
    });
    let (wire, output) = found.next().filter(|_| found.next().is_none())?;
    let word = &wire.origin.word;
    let message = format!("`{}` is read here, past `{name}`, and nothing reads `{name}`", word.value);
    let diagnostic = Diagnostic::new(Code::UnusedNode, word.span.clone(), message);
    Some(diagnostic.instead(&word.value, &format!("{name}.{}", output.name)))
}

/// The inputs that take another wire, by scope, type of node and index of the input, each with its nodes.
struct OpenInputs<'a>(BTreeMap<(usize, usize, usize), (&'a PortSpec, Vec<usize>)>);

impl<'a> OpenInputs<'a> {
    fn of(net: &Net<'a>) -> Self {
        let mut open = BTreeMap::new();
        for (node, wires) in net.wires.iter().enumerate() {
            let Some((kind, spec)) = net.nodes[node] else { continue };
            let is_wired: BTreeSet<usize> = wires.iter().map(|wire| wire.input).collect();
            for (i, input) in spec.inputs.iter().enumerate() {
                if input.need.is_many || !is_wired.contains(&i) {
                    let key = (net.flat.nodes[node].scope, kind, i);
                    open.entry(key).or_insert_with(|| (input, Vec::new())).1.push(node);
                }
            }
        }
        Self(open)
    }

    /// Suggests a wire from an unused node to another node in the same scope that is not upstream of it.
    fn suggest_wire(&self, net: &Net<'_>, node: usize) -> Option<String> {
        let (outputs, scope) = (net.outputs(Producer::Node(node))?, net.flat.nodes[node].scope);
        let upstream = LazyCell::new(|| net.upstream([node]));
        let inputs = self.0.range((scope, 0, 0)..(scope + 1, 0, 0)).filter_map(|((.., i), (input, nodes))| {
            let output = outputs.iter().position(|output| may_fit(output, input))?;
            let other = nodes.iter().find(|other| !upstream[**other])?;
            Some((output, *other, *i, input))
        });
        // The first output of a node is what it is made for.
        let (output, other, _, input) = inputs.min_by_key(|(output, other, i, _)| (*output, *other, *i))?;
        let output = &outputs[output];
        let (from, to) = (&net.flat.nodes[node].block.key.name, &net.flat.nodes[other].block.key.name);
        // A repeated input takes any name, for example that of the node.
        let name = if input.need.is_many { from } else { &*input.name };
        Some(format!("`in.{name} = \"{from}.{}\"` in `{to}`", output.name))
    }
}
