//! Checks that every command passes the limits that its role requires.
//!
//! From each command the check follows the motion backwards and collects the limits that the nodes on the path hold. A
//! limit does not count if a later node on the path may break it.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::check::frames::{Frames, with_article};
use crate::graph::net::{CommandWire, Net};
use crate::graph::plan::{PortRef, Producer};
use crate::node::{NodeSpec, Spanned};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// A node on the path of a command that passes a motion on.
struct PathNode<'a> {
    node: usize,
    spec: &'a NodeSpec,
    /// The source of its motion, and the text that names it.
    source: PortRef,
    word: &'a Spanned<String>,
}

/// Reports each command whose path lacks a required limit, with the node to insert and its place.
pub(crate) fn check(net: &Net<'_>, frames: &mut Frames<'_>, diagnostics: &mut Diagnostics) {
    for command in net.commands.iter().filter(|command| !command.is_report) {
        let role = net.roles[command.role].expect("only known roles have commands");
        // A missing wire has its own diagnostic, and hides the nodes behind it.
        let Some(path) = find_path(net, command.source) else { continue };
        let mut held: Vec<&str> = Vec::new();
        let mut lost: Vec<(&str, &str)> = Vec::new();
        for stop in path.iter().rev() {
            let limits = &stop.spec.limits;
            lost.retain(|(limit, _)| !limits.holds.contains(limit));
            let name = net.flat.nodes[stop.node].name.as_str();
            lost.extend(held.iter().filter(|held| limits.breaks.contains(held)).map(|held| (*held, name)));
            held.retain(|held| !limits.breaks.contains(held));
            held.extend(limits.holds);
        }
        let missing: Vec<&str> =
            role.limits.iter().map(|limit| &**limit).filter(|limit| !held.contains(limit)).collect();
        if !missing.is_empty() {
            diagnostics.push(unlimited(net, command, &path, &missing, &lost));
        }
        diagnostics.extend(mixed_frames(net, frames, &path));
    }
}

