//! The order in which the nodes step, and the cycles that prevent one.

use super::Net;
use crate::graph::plan::Producer;
use crate::source::{Code, Diagnostic, Diagnostics};

/// A wire between two nodes, which determines which one steps first.
#[derive(Debug, Clone)]
struct Edge {
    first: usize,
    then: usize,
    /// Index of the consumer, and index of the wire among its wires.
    wire: (usize, usize),
    is_delayed: bool,
}

impl Net<'_> {
    /// Returns the nodes in topological order: rank by rank, and in file order within a rank.
    ///
    /// Neighbours in this order rarely depend on each other, so the processor can overlap their work. A delayed input
    /// reads the value of the previous tick, so its node steps before its source.
    pub(super) fn find_order(&self, diagnostics: &mut Diagnostics) -> Vec<usize> {
        let mut edges = edges(self);
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
                let cycle = find_cycle(rest[0], &edges);
                diagnostics.push(report_cycle(self, &cycle));
                // The rest is ordered as if the last wire of the cycle were missing.
                let cut = cycle.last().expect("a cycle has wires").wire;
                edges.retain(|edge| edge.wire != cut);
            }
        }
        order
    }
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

/// Returns a cycle among nodes that all wait for another one, by walking backwards until a node repeats.
fn find_cycle(start: usize, edges: &[Edge]) -> Vec<Edge> {
    let (mut path, mut node): (Vec<Edge>, usize) = (Vec::new(), start);
    loop {
        let edge = edges.iter().find(|edge| edge.then == node).expect("every node waits for another one").clone();
        node = edge.first;
        path.push(edge);
        if let Some(from) = path.iter().position(|edge| edge.then == node) {
            let mut cycle = path.split_off(from);
            cycle.reverse();
            return cycle;
        }
    }
}

fn report_cycle(net: &Net<'_>, cycle: &[Edge]) -> Diagnostic {
    let step = |edge: &Edge| {
        let (consumer, i) = edge.wire;
        let wire = &net.wires[consumer][i];
        let text = format!("`{}` -> `{}.{}`", net.port_name(wire.source), net.flat.nodes[consumer].name, wire.key.name);
        (wire.origin.word.span.clone(), text)
    };
    let steps: Vec<_> = cycle.iter().map(step).collect();
    let path = steps.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>().join(", ");
    let (span, _) = steps.last().expect("a cycle has wires").clone();
    let mut diagnostic = Diagnostic::new(Code::Loop, span, format!("the wires form a cycle: {path}"));
    diagnostic.notes = steps.iter().rev().skip(1).rev().cloned().collect();
    diagnostic.help(if cycle.iter().all(|edge| edge.is_delayed) {
        "every input in this cycle is delayed: insert a node whose input is not delayed"
    } else {
        "route one of these wires through a node with a delayed input"
    })
}
