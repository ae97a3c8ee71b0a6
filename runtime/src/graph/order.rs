//! The order in which the nodes step, or the circle that forbids one.

use super::plan::Producer;
use super::wires::{CommandWire, Model, Wire};
use crate::diagnostic::{Code, Diagnostic};

/// Who reads what, and in which order all step.
#[derive(Clone, Copy)]
pub(crate) struct Wiring<'a> {
    pub(crate) order: &'a [usize],
    /// The wires of each node.
    pub(crate) wires: &'a [Vec<Wire>],
    pub(crate) commands: &'a [CommandWire],
}

/// A wire between two nodes that says which one steps first.
#[derive(Debug, Clone)]
struct Edge {
    first: usize,
    then: usize,
    /// The consumer's index and its wire, whichever steps first.
    wire: (usize, usize),
    is_delayed: bool,
}

/// The nodes in the order in which they step: rank by rank, those that wait for nothing first, as in the file within a
/// rank. So a node seldom waits for what the one before it has just written, and the processor works on both at once.
///
/// A delayed input reads what the last tick left, so its node steps before the one it reads.
pub(crate) fn order(model: &Model<'_>, wires: &[Vec<Wire>], found: &mut Vec<Diagnostic>) -> Vec<usize> {
    let mut edges = edges(model, wires);
    found.extend(delayed_roles(model, wires));
    let mut rest: Vec<usize> = (0..wires.len()).collect();
    let mut order = Vec::new();
    while !rest.is_empty() {
        let is_free = |node: &usize| !edges.iter().any(|edge| edge.then == *node);
        let (free, bound): (Vec<usize>, Vec<usize>) = rest.iter().partition(|node| is_free(node));
        if !free.is_empty() {
            edges.retain(|edge| !free.contains(&edge.first));
            order.extend(free);
            rest = bound;
        } else {
            let circle = circle(rest[0], &edges);
            found.push(describe(model, wires, &circle));
            // The rest is ordered as if the circle were cut at its last wire.
            let cut = circle.last().expect("a circle has wires").wire;
            edges.retain(|edge| edge.wire != cut);
        }
    }
    order
}

/// A role is latched before every node, so there is nothing of the last tick left to read.
fn delayed_roles(model: &Model<'_>, wires: &[Vec<Wire>]) -> Vec<Diagnostic> {
    let mut mistakes = Vec::new();
    for (node, wires) in wires.iter().enumerate() {
        let Some((_, spec)) = &model.nodes[node] else { continue };
        let from_role =
            |wire: &&Wire| spec.inputs[wire.input].need.is_delayed && matches!(wire.source.producer, Producer::Role(_));
        for wire in wires.iter().filter(from_role) {
            let (name, key) = (&model.flat.nodes[node].name, &wire.key.name);
            let message = format!("`{name}.{key}` reads what the last tick left, which a role does not keep");
            mistakes.push(wire.origin.mistake(Code::Loop, message).help("wire it from a node"));
        }
    }
    mistakes
}

fn edges(model: &Model<'_>, wires: &[Vec<Wire>]) -> Vec<Edge> {
    let mut edges = Vec::new();
    for (consumer, wires) in wires.iter().enumerate() {
        for (i, wire) in wires.iter().enumerate() {
            let Producer::Node(producer) = wire.source.producer else { continue };
            let (_, spec) = model.nodes[consumer].as_ref().expect("only known nodes have wires");
            let is_delayed = spec.inputs[wire.input].need.is_delayed;
            let (first, then) = if is_delayed { (consumer, producer) } else { (producer, consumer) };
            edges.push(Edge { first, then, wire: (consumer, i), is_delayed });
        }
    }
    edges
}

/// A circle among nodes none of which is free: walk backwards until a node comes again.
fn circle(start: usize, edges: &[Edge]) -> Vec<Edge> {
    let (mut path, mut node): (Vec<Edge>, usize) = (Vec::new(), start);
    loop {
        let edge = edges.iter().find(|edge| edge.then == node).expect("no node is free").clone();
        node = edge.first;
        path.push(edge);
        if let Some(from) = path.iter().position(|edge| edge.then == node) {
            let mut circle = path.split_off(from);
            circle.reverse();
            return circle;
        }
    }
}

fn describe(model: &Model<'_>, wires: &[Vec<Wire>], circle: &[Edge]) -> Diagnostic {
    let step = |edge: &Edge| {
        let (consumer, i) = edge.wire;
        let wire = &wires[consumer][i];
        let text =
            format!("`{}` -> `{}.{}`", model.port_name(wire.source), model.flat.nodes[consumer].name, wire.key.name);
        (wire.origin.word.span.clone(), text)
    };
    let steps: Vec<_> = circle.iter().map(step).collect();
    let path = steps.iter().map(|(_, text)| text.as_str()).collect::<Vec<_>>().join(", ");
    let (span, _) = steps.last().expect("a circle has wires").clone();
    let mut diagnostic = Diagnostic::new(Code::Loop, span, format!("wires run in a circle: {path}"));
    diagnostic.notes = steps.iter().rev().skip(1).rev().cloned().collect();
    diagnostic.help(if circle.iter().all(|edge| edge.is_delayed) {
        "a circle of delays alone holds nothing: let it go through a node that declares none"
    } else {
        "let one of them go through a node that declares a delay"
    })
}
