//! A whole graph around one node or one device, put together from the examples of the catalogue.
//!
//! Each node's example is one block whose wires name blocks of other nodes' examples and roles of devices' examples.
//! What is needed is followed from block to block; the text stays as it was written, comments and all.

use std::collections::BTreeMap;
use std::path::Path;

use crate::catalogue::Catalogue;
use crate::graph::{Request, compile};
use crate::node::{NodeSpec, PortSpec};
use crate::signal::Kind;
use crate::source::{Item, SourceMap, Table, Value, parse_table};

/// What the example is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked<'a> {
    /// A node type.
    Node(&'a str),
    /// A device type.
    Device(&'a str),
}

/// The example of one node or one device, taken apart.
struct Piece {
    /// Its type.
    kind: String,
    is_device: bool,
    /// What others call it: blocks of nodes, or roles.
    names: Vec<String>,
    /// Of those, the roles that take no commands.
    sensors: Vec<String>,
    /// What it names.
    needs: Vec<String>,
    /// The ports that its wires name.
    wires: Vec<String>,
    /// Its text by section: `[roles]`, `[commands]`, `[bind]`; under no name, its blocks.
    sections: BTreeMap<&'static str, String>,
}

/// Sections that several devices share.
const SHARED: [&str; 3] = ["roles", "commands", "bind"];

/// A whole graph around a node or a device, by its name.
///
/// # Errors
/// Which example is missing, or is no TOML.
pub fn example(catalogue: &Catalogue, name: &str) -> Result<String, String> {
    let is_node = catalogue.nodes().iter().any(|node| node.spec().name == name);
    compose(catalogue, if is_node { Asked::Node(name) } else { Asked::Device(name) })
}

/// The graph, or why there is none.
///
/// # Errors
/// Which example is missing, or is no TOML.
pub(super) fn compose(catalogue: &Catalogue, asked: Asked<'_>) -> Result<String, String> {
    let pieces = pieces(catalogue)?;
    let is_asked = |piece: &Piece| match asked {
        Asked::Node(name) => !piece.is_device && piece.kind == name,
        Asked::Device(name) => piece.is_device && piece.kind == name,
    };
    let (Asked::Node(name) | Asked::Device(name)) = asked;
    let start = pieces.iter().position(is_asked).ok_or_else(|| format!("`{name}` has no example"))?;
    let mut chosen = vec![start];
    if pieces[start].is_device {
        // A sensor by itself does nothing: with it comes what reads it.
        let reads =
            |piece: &Piece| !piece.is_device && piece.needs.iter().any(|need| pieces[start].names.contains(need));
        chosen.extend(pieces.iter().position(reads));
    }
    let mut at = 0;
    while let Some(piece) = chosen.get(at).map(|index| &pieces[*index]) {
        at += 1;
        for need in &piece.needs {
            if chosen.iter().any(|index| pieces[*index].names.contains(need)) {
                continue;
            }
            // A device is no choice if it fills a role that another one fills already.
            let is_taken = |name: &String| chosen.iter().any(|index| pieces[*index].names.contains(name));
            let is_free = |piece: &Piece| !piece.names.iter().any(is_taken);
            let provider = pieces.iter().position(|piece| piece.names.contains(need) && is_free(piece));
            let provider =
                provider.ok_or_else(|| format!("no example brings the `{need}` that `{}` needs", piece.kind))?;
            chosen.push(provider);
        }
    }
    chosen.sort_unstable();
    let chosen: Vec<&Piece> = chosen.iter().map(|index| &pieces[*index]).collect();
    let asked = &pieces[start];
    if asked.is_device || !is_unread(&chosen, asked) {
        return Ok(text(&chosen, asked, None));
    }
    let used = put_between(catalogue, &chosen, asked).or_else(|| watched(catalogue, &chosen, asked));
    Ok(used.unwrap_or_else(|| text(&chosen, asked, None)))
}

/// Whether a command is driven and nobody reads the node that is asked for.
fn is_unread(chosen: &[&Piece], asked: &Piece) -> bool {
    let is_read = chosen.iter().any(|piece| piece.needs.iter().any(|need| asked.names.contains(need)));
    !is_read && chosen.iter().any(|piece| piece.sections.contains_key("commands"))
}

/// Whether a graph loads and there is nothing to be said of it.
fn is_clean(catalogue: &Catalogue, text: &str) -> bool {
    let plan = compile(catalogue, &Request::text(text));
    plan.is_ok_and(|plan| plan.warnings().is_none())
}

/// The asked node in one of the wires it reads: those that read the wire read its output instead, if that makes a graph
/// of which nothing is to be said.
fn put_between(catalogue: &Catalogue, chosen: &[&Piece], asked: &Piece) -> Option<String> {
    let spec = catalogue.nodes().iter().map(|node| node.spec()).find(|spec| spec.name == asked.kind)?;
    let outputs =
        || asked.names.iter().flat_map(|name| spec.outputs.iter().map(move |port| format!("{name}.{}", port.name)));
    let wires = asked.wires.iter().flat_map(|wire| outputs().map(move |output| (wire.clone(), output)));
    wires.map(|(from, to)| text(chosen, asked, Some((&from, &to)))).find(|text| is_clean(catalogue, text))
}

/// The asked node with one that logs behind it: what only measures is there to be looked at.
fn watched(catalogue: &Catalogue, chosen: &[&Piece], asked: &Piece) -> Option<String> {
    let specs: Vec<NodeSpec> = catalogue.nodes().iter().map(|node| node.spec()).collect();
    let takes = |port: &PortSpec| port.need.is_many && port.kind == Kind::Scalar;
    let logs = specs.iter().find(|spec| spec.logs && spec.inputs.iter().any(takes))?;
    let spec = specs.iter().find(|spec| spec.name == asked.kind)?;
    let name = asked.names.first()?;
    let scalars = spec.outputs.iter().filter(|port| port.kind == Kind::Scalar);
    let wires: Vec<String> = scalars.map(|port| format!("in.{0} = \"{name}.{0}\"\n", port.name)).collect();
    let whole = text(chosen, asked, None);
    let whole = format!("{whole}\n[nodes.seen]\ntype = \"{}\"\n{}", logs.name, wires.concat());
    Some(whole).filter(|text| is_clean(catalogue, text))
}

/// The block of a node or a device by itself, as it was written.
pub(super) fn block(example: &str) -> Option<&str> {
    Some(example.trim()).filter(|text| !text.is_empty())
}

fn pieces(catalogue: &Catalogue) -> Result<Vec<Piece>, String> {
    let mut pieces = Vec::new();
    let nodes = catalogue.nodes().iter().map(|node| node.spec()).map(|spec| (spec.name, spec.example, false));
    let devices = catalogue.devices().iter().map(|device| (device.name(), device.example(), true));
    for (kind, example, is_device) in nodes.chain(devices) {
        if !example.trim().is_empty() {
            pieces.push(piece(catalogue, &kind, &example, is_device)?);
        }
    }
    Ok(pieces)
}

fn piece(catalogue: &Catalogue, kind: &str, example: &str, is_device: bool) -> Result<Piece, String> {
    let mut sources = SourceMap::default();
    let parsed = parse_table(sources.add_file(Path::new("example"), example));
    let Ok(Value { item: Item::Table(root), .. }) = parsed else {
        return Err(format!("the example of `{kind}` is no TOML"));
    };
    let table = |name: &str| root.get(name).and_then(Value::as_table).cloned().unwrap_or_default();
    let keys = |table: &Table| table.entries.iter().map(|(key, _)| key.name.clone()).collect();
    let (nodes, roles) = (table("nodes"), table("roles"));
    let is_sensor = |kind: &str| catalogue.roles().iter().any(|role| role.name == kind && role.commands.is_empty());
    let sensors = roles.entries.iter().filter(|(_, kind)| kind.as_str().is_some_and(is_sensor));
    let sensors = sensors.map(|(key, _)| key.name.clone()).collect();
    let (mut needs, mut wires) = (Vec::new(), Vec::new());
    for (_, node) in &nodes.entries {
        let inputs = node.as_table().and_then(|node| node.get("in")).and_then(Value::as_table);
        wires.extend(inputs.into_iter().flat_map(words));
        facts(node, &mut needs);
    }
    table("commands")
        .entries
        .iter()
        .filter_map(|(_, wires)| wires.as_table())
        .for_each(|drive| wires.extend(words(drive)));
    needs.extend(wires.iter().filter_map(|wire| Some(wire.split_once('.')?.0.to_owned())));
    let names = keys(if is_device { &roles } else { &nodes });
    Ok(Piece { kind: kind.to_owned(), is_device, names, sensors, needs, wires, sections: sections(example) })
}

/// The texts in a table.
fn words(table: &Table) -> impl Iterator<Item = String> {
    table.entries.iter().filter_map(|(_, word)| word.as_str().map(str::to_owned))
}

/// The roles whose facts are asked for.
fn facts(value: &Value, needs: &mut Vec<String>) {
    match &value.item {
        Item::Table(table) if table.is_fact() => {
            needs.extend(words(table).filter_map(|fact| Some(fact.split_once('.')?.0.to_owned())));
        }
        Item::Table(table) => table.entries.iter().for_each(|(_, inner)| facts(inner, needs)),
        Item::Array(items) => items.iter().for_each(|inner| facts(inner, needs)),
        _ => {}
    }
}

/// A text by sections; a comment above a header belongs to it.
fn sections(example: &str) -> BTreeMap<&'static str, String> {
    let mut sections: BTreeMap<&'static str, String> = BTreeMap::new();
    let (mut section, mut comments) = ("", String::new());
    for line in example.trim().lines() {
        if line.starts_with('#') {
            comments.push_str(line);
            comments.push('\n');
            continue;
        }
        let header = line.strip_prefix('[').and_then(|rest| rest.split(']').next());
        let shared = header.and_then(|header| SHARED.into_iter().find(|shared| *shared == header));
        let is_block = header.is_some_and(|header| header.starts_with("nodes.") || header.starts_with("devices."));
        section = if is_block { "" } else { shared.unwrap_or(section) };
        let text = sections.entry(section).or_default();
        text.push_str(&std::mem::take(&mut comments));
        if shared.is_none() {
            text.push_str(line);
            text.push('\n');
        }
    }
    sections.entry(section).or_default().push_str(&comments);
    sections
}

