//! Nodes whose work is lost: in a graph that drives a command, nothing follows from them that anything uses.
//!
//! A wire that was deleted by mistake leaves such a node behind. What is used is what a command or a report follows from,
//! what a node without outputs reads or one that logs, what the graph shows, and what a part exports: whether a task takes
//! it is the task's business.

use std::collections::BTreeSet;

use super::plan::{Producer, Source};
use super::units::may_fit;
use super::wires::{CommandWire, Model, Wire};
use crate::diagnostic::{Code, Diagnostic};

/// What is to be looked at; nothing in a graph without commands, which is there to be recorded.
pub(crate) fn unread(
    model: &Model<'_>,
    wires: &[Vec<Wire>],
    commands: &[CommandWire],
    shown: impl Iterator<Item = Source>,
) -> Vec<Diagnostic> {
    if commands.iter().all(|wire| wire.is_report) {
        return Vec::new();
    }
    let readers = |node: usize| {
        let reads = move |wires: &Vec<Wire>| wires.iter().any(|wire| wire.source.producer == Producer::Node(node));
        wires.iter().enumerate().filter(move |(_, wires)| reads(wires)).map(|(reader, _)| reader)
    };
    let is_sink = |node: &usize| {
        let spec = model.nodes[*node].as_ref().map(|(_, spec)| spec);
        spec.is_some_and(|spec| spec.outputs.is_empty() || spec.logs)
    };
    let sinks = (0..wires.len()).filter(is_sink);
    let driving = commands.iter().map(|wire| wire.source.producer);
    let used =
        driving.chain(shown.map(|source| source.producer)).chain(model.exported()).chain(sinks.map(Producer::Node));
    let mut used = upstream(wires, used.filter_map(node_of).collect());
    let mut found = Vec::new();
    // Those that nothing reads come first; a circle has none, and is told by one of its nodes.
    for is_circle in [false, true] {
        for node in 0..wires.len() {
            if used.contains(&node) || !is_circle && readers(node).next().is_some() {
                continue;
            }
            let key = &model.flat.nodes[node].block.key;
            // As its own file calls it: a part that is used twice is told of once.
            let name = &key.name;
            let message = match is_circle {
                false => format!("nothing reads any output of `{name}`"),
                true => format!("nothing that is used follows from `{name}`"),
            };
            let help = match open_input(model, wires, node) {
                Some(wire) => format!("add {wire}, or take it out"),
                None => "wire an output of it to another node, or take it out".to_owned(),
            };
            found.push(Diagnostic::new(Code::UnreadNode, key.span.clone(), message).help(help));
            // What only it reads needs no word of its own.
            used.extend(upstream(wires, BTreeSet::from([node])));
        }
    }
    found
}

/// An input beside the node that could read it and is not wired: the wire to write.
fn open_input(model: &Model<'_>, wires: &[Vec<Wire>], node: usize) -> Option<String> {
    let outputs = model.outputs(Producer::Node(node))?;
    let above = upstream(wires, BTreeSet::from([node]));
    let flat = &model.flat.nodes;
    let beside = (0..flat.len()).filter(|other| flat[*other].scope == flat[node].scope && !above.contains(other));
    let mut inputs = beside.flat_map(|other| {
        let spec = model.nodes[other].as_ref().map(|(_, spec)| spec);
        let open = spec
            .into_iter()
            .flat_map(|spec| spec.inputs.iter().enumerate())
            .filter(move |(index, input)| input.need.is_many || wires[other].iter().all(|wire| wire.input != *index));
        open.map(move |(_, input)| (other, input))
    });
    inputs.find_map(|(other, input)| {
        let output = outputs.iter().find(|output| may_fit(output, input))?;
        let name = if input.need.is_many { "NAME" } else { &*input.name };
        let (from, to) = (&flat[node].block.key.name, &flat[other].block.key.name);
        Some(format!("`in.{name} = \"{from}.{}\"` to `{to}`", output.name))
    })
}

const fn node_of(producer: Producer) -> Option<usize> {
    match producer {
        Producer::Node(node) => Some(node),
        Producer::Role(_) => None,
    }
}

/// Some nodes and all that they follow from.
fn upstream(wires: &[Vec<Wire>], nodes: BTreeSet<usize>) -> BTreeSet<usize> {
    let mut open: Vec<usize> = nodes.iter().copied().collect();
    let mut reached = nodes;
    while let Some(node) = open.pop() {
        let sources = wires[node].iter().filter_map(|wire| node_of(wire.source.producer));
        open.extend(sources.filter(|source| reached.insert(*source)));
    }
    reached
}
