//! Checks that every command passes the limits that its role requires.
//!
//! From each command the check follows the motion backwards and collects the limits that the nodes on the path hold. A
//! limit does not count if a later node on the path may break it.

use std::collections::BTreeSet;
use std::ops::Range;

use super::frames::{Frames, with_article};
use super::guards::Guards;
use super::sums;
use super::{carried, foreign};
use crate::device::RoleType;
use crate::graph::net::limits::PathNode;
use crate::graph::net::{CommandWire, Net, Wire, WireOrigin};
use crate::graph::plan::{PortRef, Producer};
use crate::graph::syntax::LIMITS;
use crate::node::{NodeSpec, ParamSpec, Spanned};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, Edit, quoted};

/// A command and the nodes that its motion passes, the last one first.
struct CommandPath<'a> {
    net: &'a Net<'a>,
    wire: &'a CommandWire,
    role: &'a RoleType,
    nodes: Vec<PathNode<'a>>,
}

/// Reports each command whose path lacks a required limit, with the node to insert and its place.
pub(crate) fn check(net: &Net<'_>, frames: &mut Frames<'_>, diagnostics: &mut Diagnostics) {
    diagnostics.extend((0..net.roles.len()).filter_map(|role| foreign::on_two_arms(net, role)));
    let has_two_drivers = net.has_two_drivers();
    for wire in net.commands.iter().filter(|wire| !wire.is_report) {
        // A missing wire has its own diagnostic, and hides the nodes behind it.
        diagnostics.extend(carried::on_bare_arm(net, wire.role));
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
        let required = path.role.limits.iter().map(|limit| &**limit).filter(|limit| net.needs_limit(wire.role, limit));
        let missing: Vec<&str> = required.filter(|limit| !held.contains(limit)).collect();
        if !missing.is_empty() {
            diagnostics.push(path.unlimited(&missing, &lost));
        } else if !has_two_drivers {
            diagnostics.extend(Guards { net, wire, path: &path.nodes }.check(frames));
        }
        diagnostics.extend(path.mixed_frames(frames));
        let first = path.nodes.iter().rposition(|stop| !stop.spec.limits.holds.is_empty()).unwrap_or(0);
        let limited = path.nodes[..first].iter().filter(|stop| stop.spec.limits.holds.is_empty());
        diagnostics.extend(limited.filter_map(|stop| foreign::unproven_pose(net, frames, stop.node)));
        // A wire in the wrong frame has its own diagnostic.
        let limiters = path.nodes.iter().filter(|stop| !stop.spec.limits.holds.is_empty());
        let limiters: Vec<_> = limiters.filter(|stop| !frames.has_clash(stop.node)).collect();
        for stop in &limiters {
            diagnostics.extend(foreign::check(net, frames, wire.role, stop.node, stop.source));
        }
        let mut along = limiters.iter().rev();
        let find = |stop: &&PathNode<'_>| foreign::on_another_arm(net, frames, wire.role, stop.node, stop.source);
        diagnostics.extend(along.find_map(find));
    }
}

/// Returns the nodes with limits that the motion of a command passes through.
pub(super) fn limiters(net: &Net<'_>, wire: &CommandWire) -> Vec<usize> {
    let path = CommandPath::find(net, wire);
    let nodes = path.iter().flat_map(|path| &path.nodes);
    nodes.filter(|stop| !stop.spec.limits.holds.is_empty()).map(|stop| stop.node).collect()
}

impl<'a> CommandPath<'a> {
    /// Follows a motion backwards, or returns `None` if a wire is missing.
    fn find(net: &'a Net<'a>, wire: &'a CommandWire) -> Option<Self> {
        Some(Self { net, wire, role: net.roles[wire.role]?, nodes: net.motion_path(wire)? })
    }

