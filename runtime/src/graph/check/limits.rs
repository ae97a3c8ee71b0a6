//! The proof that every command crosses the limits, and the section `[limits]` that the limiters take their numbers from.
//!
//! A role names what must hold of its commands. From each command the wire is followed back, through the nodes that pass
//! a motion on, and what they hold is gathered; a node in between that may break a limit makes it count for nothing.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::check::frames::Frames;
use crate::graph::load::FlatGraph;
use crate::graph::net::{CommandWire, Net};
use crate::graph::plan::{PortRef, Producer};
use crate::graph::syntax::LIMITS;
use crate::node::{NodeSpec, ParamSpec, Word};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Item, Value, closest};

/// A number of the section that a parameter asks for.
struct Asked<'a> {
    key: String,
    span: Range<usize>,
    /// The parameter that it is for.
    spec: Option<&'a ParamSpec>,
}

/// Compares the section with what the nodes take from it: a number that nobody takes limits nothing. Where a limiter is
/// missing, that is what is wrong, and its number is no mistake.
pub(crate) fn compare(net: &Net<'_>, is_limited: bool, found: &mut Vec<Diagnostic>) {
    let mut asked = Vec::new();
    for (i, node) in net.flat.nodes.iter().enumerate() {
        let specs = net.spec(i).map_or(&[][..], |spec| &spec.params);
        let entries = node.block.params.as_table().into_iter().flat_map(|table| &table.entries);
        for (key, value) in entries {
            collect(value, specs.iter().find(|spec| spec.name == key.name), &mut asked);
        }
    }
    let given = || net.flat.limits.iter().flat_map(|(_, table)| &table.entries);
    let names: BTreeSet<&str> = asked.iter().map(|asked| asked.key.as_str()).collect();
    for (key, _) in given().filter(|(key, _)| is_limited && !names.contains(key.name.as_str())) {
        let message = format!("`{}` limits nothing: no node takes it", key.name);
        let missing: Vec<&str> =
            names.iter().copied().filter(|name| !given().any(|(key, _)| key.name == *name)).collect();
        let help = match missing.is_empty() {
            true => "every limit that is asked for is given: take it out".to_owned(),
            false => closest(&key.name, missing.into_iter(), "limits that are asked for"),
        };
        found.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).help(help));
    }
    asked.iter().for_each(|asked| found.extend(other_unit(asked)));
    missing(net.flat, &asked, found);
}

fn missing(flat: &FlatGraph, asked: &[Asked<'_>], found: &mut Vec<Diagnostic>) {
    let mut told = BTreeSet::new();
    let is_given = |key: &str| flat.limits.as_ref().is_some_and(|(_, table)| table.get(key).is_some());
    let missing: Vec<&Asked<'_>> =
        asked.iter().filter(|asked| !is_given(&asked.key) && told.insert(asked.key.as_str())).collect();
    let Some(first) = missing.first() else { return };
    let lines = missing.iter().map(|asked| {
        let doc = asked.spec.map(ParamSpec::doc_with_unit).unwrap_or_default();
        format!("\n{} = …   # {}", asked.key, doc.trim_end_matches('.'))
    });
    let names: Vec<String> = missing.iter().map(|asked| format!("`{}`", asked.key)).collect();
    let (span, message) = match &flat.limits {
        Some((span, _)) => (span.clone(), format!("[limits] does not say {}", names.join(", "))),
        None => (flat.place.clone(), format!("the graph has no section [limits]: it has to say {}", names.join(", "))),
    };
    let diagnostic =
        Diagnostic::new(Code::MissingLimit, span, message).note(first.span.clone(), "it is asked for here");
    found.push(diagnostic.help(format!("add under [limits]:{}", lines.collect::<String>())));
}

/// A number whose name says another unit than the parameter that takes it.
fn other_unit(asked: &Asked<'_>) -> Option<Diagnostic> {
    const UNITS: [(&str, &str); 7] = [
        ("_m_per_s2", "m/s²"),
        ("_rad_per_s2", "rad/s²"),
        ("_m_per_s", "m/s"),
        ("_rad_per_s", "rad/s"),
        ("_n", "N"),
        ("_rad", "rad"),
        ("_m", "m"),
    ];
    let (_, says) = UNITS.iter().find(|(end, _)| asked.key.ends_with(end))?;
    let spec = asked.spec?;
    let takes = spec.unit.as_deref()?.split(';').next()?.trim();
    let is_known = UNITS.iter().any(|(_, unit)| *unit == takes);
    let message = format!("`{}` is in {says}, but `{}` takes {takes}", asked.key, spec.name);
    (is_known && takes != *says).then(|| Diagnostic::new(Code::UnitMismatch, asked.span.clone(), message))
}

fn collect<'a>(value: &Value, spec: Option<&'a ParamSpec>, asked: &mut Vec<Asked<'a>>) {
    match &value.item {
        Item::Array(items) => items.iter().for_each(|item| collect(item, spec, asked)),
        Item::Table(table) if table.is_fact() => {
            let from = table.get("from").expect("a fact has it");
            if let Some((LIMITS, key)) = from.as_str().and_then(|text| text.split_once('.')) {
                asked.push(Asked { key: key.to_owned(), span: from.span.clone(), spec });
            }
        }
        Item::Table(table) => table.entries.iter().for_each(|(_, item)| collect(item, spec, asked)),
        _ => {}
    }
}

