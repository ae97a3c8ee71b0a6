//! Explains a command whose motion is limited before a node that makes a motion of its own from it, such as a sum: two
//! motions within a limit may exceed it together.

use std::collections::BTreeSet;

use crate::graph::net::limits::PathNode;
use crate::graph::net::{CommandWire, Net, Wire};
use crate::graph::plan::{PortRef, Producer};
use crate::signal::Kind;
use crate::source::quoted;

/// The limiters in front of an input of the node at which the path of a command ends.
struct Chain<'a> {
    /// The wire into that node.
    wire: &'a Wire,
    /// The first limiter of the motion, and its wire.
    first: (usize, &'a Wire),
}

/// Returns how to move a node behind which limits in front of it do not hold. The `path` is that of the command, the
/// last node first, and `missing` are the limits that its motion lacks.
pub(super) fn help(net: &Net<'_>, wire: &CommandWire, path: &[PathNode<'_>], missing: &[&str]) -> Option<String> {
    let end = path.last().map_or(wire.source, |stop| stop.source);
    let node = end.producer.node()?;
    let is_motion = |wire: &&Wire| matches!(net.port(wire.source).kind, Kind::Twist | Kind::Joints);
    let wires = net.wires[node].iter().filter(is_motion);
    let chains: Vec<Chain<'_>> = wires.filter_map(|wire| find_chain(net, wire, missing)).collect();
    let (flat, sum) = (&net.flat.nodes[node], net.port_name(end));
    let name = &flat.name;
    let lost = format!(
        "`{name}` computes a new motion, so the limits before it do not hold behind it: put it before the limiters"
    );
    let [Chain { wire: limited, first: (limiter, start) }] = chains.as_slice() else {
        let limiters: Vec<_> = chains.iter().map(|chain| &net.flat.nodes[chain.first.0].name).collect();
        let both = format!("{lost}, and leave out all but one of the chains that begin with {}", quoted(limiters));
        return (!chains.is_empty()).then_some(both);
    };
    let mut near = [*limiter].into_iter().chain(path.last().map(|stop| stop.node));
    if !near.all(|other| net.flat.nodes[other].scope == flat.scope) {
        return Some(lost);
    }
    let own = |name: &str| name.rsplit('.').next().unwrap_or(name).to_owned();
    let (block, first) = (own(name), own(&net.flat.nodes[*limiter].name));
    let source = |wire: &Wire| wire.origin.inner.as_ref().unwrap_or(&wire.origin.word).value.clone();
    let taker = path.last().map_or_else(
        || format!("[commands]\n{} = \"{}\"", net.command_name(wire), source(limited)),
        |stop| {
            let through = stop.spec.limits.through.unwrap_or_default();
            let taker = own(&net.flat.nodes[stop.node].name);
            format!("[nodes.{taker}]\nin.{through} = \"{}\"", source(limited))
        },
    );
    let output = sum.rsplit('.').next().unwrap_or_default().to_owned();
    Some(format!(
        "{lost}:\n[nodes.{block}]\nin.{} = \"{}\"\n[nodes.{first}]\nin.{} = \"{block}.{output}\"\n{taker}",
        limited.key.name,
        source(start),
        start.key.name
    ))
}

/// Follows a motion backwards to the first of the limiters that hold a missing limit.
fn find_chain<'n>(net: &'n Net<'_>, wire: &'n Wire, missing: &[&str]) -> Option<Chain<'n>> {
    let (mut at, mut first, mut seen) = (wire.source, None, BTreeSet::new());
    while let Some((node, next)) = motion_into(net, at).filter(|(node, _)| seen.insert(*node)) {
        let limits = net.spec(node)?.limits;
        if limits.holds.iter().any(|limit| missing.contains(limit)) {
            first = Some((node, next));
        }
        at = next.source;
    }
    first.map(|first| Chain { wire, first })
}

/// Returns the node that passes on the motion of a port, and the wire of that motion.
fn motion_into<'n>(net: &'n Net<'_>, port: PortRef) -> Option<(usize, &'n Wire)> {
    let Producer::Node(node) = port.producer else { return None };
    let through = net.spec(node)?.limits.through?;
    let wire = net.wires[node].iter().find(|wire| net.input(node, wire).name == through)?;
    Some((node, wire))
}