/// Returns the nodes that a motion passes, the last one first, or `None` if a wire is missing.
fn find_path<'a>(net: &'a Net<'_>, from: PortRef) -> Option<Vec<PathNode<'a>>> {
    let (mut path, mut at) = (Vec::<PathNode<'_>>::new(), from);
    while let Producer::Node(node) = at.producer {
        let spec = net.spec(node)?;
        let Some(through) = spec.limits.through else { break };
        let input = spec.inputs.iter().position(|input| input.name == through)?;
        let wire = net.wires[node].iter().find(|wire| wire.input == input)?;
        let (source, word) = (wire.source, wire.origin.inner.as_ref().unwrap_or(&wire.origin.word));
        if path.iter().any(|stop| stop.node == node) {
            return None;
        }
        path.push(PathNode { node, spec, source, word });
        at = source;
    }
    Some(path)
}

fn unlimited(
    net: &Net<'_>,
    command: &CommandWire,
    path: &[PathNode<'_>],
    missing: &[&str],
    lost: &[(&str, &str)],
) -> Diagnostic {
    let consumer = net.command_name(command);
    let names = quoted(missing);
    let source = net.port_name(command.source);
    let plural = if missing.len() == 1 { "" } else { "s" };
    let message = format!("`{source}` drives `{consumer}` without the required limit{plural} {names}");
    if let Some(part) = suggest_part(net, command, missing).filter(|_| lost.is_empty()) {
        return command.origin.diagnostic(Code::UnlimitedCommand, message).help(part);
    }
    let (mut helps, mut places) = (Vec::new(), Vec::new());
    let mut suggested = BTreeSet::new();
    for limit in missing {
        if let Some((_, by)) = lost.iter().find(|(lost, _)| lost == limit) {
            helps.push(format!("`{by}` may break the limit `{limit}`: move it before the node that holds this limit"));
            continue;
        }
        let holds = |spec: &NodeSpec| spec.limits.holds.contains(limit);
        let Some(spec) = net.catalogue.specs().find(|spec| holds(spec)) else { continue };
        if suggested.insert(spec.name.to_string()) {
            let (help, place) = suggest_limiter(net, command, &consumer, path, spec);
            helps.push(help);
            places.extend(place.map(|place| (place, format!("insert a `{}` here", spec.name))));
        }
    }
    let mut diagnostic = command.origin.diagnostic(Code::UnlimitedCommand, message);
    diagnostic.notes.extend(places.into_iter().filter(|(place, _)| *place != command.origin.word.span));
    diagnostic.with_help((!helps.is_empty()).then(|| helps.join("\n")))
}

/// Suggests a built-in part that holds all missing limits, if they need three or more nodes.
fn suggest_part(net: &Net<'_>, command: &CommandWire, missing: &[&str]) -> Option<String> {
    let limiters: BTreeSet<&str> = missing
        .iter()
        .filter_map(|limit| net.catalogue.specs().find(|spec| spec.limits.holds.contains(limit)))
        .map(|spec| &*spec.name)
        .collect();
    if limiters.len() < 3 {
        return None;
    }
    let parts = net.catalogue.builtin_files().iter().filter(|(name, _)| name.ends_with(".toml"));
    let mut parts =
        parts.filter_map(|(name, bytes)| Some((*name, str::from_utf8(bytes).ok()?.parse::<toml::Table>().ok()?)));
    let (file, part) = parts.find(|(_, part)| {
        let nodes = part.get("nodes").and_then(toml::Value::as_table);
        let kinds: Vec<&str> = nodes.into_iter().flatten().filter_map(|(_, node)| node.get("type")?.as_str()).collect();
        limiters.iter().all(|limiter| kinds.contains(limiter))
    })?;
    let name = file.rsplit('/').next()?.strip_suffix(".toml")?;
    let role = net.name(Producer::Role(command.role));
    let taken = &net.command_port(command).name;
    let mut text =
        format!("route the motion through a part that holds all of them:\n[parts.{name}]\nfile = \"builtin:{file}\"");
    for (input, what) in part.get("inputs").and_then(toml::Value::as_table).into_iter().flatten() {
        text.push_str(&format!("\nin.{input} = \"…\"   # {}", what.as_str().unwrap_or_default()));
    }
    text.push_str(&format!("\n[commands]\n{role}.{taken} = \"{name}.{taken}\""));
    Some(text)
}

/// Suggests a limiter and its place on the path: after every limiter that must come before it.
fn suggest_limiter(
    net: &Net<'_>,
    command: &CommandWire,
    consumer: &str,
    path: &[PathNode<'_>],
    limiter: &NodeSpec,
) -> (String, Option<Range<usize>>) {
    let order = &net.roles[command.role].expect("only known roles have commands").limits;
    let rank = |spec: &NodeSpec| {
        let ranks = spec.limits.holds.iter().filter_map(|limit| order.iter().position(|known| known == limit));
        ranks.max()
    };
    let (name, through) = (&limiter.name, limiter.limits.through.unwrap_or_default());
    let kind = limiter.inputs.iter().find(|input| input.name == through).map(|input| input.kind);
    // The wires on the path, from the command backwards: consumer, source, and the text that names the source.
    let mut links = vec![(consumer.to_owned(), command.source, &command.origin.word)];
    for stop in path {
        let through = stop.spec.limits.through.unwrap_or_default();
        links.push((format!("{}.{through}", net.flat.nodes[stop.node].block.key.name), stop.source, stop.word));
    }
    // After a change of frame, a twist is no longer in the frame of the sensor.
    let changes_frame = |stop: &PathNode<'_>| {
        let gives = net.outputs(Producer::Node(stop.node)).and_then(|ports| ports.first()).map(|port| port.kind);
        stop.spec.limits.holds.is_empty() && gives == Some(net.port(stop.source).kind)
    };
    let later = path.iter().rposition(|stop| rank(stop.spec) > rank(limiter)).map_or(0, |at| at + 1);
    let fits = |at: &usize| Some(net.port(links[*at].1).kind) == kind && !path[*at..].iter().any(changes_frame);
    let at = (later..links.len()).find(fits).or_else(|| (0..links.len()).rev().find(fits));
    let Some((taker, _, word)) = at.map(|at| &links[at]) else {
        return (format!("insert a `{name}` on the path of the motion"), None);
    };
    let needs = limiter.inputs.iter().filter(|input| input.need.must_be_wired);
    let mut block = format!(
        "insert {limiter} between `{0}` and `{taker}`:\n[nodes.{name}]\ntype = \"{name}\"\nin.{through} = \"{0}\"",
        word.value,
        limiter = with_article(name)
    );
    for input in needs.filter(|input| input.name != through) {
        block.push_str(&format!("\nin.{} = \"…\"", input.name));
    }
    for param in limiter.params.iter().filter(|param| !param.is_optional) {
        let unit = param.unit.as_ref().map(|unit| format!("   # [{unit}]")).unwrap_or_default();
        block.push_str(&format!("\n{} = …{unit}", param.name));
    }
    (block, Some(word.span.clone()))
}

/// Reports limiters of twists on one path that work in different frames.
fn mixed_frames(net: &Net<'_>, frames: &mut Frames<'_>, path: &[PathNode<'_>]) -> Option<Diagnostic> {
    let mut limiters = path.iter().rev().filter(|stop| !stop.spec.limits.holds.is_empty());
    let mut frame = |stop: &PathNode<'_>| {
        let source = PortRef { producer: Producer::Node(stop.node), port: 0 };
        let is_twist = net.port(source).kind == Kind::Twist;
        is_twist.then(|| frames.of(source).into_iter().next().flatten()).flatten()
    };
    let first = limiters.find_map(|stop| Some((stop, frame(stop)?)))?;
    let (other, its) = limiters.find_map(|stop| Some((stop, frame(stop).filter(|frame| *frame != first.1)?)))?;
    let (node, before) = (&net.flat.nodes[other.node], &net.flat.nodes[first.0.node].name);
    let message = format!(
        "`{}` limits a twist in `{its}`, but the limiter `{before}` before it works in `{}`",
        node.name, first.1
    );
    let diagnostic = Diagnostic::new(Code::FrameMismatch, node.block.key.span.clone(), message);
    Some(diagnostic.help("limits apply to the motion of the sensor: move it before the change of frame"))
}
