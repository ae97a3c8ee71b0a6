//! The order in which the nodes step, and the cycles that prevent one.

use super::Net;
use super::sorter::{Edge, Sorter};
use crate::graph::plan::Producer;
use crate::source::{Code, Diagnostic, Diagnostics};

impl Net<'_> {
    /// Returns the nodes in topological order: rank by rank, and in file order within a rank.
    ///
    /// Neighbours in this order rarely depend on each other, so the processor can overlap their work. A delayed input
    /// reads the value of the previous tick, so its node steps before its source.
    pub(super) fn find_order(&self, diagnostics: &mut Diagnostics) -> Vec<usize> {
        let mut sorter = Sorter::new(edges(self), self.wires.len());
        loop {
            sorter.place_free();
            let Some(cycle) = sorter.find_cycle() else { return sorter.order };
            let edges: Vec<&Edge> = cycle.iter().map(|edge| &sorter.edges[*edge]).collect();
            diagnostics.push(report_cycle(self, &edges));
            // The rest is ordered as if the last wire of the cycle were missing.
            sorter.cut(*cycle.last().expect("a cycle has wires"));
        }
    }
}

fn edges(net: &Net<'_>) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (consumer, wires) in net.wires.iter().enumerate() {
        for (i, wire) in wires.iter().enumerate() {
            let Producer::Node(producer) = wire.source.producer else { continue };
            let is_delayed = net.input(consumer, wire).need.is_delayed;
            let (first, then) = if is_delayed { (consumer, producer) } else { (producer, consumer) };
            edges.push(Edge { first, then, wire: (consumer, i), is_delayed, is_cut: false });
        }
    }
    edges
}

fn report_cycle(net: &Net<'_>, cycle: &[&Edge]) -> Diagnostic {
    let step = |edge: &&Edge| {
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
