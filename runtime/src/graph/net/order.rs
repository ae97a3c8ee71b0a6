//! The order in which the nodes step, or the cycle that forbids one.

use super::{Net, Wire};
use crate::graph::plan::Producer;
use crate::source::{Code, Diagnostic};

/// A wire between two nodes that says which one steps first.
#[derive(Debug, Clone)]
struct Edge {
    first: usize,
    then: usize,
    /// The consumer's index and its wire, whichever steps first.
    wire: (usize, usize),
    is_delayed: bool,
}

impl Net<'_> {
    /// The nodes in the order in which they step: rank by rank, those that wait for nothing first, as in the file
    /// within a rank. So a node seldom waits for what the one before it has just written, and the processor works on
    /// both at once.
    ///
    /// A delayed input reads the last tick's value, so its node steps before the one it reads.
    pub(super) fn ordered(&self, found: &mut Vec<Diagnostic>) -> Vec<usize> {
        let mut edges = edges(self);
        found.extend(delayed_roles(self));
        let mut rest: Vec<usize> = (0..self.wires.len()).collect();
        let mut order = Vec::new();
        while !rest.is_empty() {
            let is_free = |node: &usize| !edges.iter().any(|edge| edge.then == *node);
            let (free, bound): (Vec<usize>, Vec<usize>) = rest.iter().partition(|node| is_free(node));
            if !free.is_empty() {
                edges.retain(|edge| !free.contains(&edge.first));
                order.extend(free);
                rest = bound;
            } else {
                let cycle = cycle(rest[0], &edges);
                found.push(describe(self, &cycle));
                // The rest is ordered as if the cycle were cut at its last wire.
                let cut = cycle.last().expect("a cycle has wires").wire;
                edges.retain(|edge| edge.wire != cut);
            }
        }
        order
    }
}

/// A role is latched before every node, so there is nothing of the last tick left to read.
fn delayed_roles(net: &Net<'_>) -> Vec<Diagnostic> {
    let mut mistakes = Vec::new();
    for (node, wires) in net.wires.iter().enumerate() {
        let from_role =
            |wire: &&Wire| net.input(node, wire).need.is_delayed && matches!(wire.source.producer, Producer::Role(_));
        for wire in wires.iter().filter(from_role) {
            let (name, key) = (&net.flat.nodes[node].name, &wire.key.name);
            let message = format!("`{name}.{key}` reads what the last tick left, which a role does not keep");
            mistakes.push(wire.origin.mistake(Code::Loop, message).help("wire it from a node"));
        }
    }
    mistakes
}

fn edges(net: &Net<'_>) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (consumer, wires) in net.wires.iter().enumerate() {
        for (i, wire) in wires.iter().enumerate() {
            let Producer::Node(producer) = wire.source.producer else { continue };
            let is_delayed = net.input(consumer, wire).need.is_delayed;
            let (first, then) = if is_delayed { (consumer, producer) } else { (producer, consumer) };
            edges.push(Edge { first, then, wire: (consumer, i), is_delayed });
        }
    }
    edges
}

/// A cycle among nodes none of which is free: walk backwards until a node comes again.
fn cycle(start: usize, edges: &[Edge]) -> Vec<Edge> {
    let (mut path, mut node): (Vec<Edge>, usize) = (Vec::new(), start);
    loop {
        let edge = edges.iter().find(|edge| edge.then == node).expect("no node is free").clone();
        node = edge.first;
        path.push(edge);
        if let Some(from) = path.iter().position(|edge| edge.then == node) {
            let mut cycle = path.split_off(from);
            cycle.reverse();
            return cycle;
        }
    }
}

fn describe(net: &Net<'_>, cycle: &[Edge]) -> Diagnostic {
    let step = |edge: &Edge| {
        let (consumer, i) = edge.wire;
        let wire = &net.wires[consumer][i];
        let text = format!("`{}` -> `{}.{}`", net.port_name(wire.source), net.flat.nodes[consumer].name, wire.key.name);
        (wire.origin.word.span.clone(), text)
    };
    let steps: Vec<_> = cycle.iter().map(step).collect();
    let path = steps.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>().join(", ");
    let (span, _) = steps.last().expect("a cycle has wires").clone();
    let mut diagnostic = Diagnostic::new(Code::Loop, span, format!("wires run in a cycle: {path}"));
    diagnostic.notes = steps.iter().rev().skip(1).rev().cloned().collect();
    diagnostic.help(if cycle.iter().all(|edge| edge.is_delayed) {
        "a cycle of delays alone holds nothing: let it go through a node that declares none"
    } else {
        "let one of them go through a node that declares a delay"
    })
}