/// A node on the way of a command that passes a motion on.
struct Stop<'a> {
    node: usize,
    spec: &'a NodeSpec,
    /// What its motion comes from, and as its file says it.
    source: PortRef,
    word: &'a Word,
}

/// Proves that each command has crossed what its role asks for, or says what is missing and where it belongs. Whether all
/// have.
pub(crate) fn prove(net: &Net<'_>, frames: &mut Frames, found: &mut Vec<Diagnostic>) -> bool {
    let mut is_limited = true;
    for command in net.commands.iter().filter(|command| !command.is_report) {
        let role = net.roles[command.role].expect("only known roles have commands");
        // A wire that goes nowhere has been complained about, and what stands behind it is not known.
        let Some(path) = path(net, command.source) else { continue };
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
            is_limited = false;
            found.push(unlimited(net, command, &path, &missing, &lost));
        }
        found.extend(other_frame(net, frames, &path));
    }
    is_limited
}

/// The nodes that a motion passes through, the last one first; none if a wire in between is missing.
fn path<'a>(net: &'a Net<'_>, from: PortRef) -> Option<Vec<Stop<'a>>> {
    let (mut path, mut at) = (Vec::<Stop<'_>>::new(), from);
    while let Producer::Node(node) = at.producer {
        let spec = net.spec(node)?;
        let Some(through) = spec.limits.through else { break };
        let input = spec.inputs.iter().position(|input| input.name == through)?;
        let wire = net.wires[node].iter().find(|wire| wire.input == input)?;
        let (source, word) = (wire.source, wire.origin.inner.as_ref().unwrap_or(&wire.origin.word));
        if path.iter().any(|stop| stop.node == node) {
            return None;
        }
        path.push(Stop { node, spec, source, word });
        at = source;
    }
    Some(path)
}

fn unlimited(
    net: &Net<'_>,
    command: &CommandWire,
    path: &[Stop<'_>],
    missing: &[&str],
    lost: &[(&str, &str)],
) -> Diagnostic {
    let role = net.roles[command.role].expect("only known roles have commands");
    let consumer = format!("{}.{}", net.name(Producer::Role(command.role)), role.commands[command.command].name);
    let names = missing.iter().map(|limit| format!("`{limit}`")).collect::<Vec<_>>().join(", ");
    let source = net.port_name(command.source);
    let message =
        format!("`{consumer}` takes only what has crossed every limit, but `{source}` has not crossed {names}");
    if let Some(part) = limiting_part(net, command, missing).filter(|_| lost.is_empty()) {
        return command.origin.mistake(Code::UnlimitedCommand, message).help(part);
    }
    let (mut helps, mut places) = (Vec::new(), Vec::new());
    let mut told = BTreeSet::new();
    for limit in missing {
        if let Some((_, by)) = lost.iter().find(|(lost, _)| lost == limit) {
            helps.push(format!("`{by}` comes after what holds `{limit}` and may break it: put it before that"));
            continue;
        }
        let holds = |spec: &NodeSpec| spec.limits.holds.contains(limit);
        let Some(spec) = net.catalogue.specs().find(|spec| holds(spec)) else { continue };
        if told.insert(spec.name.to_string()) {
            let (help, place) = between(net, command, &consumer, path, spec);
            helps.push(help);
            places.extend(place.map(|place| (place, format!("a `{}` belongs here", spec.name))));
        }
    }
    let mut diagnostic = command.origin.mistake(Code::UnlimitedCommand, message);
    diagnostic.notes.extend(places.into_iter().filter(|(place, _)| *place != command.origin.word.span));
    diagnostic.with_help((!helps.is_empty()).then(|| helps.join("\n")))
}

/// A part that the catalogue brings along and that holds all that is missing, where a single limiter would not do.
fn limiting_part(net: &Net<'_>, command: &CommandWire, missing: &[&str]) -> Option<String> {
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
    let taken = &net.roles[command.role]?.commands[command.command].name;
    let mut text =
        format!("let the motion go through a part that holds them all:\n[parts.{name}]\nfile = \"builtin:{file}\"");
    for (input, what) in part.get("inputs").and_then(toml::Value::as_table).into_iter().flatten() {
        text.push_str(&format!("\nin.{input} = \"…\"   # {}", what.as_str().unwrap_or_default()));
    }
    text.push_str(&format!("\n[commands]\n{role}.{taken} = \"{name}.{taken}\""));
    Some(text)
}

/// Where on the way a limiter belongs: behind everything that must come before it.
fn between(
    net: &Net<'_>,
    command: &CommandWire,
    consumer: &str,
    path: &[Stop<'_>],
    limiter: &NodeSpec,
) -> (String, Option<Range<usize>>) {
    let order = &net.roles[command.role].expect("only known roles have commands").limits;
    let rank = |spec: &NodeSpec| {
        let ranks = spec.limits.holds.iter().filter_map(|limit| order.iter().position(|known| known == limit));
        ranks.max()
    };
    let (name, through) = (&limiter.name, limiter.limits.through.unwrap_or_default());
    let kind = limiter.inputs.iter().find(|input| input.name == through).map(|input| input.kind);
    // Links from the command back to where the motion comes from: who takes it, what is taken, and as which words.
    let mut links = vec![(consumer.to_owned(), command.source, &command.origin.word)];
    for stop in path {
        let through = stop.spec.limits.through.unwrap_or_default();
        links.push((format!("{}.{through}", net.flat.nodes[stop.node].block.key.name), stop.source, stop.word));
    }
    // Behind a change of frame a twist is not the sensor's own any more.
    let changes_frame = |stop: &Stop<'_>| {
        let gives = net.outputs(Producer::Node(stop.node)).and_then(|ports| ports.first()).map(|port| port.kind);
        stop.spec.limits.holds.is_empty() && gives == Some(net.port(stop.source).kind)
    };
    let later = path.iter().rposition(|stop| rank(stop.spec) > rank(limiter)).map_or(0, |at| at + 1);
    let fits = |at: &usize| Some(net.port(links[*at].1).kind) == kind && !path[*at..].iter().any(changes_frame);
    let at = (later..links.len()).find(fits).or_else(|| (0..links.len()).rev().find(fits));
    let Some((taker, _, word)) = at.map(|at| &links[at]) else {
        return (format!("put a `{name}` on the way of the motion"), None);
    };
    let article = if name.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    let needs = limiter.inputs.iter().filter(|input| input.need.must_be_wired);
    let mut block = format!(
        "put {article} `{name}` between `{0}` and `{taker}`:\n[nodes.{name}]\ntype = \"{name}\"\nin.{through} = \"{0}\"",
        word.text
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

/// A limiter of a twist means the sensor's own motion: in another frame the same numbers limit something else.
fn other_frame(net: &Net<'_>, frames: &mut Frames, path: &[Stop<'_>]) -> Option<Diagnostic> {
    let mut limiters = path.iter().rev().filter(|stop| !stop.spec.limits.holds.is_empty());
    let mut frame = |stop: &Stop<'_>| {
        let source = PortRef { producer: Producer::Node(stop.node), port: 0 };
        let is_twist = net.port(source).kind == Kind::Twist;
        is_twist.then(|| frames.of(net, source).into_iter().next().flatten()).flatten()
    };
    let first = limiters.find_map(|stop| Some((stop, frame(stop)?)))?;
    let (other, its) = limiters.find_map(|stop| Some((stop, frame(stop).filter(|frame| *frame != first.1)?)))?;
    let (node, before) = (&net.flat.nodes[other.node], &net.flat.nodes[first.0.node].name);
    let message = format!("`{}` limits a twist in `{its}`, but `{before}` before it one in `{}`", node.name, first.1);
    let diagnostic = Diagnostic::new(Code::FrameMismatch, node.block.key.span.clone(), message);
    Some(diagnostic.help("limits are of the sensor's own motion: put it before the change of frame"))
}