    /// Returns the diagnostic of the missing limits, of which the nodes in `lost` broke some.
    fn unlimited(&self, missing: &[&str], lost: &[(&str, &str)]) -> Diagnostic {
        let Self { net, wire, .. } = self;
        let consumer = net.command_name(wire);
        let names = quoted(missing);
        let source = net.port_name(wire.source);
        let plural = if missing.len() == 1 { "" } else { "s" };
        let message = format!("`{source}` drives `{consumer}` without the required limit{plural} {names}");
        if let Some(help) = sums::help(net, wire, &self.nodes, missing) {
            return wire.origin.diagnostic(Code::UnlimitedCommand, message).help(help);
        }
        if let Some((help, edits)) = self.suggest_part(missing).filter(|_| lost.is_empty()) {
            let diagnostic = wire.origin.diagnostic(Code::UnlimitedCommand, message).help(help);
            return edits.into_iter().fold(diagnostic, Diagnostic::edit);
        }
        let (mut helps, mut places, mut edits) = (Vec::new(), Vec::new(), Vec::new());
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
                let (help, place, edit) = self.suggest_limiter(spec);
                helps.push(help);
                edits.push(edit);
                places.extend(place.map(|place| (place, format!("insert a `{}` here", spec.name))));
            }
        }
        let mut diagnostic = wire.origin.diagnostic(Code::UnlimitedCommand, message);
        diagnostic.notes.extend(places.into_iter().filter(|(place, _)| *place != wire.origin.word.span));
        // Limiters at one place change the same wire, so only one of them can be inserted at a time.
        let fix = edits.into_iter().next().flatten().filter(|_| lost.is_empty()).unwrap_or_default();
        let diagnostic = fix.into_iter().fold(diagnostic, Diagnostic::edit);
        diagnostic.with_help((!helps.is_empty()).then(|| helps.join("\n")))
    }

    /// Suggests a built-in part that holds all missing limits, if they need three or more nodes.
    fn suggest_part(&self, missing: &[&str]) -> Option<(String, Vec<Edit>)> {
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
        let parts =
            parts.filter_map(|(name, bytes)| Some((*name, str::from_utf8(bytes).ok()?.parse::<toml::Table>().ok()?)));
        let held = |part: &toml::Table| -> BTreeSet<&str> {
            let nodes = part.get("nodes").and_then(toml::Value::as_table).into_iter().flatten();
            let kinds = nodes.filter_map(|(_, node)| node.get("type")?.as_str());
            kinds
                .filter_map(|kind| net.catalogue.find_node(kind))
                .flat_map(|(_, spec)| spec.limits.holds.iter().copied())
                .collect()
        };
        let fits = parts.filter(|(_, part)| missing.iter().all(|limit| held(part).contains(limit)));
        // A part with limits of which the arm knows nothing is for another arm.
        let strange = |limit: &&str| !self.role.limits.iter().any(|known| known == limit);
        let (file, part) = fits.min_by_key(|(_, part)| held(part).into_iter().filter(strange).count())?;
        let name = file.rsplit('/').next()?.strip_suffix(".toml")?;
        let role = net.name(Producer::Role(wire.role));
        let taken = &net.command_port(wire).name;
        let mut block = format!("[parts.{name}]\nfile = \"builtin:{file}\"");
        let readers = net.catalogue.limit_readers();
        let has_default = |kind: &str, limit: &str| {
            let params = net.catalogue.find_node(kind).map_or(&[][..], |(_, spec)| &spec.params);
            let reads = |param: &ParamSpec| readers.limit_of(kind, param.name) == Some(limit);
            params.iter().any(|param| param.default.is_some() && reads(param))
        };
        let needed =
            |kind: &&str| readers.limits_of(kind).filter(|limit| !has_default(kind, limit)).collect::<Vec<_>>();
        let needed: BTreeSet<&str> = limiters.iter().flat_map(needed).collect();
        if !needed.iter().all(|limit| self.is_given(limit)) {
            let help = format!(
                "route the motion through the part `builtin:{file}`, and write its limits under [limits]: {}",
                quoted(needed)
            );
            return Some((help, Vec::new()));
        }
        let inputs = part.get("inputs").and_then(toml::Value::as_table);
        for input in inputs.into_iter().flat_map(toml::Table::keys) {
            let Some(port) = self.port_for(input) else {
                return Some((format!("route the motion through the part `builtin:{file}`"), Vec::new()));
            };
            block.push_str(&format!("\nin.{input} = \"{port}\""));
        }
        let source = format!("{name}.{taken}");
        let help = format!(
            "route the motion through a part that enforces all of them, and let `{role}.{taken}` read `{source}`:\n{block}"
        );
        let place = wire.origin.word.span.clone();
        let edits = [Edit::Replace(place.clone(), format!("\"{source}\"")), Edit::Append(place, format!("\n{block}"))];
        Some((help, edits.into()))
    }

    /// Returns whether the graph gives a limit.
    fn is_given(&self, limit: &str) -> bool {
        self.net.limit(&[self.wire.role], limit).is_some()
    }

    /// Returns the port of the graph that fits an input with the name `input`: the motion itself, or a port with that
    /// name. A calibrated image comes from the last node that has one.
    fn port_for(&self, input: &str) -> Option<String> {
        let Self { net, .. } = self;
        let start = self.nodes.last().map(|stop| stop.source);
        let is_motion = |source: &PortRef| net.port(*source).name == input && net.port(*source).kind == Kind::Twist;
        if let Some(source) = start.filter(is_motion) {
            return net.name_in(0, source).map(str::to_owned);
        }
        let end = format!(".{input}");
        let ports = net.ports_in(0).filter(|(name, port)| name.ends_with(&end) && net.port(*port).kind != Kind::Twist);
        ports
            .max_by_key(|(_, port)| net.order.iter().position(|node| Some(*node) == port.producer.node()))
            .map(|(n, _)| n)
    }

    /// Suggests a limiter and its place on the path: after every limiter that must come before it.
    fn suggest_limiter(&self, limiter: &NodeSpec) -> (String, Option<Range<usize>>, Option<Vec<Edit>>) {
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
            return (format!("insert a `{name}` on the path of the motion"), None, None);
        };
        let output = limiter.outputs.first().map_or("", |output| &output.name);
        let (limiter_name, from) = (with_article(name), &word.value);
        let between =
            format!("insert {limiter_name} between `{from}` and `{taker}`, which then takes `{name}.{output}`:");
        let place = Some(word.span.clone());
        match self.block(limiter, word) {
            Some(block) => {
                let replace = Edit::Replace(word.span.clone(), format!("\"{name}.{output}\""));
                let edits = vec![replace, Edit::Append(word.span.clone(), format!("\n{block}"))];
                (format!("{between}\n{block}"), place, Some(edits))
            }
            None => (between.trim_end_matches(':').to_owned(), place, None),
        }
    }

    /// Returns the block of a limiter of the motion that `word` names, if all its inputs and parameters are known: the
    /// built-in parts tell which limits its parameters read.
    fn block(&self, limiter: &NodeSpec, word: &Spanned<String>) -> Option<String> {
        let Self { net, wire, .. } = self;
        let (name, through) = (&limiter.name, limiter.limits.through.unwrap_or_default());
        let by_wire = |(node, wires): (usize, &Vec<Wire>)| {
            let mut origins = wires.iter().map(|wire| &wire.origin);
            let holds = |origin: &WireOrigin| origin.inner.as_ref().unwrap_or(&origin.word).span == word.span;
            origins.any(holds).then(|| net.flat.nodes[node].scope)
        };
        let scope = net.wires.iter().enumerate().find_map(by_wire).unwrap_or(wire.origin.scope);
        let is_taken = net.flat.scopes[scope].names.contains_key(&**name);
        let mut block = format!("[nodes.{name}]\ntype = \"{name}\"\nin.{through} = \"{}\"", word.value);
        let needs = limiter.inputs.iter().filter(|input| input.need.must_be_wired && input.name != through);
        for input in needs {
            block.push_str(&format!("\nin.{} = \"{}\"", input.name, net.find_candidate(scope, None, input)?));
        }
        for param in limiter.params.iter().filter(|param| !param.is_optional) {
            let limit =
                net.catalogue.limit_readers().limit_of(name, param.name).filter(|limit| self.is_given(limit))?;
            block.push_str(&format!("\n{} = {{ from = \"{LIMITS}.{limit}\" }}", param.name));
        }
        (!is_taken).then_some(block)
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
