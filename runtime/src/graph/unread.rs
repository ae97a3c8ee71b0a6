//! Nodes whose work is lost: in a graph that drives a command, nothing follows from them that anything uses.
//!
//! A wire that was deleted by mistake leaves such a node behind. What is used is what a command follows from, what a
//! node without outputs reads, and what a part exports: whether a task takes it is the task's business.

use std::collections::BTreeSet;

use super::plan::Producer;
use super::wires::{CommandWire, Model, Wire};
use crate::diagnostic::{Code, Diagnostic};

/// What is to be looked at; nothing in a graph without commands, which is there to be recorded.
pub(crate) fn unread(model: &Model<'_>, wires: &[Vec<Wire>], commands: &[CommandWire]) -> Vec<Diagnostic> {
    if commands.is_empty() {
        return Vec::new();
    }
    let readers = |node: usize| {
        let reads = move |wires: &Vec<Wire>| wires.iter().any(|wire| wire.source.producer == Producer::Node(node));
        wires.iter().enumerate().filter(move |(_, wires)| reads(wires)).map(|(reader, _)| reader)
    };
    let sinks = (0..wires.len()).filter(|node| model.outputs(Producer::Node(*node)).is_some_and(<[_]>::is_empty));
    let driving = commands.iter().map(|wire| wire.source.producer);
    let used = driving.chain(model.exported()).chain(sinks.map(Producer::Node));
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
            let help = "wire an output of it to another node, or take it out";
            found.push(Diagnostic::new(Code::UnreadNode, key.span.clone(), message).help(help));
            // What only it reads needs no word of its own.
            used.extend(upstream(wires, BTreeSet::from([node])));
        }
    }
    found
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