/// The graph; with another port in the place of one, everywhere but in the piece that is asked for.
fn text(chosen: &[&Piece], asked: &Piece, swap: Option<(&str, &str)>) -> String {
    let swapped = |text: String| match swap {
        Some((from, to)) => text.replace(&format!("\"{from}\""), &format!("\"{to}\"")),
        None => text,
    };
    let devices = || chosen.iter().filter(|piece| piece.is_device);
    let clock = devices().flat_map(|device| &device.sensors).chain(devices().flat_map(|device| &device.names)).next();
    let clock = clock.map_or_else(|| "rate_hz = 250".to_owned(), |role| format!("clock = \"{role}\""));
    let shared = |name: &str| {
        let lines: String =
            devices().filter_map(|device| device.sections.get(name)).map(|text| trimmed(text)).collect();
        (!lines.is_empty()).then(|| swapped(format!("[{name}]\n{lines}")))
    };
    let block = |piece: &&Piece| {
        let text = trimmed(piece.sections.get("").map_or("", String::as_str));
        if std::ptr::eq(*piece, asked) { format!("# ==== {} ====\n{text}", piece.kind) } else { swapped(text) }
    };
    let nodes = chosen.iter().filter(|piece| !piece.is_device).map(block);
    let head = [Some(format!("[graph]\n{clock}\n")), shared("roles"), shared("commands")];
    let tail = shared("bind").into_iter().chain(devices().map(block));
    let all: Vec<String> = head.into_iter().flatten().chain(nodes).chain(tail).collect();
    all.join("\n")
}

/// Without empty lines around it.
fn trimmed(text: &str) -> String {
    match text.trim_matches('\n') {
        "" => String::new(),
        text => format!("{text}\n"),
    }
}

#[cfg(test)]
mod tests;
