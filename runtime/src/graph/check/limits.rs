//! Checks that every command passes the limits that its role requires.
//!
//! From each command the check follows the motion backwards and collects the limits that the nodes on the path hold. A
//! limit does not count if a later node on the path may break it.

use std::collections::BTreeSet;
use std::ops::Range;

use super::foreign;
use super::frames::{Frames, with_article};
use crate::device::RoleType;
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

/// A command and the nodes that its motion passes, the last one first.
struct CommandPath<'a> {
    net: &'a Net<'a>,
    wire: &'a CommandWire,
    role: &'a RoleType,
    nodes: Vec<PathNode<'a>>,
}

/// Reports each command whose path lacks a required limit, with the node to insert and its place.
pub(crate) fn check(net: &Net<'_>, frames: &mut Frames<'_>, diagnostics: &mut Diagnostics) {
    for wire in net.commands.iter().filter(|wire| !wire.is_report) {
        // A missing wire has its own diagnostic, and hides the nodes behind it.
        let Some(path) = CommandPath::find(net, wire) else { continue };
        let mut held: Vec<&str> = Vec::new();
        let mut lost: Vec<(&str, &str)> = Vec::new();
        for stop in path.nodes.iter().rev() {
            let limits = &stop.spec.limits;
            lost.retain(|(limit, _)| !limits.holds.contains(limit));
            let name = net.flat.nodes[stop.node].name.as_str();
            lost.extend(held.iter().filter(|held| limits.breaks.contains(held)).map(|held| (*held, name)));
            held.retain(|held| !limits.breaks.contains(held));
            held.extend(limits.holds);
        }
        let required = path.role.limits.iter().map(|limit| &**limit);
        let missing: Vec<&str> = required.filter(|limit| !held.contains(limit)).collect();
        if !missing.is_empty() {
            diagnostics.push(path.unlimited(&missing, &lost));
        }
        diagnostics.extend(path.mixed_frames(frames));
        // A wire in the wrong frame has its own diagnostic.
        let limiters = path.nodes.iter().filter(|stop| !stop.spec.limits.holds.is_empty());
        for stop in limiters.filter(|stop| !frames.has_clash(stop.node)).collect::<Vec<_>>() {
            diagnostics.extend(foreign::check(net, frames, wire.role, stop.node, stop.source));
        }
    }
}

impl<'a> CommandPath<'a> {
    /// Follows a motion backwards, or returns `None` if a wire is missing.
    fn find(net: &'a Net<'a>, wire: &'a CommandWire) -> Option<Self> {
        let mut path = Self { net, wire, role: net.roles[wire.role]?, nodes: Vec::new() };
        let (mut at, mut passed) = (wire.source, BTreeSet::new());
        while let Producer::Node(node) = at.producer {
            let spec = net.spec(node)?;
            let Some(through) = spec.limits.through else { break };
            let input = spec.inputs.iter().position(|input| input.name == through)?;
            let wire = net.wires[node].iter().find(|wire| wire.input == input)?;
            let (source, word) = (wire.source, wire.origin.inner.as_ref().unwrap_or(&wire.origin.word));
            if !passed.insert(node) {
                return None;
            }
            path.nodes.push(PathNode { node, spec, source, word });
            at = source;
        }
        Some(path)
    }

    /// Returns the diagnostic of the missing limits, of which the nodes in `lost` broke some.
    fn unlimited(&self, missing: &[&str], lost: &[(&str, &str)]) -> Diagnostic {
        let Self { net, wire, .. } = self;
        let consumer = net.command_name(wire);
        let names = quoted(missing);
        let source = net.port_name(wire.source);
        let plural = if missing.len() == 1 { "" } else { "s" };
        let message = format!("`{source}` drives `{consumer}` without the required limit{plural} {names}");
        if let Some(part) = self.suggest_part(missing).filter(|_| lost.is_empty()) {
            return wire.origin.diagnostic(Code::UnlimitedCommand, message).help(part);
        }
        let (mut helps, mut places) = (Vec::new(), Vec::new());
        let mut suggested = BTreeSet::new();
        for limit in missing {
            if let Some((_, by)) = lost.iter().find(|(lost, _)| lost == limit) {
                helps.push(format!(
                    "`{by}` may break the limit `{limit}`: move `{by}` before the node that enforces `{limit}`"
                ));
                continue;
            }
            let holds = |spec: &NodeSpec| spec.limits.holds.contains(limit);
            let Some(spec) = net.catalogue.specs().find(|spec| holds(spec)) else { continue };
            if suggested.insert(spec.name.to_string()) {
                let (help, place) = self.suggest_limiter(spec);
                helps.push(help);
                places.extend(place.map(|place| (place, format!("insert a `{}` here", spec.name))));
            }
        }
        let mut diagnostic = wire.origin.diagnostic(Code::UnlimitedCommand, message);
        diagnostic.notes.extend(places.into_iter().filter(|(place, _)| *place != wire.origin.word.span));
        diagnostic.with_help((!helps.is_empty()).then(|| helps.join("\n")))
    }

    /// Suggests a built-in part that holds all missing limits, if they need three or more nodes.
    fn suggest_part(&self, missing: &[&str]) -> Option<String> {
        let Self { net, wire, .. } = self;
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
            let kinds: Vec<&str> =
                nodes.into_iter().flatten().filter_map(|(_, node)| node.get("type")?.as_str()).collect();
            limiters.iter().all(|limiter| kinds.contains(limiter))
        })?;
        let name = file.rsplit('/').next()?.strip_suffix(".toml")?;
        let role = net.name(Producer::Role(wire.role));
        let taken = &net.command_port(wire).name;
        let mut text = format!(
            "route the motion through a part that enforces all of them:\n[parts.{name}]\nfile = \"builtin:{file}\""
        );
        for (input, what) in part.get("inputs").and_then(toml::Value::as_table).into_iter().flatten() {
            text.push_str(&format!("\nin.{input} = \"…\"   # {}", what.as_str().unwrap_or_default()));
        }
        text.push_str(&format!("\n[commands]\n{role}.{taken} = \"{name}.{taken}\""));
        Some(text)
    }

    /// Suggests a limiter and its place on the path: after every limiter that must come before it.
    fn suggest_limiter(&self, limiter: &NodeSpec) -> (String, Option<Range<usize>>) {
        let Self { net, wire, role, nodes: path } = self;
        let rank = |spec: &NodeSpec| {
            let ranks =
                spec.limits.holds.iter().filter_map(|limit| role.limits.iter().position(|known| known == limit));
            ranks.max()
        };
        let (name, through) = (&limiter.name, limiter.limits.through.unwrap_or_default());
        let kind = limiter.inputs.iter().find(|input| input.name == through).map(|input| input.kind);
        // The wires on the path, from the command backwards: consumer, source, and the text that names the source.
        let mut links = vec![(net.command_name(wire), wire.source, &wire.origin.word)];
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
        let output = limiter.outputs.first().map_or("", |output| &output.name);
        let (limiter_name, from) = (with_article(name), &word.value);
        let between =
            format!("insert {limiter_name} between `{from}` and `{taker}`, which then takes `{name}.{output}`:");
        (format!("{between}\n{}", block(limiter, &word.value)), Some(word.span.clone()))
    }

    /// Reports limiters of twists on one path that work in different frames.
    fn mixed_frames(&self, frames: &mut Frames<'_>) -> Option<Diagnostic> {
        let net = self.net;
        let mut limiters = self.nodes.iter().rev().filter(|stop| !stop.spec.limits.holds.is_empty());
        let mut frame = |stop: &PathNode<'_>| {
            let source = PortRef { producer: Producer::Node(stop.node), port: 0 };
            let is_twist = net.port(source).kind == Kind::Twist;
            is_twist.then(|| frames.of(source).into_iter().next().flatten()).flatten()
        };
        let first = limiters.find_map(|stop| Some((stop, frame(stop)?)))?;
        let (other, its) = limiters.find_map(|stop| Some((stop, frame(stop).filter(|frame| *frame != first.1)?)))?;
        let (node, before) = (&net.flat.nodes[other.node], &net.flat.nodes[first.0.node].name);
        let message = format!(
            "`{}` limits a twist in `{its}`, but `{before}`, the limiter before it, limits a twist in `{}`",
            node.name, first.1
        );
        let diagnostic = Diagnostic::new(Code::FrameMismatch, node.block.key.span.clone(), message);
        Some(diagnostic.help("limits apply to the motion of the sensor: move this limiter before the change of frame"))
    }
}

/// Returns the block of a limiter of the motion from `source`, to be completed.
fn block(limiter: &NodeSpec, source: &str) -> String {
    let (name, through) = (&limiter.name, limiter.limits.through.unwrap_or_default());
    let mut block = format!("[nodes.{name}]\ntype = \"{name}\"\nin.{through} = \"{source}\"");
    let needs = limiter.inputs.iter().filter(|input| input.need.must_be_wired);
    for input in needs.filter(|input| input.name != through) {
        block.push_str(&format!("\nin.{} = \"…\"", input.name));
    }
    for param in limiter.params.iter().filter(|param| !param.is_optional) {
        let unit = param.unit.as_ref().map(|unit| format!("   # [{unit}]")).unwrap_or_default();
        block.push_str(&format!("\n{} = …{unit}", param.name));
    }
    block
}
