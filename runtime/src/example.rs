//! Example graphs for one node or device, composed from the examples of the catalogue.
//!
//! The example of a node is one block. Its wires name blocks in the examples of other nodes and roles in the examples
//! of devices, so the blocks that a node needs are found by following its wires. The text of each block stays as
//! written, including its comments.

use std::collections::BTreeMap;
use std::path::Path;

use crate::catalogue::Catalogue;
use crate::graph::{Request, compile};
use crate::node::{PortSpec, frame_args};
use crate::signal::Kind;
use crate::source::{Item, SourceMap, Table, Value, parse_table};

/// The parsed example of one node or device.
struct ExamplePart {
    /// Its type.
    kind: String,
    is_device: bool,
    /// Names by which wires refer to it: blocks of nodes, or roles.
    names: Vec<String>,
    /// Those of its roles that take no commands.
    sensors: Vec<String>,
    /// Names that it refers to.
    needs: Vec<String>,
    /// Ports that its wires come from.
    wires: Vec<String>,
    /// Its text by section: `[roles]`, `[commands]` and `[bind]`, and its own blocks under an empty name.
    sections: BTreeMap<&'static str, String>,
}

/// Sections to which several devices add lines.
const SHARED: [&str; 3] = ["roles", "commands", "bind"];

/// Composes an example graph for a node or a device.
///
/// # Errors
/// If an example is missing or is not TOML.
pub fn example_graph(catalogue: &Catalogue, name: &str) -> Result<String, String> {
    let parts = parts(catalogue)?;
    let start = parts.iter().position(|part| part.kind == name).ok_or_else(|| format!("`{name}` has no example"))?;
    let chosen: Vec<&ExamplePart> = chosen(&parts, start)?.into_iter().map(|index| &parts[index]).collect();
    let target = &parts[start];
    let node = if target.is_device { reader(&parts, start).map(|index| &parts[index]) } else { Some(target) };
    let used = node.filter(|node| is_unused(&chosen, node)).and_then(|node| {
        insert_into_wire(catalogue, &chosen, node)
            .or_else(|| append_log(catalogue, &chosen, node))
            .or_else(|| show_output(catalogue, &chosen, node))
    });
    Ok(used.unwrap_or_else(|| text(&chosen, target, None)))
}

/// Follows the wires from one part, and returns the indices of all the parts of its graph in order.
fn chosen(parts: &[ExamplePart], start: usize) -> Result<Vec<usize>, String> {
    let mut chosen = vec![start];
    if parts[start].is_device {
        // A sensor alone does nothing.
        chosen.extend(reader(parts, start));
    }
    let mut at = 0;
    while let Some(part) = chosen.get(at).map(|index| &parts[*index]) {
        at += 1;
        for need in &part.needs {
            // Only one device may fill a role.
            let is_taken = |name: &String| chosen.iter().any(|index| parts[*index].names.contains(name));
            if is_taken(need) {
                continue;
            }
            let is_free = |part: &ExamplePart| part.names.contains(need) && !part.names.iter().any(is_taken);
            let provider = parts.iter().position(is_free);
            chosen.push(provider.ok_or_else(|| format!("no example has the `{need}` that `{}` needs", part.kind))?);
        }
    }
    chosen.sort_unstable();
    Ok(chosen)
}

/// Returns the first node that reads a device.
fn reader(parts: &[ExamplePart], device: usize) -> Option<usize> {
    let reads = |part: &ExamplePart| part.needs.iter().any(|need| parts[device].names.contains(need));
    parts.iter().position(|part| !part.is_device && reads(part))
}

/// Whether the graph drives a command and nothing reads the target.
fn is_unused(chosen: &[&ExamplePart], target: &ExamplePart) -> bool {
    let is_read = chosen.iter().any(|part| part.needs.iter().any(|need| target.names.contains(need)));
    !is_read && chosen.iter().any(|part| part.sections.contains_key("commands"))
}

/// Whether a graph loads without a warning.
fn is_clean(catalogue: &Catalogue, text: &str) -> bool {
    let plan = compile(catalogue, &Request::text(text));
    plan.is_ok_and(|plan| plan.warnings().is_none())
}

/// Inserts the target into one of the wires that it reads, so that the readers of the wire read its output instead.
/// Returns the first such graph that loads without a warning.
fn insert_into_wire(catalogue: &Catalogue, chosen: &[&ExamplePart], target: &ExamplePart) -> Option<String> {
    let (_, spec) = catalogue.find_node(&target.kind)?;
    let outputs =
        || target.names.iter().flat_map(|name| spec.outputs.iter().map(move |port| format!("{name}.{}", port.name)));
    let wires = target.wires.iter().flat_map(|wire| outputs().map(move |output| (wire.clone(), output)));
    wires.map(|(from, to)| text(chosen, target, Some((&from, &to)))).find(|text| is_clean(catalogue, text))
}

/// Adds a node that logs the scalar outputs of the target. Returns the graph if it loads without a warning.
fn append_log(catalogue: &Catalogue, chosen: &[&ExamplePart], target: &ExamplePart) -> Option<String> {
    let takes = |port: &PortSpec| port.need.is_many && port.kind == Kind::Scalar;
    let logs = catalogue.specs().find(|spec| spec.logs && spec.inputs.iter().any(takes))?;
    let (_, spec) = catalogue.find_node(&target.kind)?;
    let name = target.names.first()?;
    let scalars = spec.outputs.iter().filter(|port| port.kind == Kind::Scalar);
    let wires: Vec<String> = scalars.map(|port| format!("in.{0} = \"{name}.{0}\"\n", port.name)).collect();
    let graph = text(chosen, target, None);
    let graph = format!("{graph}\n[nodes.seen]\ntype = \"{}\"\n{}", logs.name, wires.concat());
    Some(graph).filter(|text| is_clean(catalogue, text))
}

/// Shows the first output of the target. Returns the graph if it loads without a warning.
fn show_output(catalogue: &Catalogue, chosen: &[&ExamplePart], target: &ExamplePart) -> Option<String> {
    let (_, spec) = catalogue.find_node(&target.kind)?;
    let (name, port) = (target.names.first()?, &spec.outputs.first()?.name);
    let graph = text(chosen, target, None);
    let (head, rest) = graph.split_once("[graph]\n")?;
    let graph = format!("{head}[graph]\nshow = [\"{name}.{port}\"]\n{rest}");
    Some(graph).filter(|text| is_clean(catalogue, text))
}

/// Parses the examples of the catalogue: those of the nodes, then those of the devices.
fn parts(catalogue: &Catalogue) -> Result<Vec<ExamplePart>, String> {
    let nodes = catalogue.specs().map(|spec| (spec.name.clone(), spec.example.clone(), false));
    let devices = catalogue.devices().iter().map(|device| (device.name(), device.example(), true));
    let given = nodes.chain(devices).filter(|(_, example, _)| !example.trim().is_empty());
    given.map(|(kind, example, is_device)| part(catalogue, &kind, &example, is_device)).collect()
}

fn part(catalogue: &Catalogue, kind: &str, example: &str, is_device: bool) -> Result<ExamplePart, String> {
    let mut sources = SourceMap::default();
    let parsed = parse_table(sources.add_file(Path::new("example"), example));
    let Ok(Value { item: Item::Table(root), .. }) = parsed else {
        return Err(format!("the example of `{kind}` is not TOML"));
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
        wires.extend(inputs.into_iter().flat_map(strings));
        collect_facts(node, &mut needs);
        needs.extend(named_roles(catalogue, kind, node));
    }
    let commands = table("commands");
    wires.extend(commands.entries.iter().filter_map(|(_, wires)| wires.as_table()).flat_map(strings));
    needs.extend(wires.iter().filter_map(|wire| Some(wire.split_once('.')?.0.to_owned())));
    let names = keys(if is_device { &roles } else { &nodes });
    Ok(ExamplePart { kind: kind.to_owned(), is_device, names, sensors, needs, wires, sections: sections(example) })
}

/// Returns the roles whose frames the block of a node names.
fn named_roles(catalogue: &Catalogue, kind: &str, block: &Value) -> Vec<String> {
    let Some((_, spec)) = catalogue.find_node(kind) else { return Vec::new() };
    let frames = spec.outputs.iter().flat_map(frame_args).filter_map(|arg| arg.strip_prefix('$'));
    let named = frames.filter_map(|param| block.as_table()?.get(param)?.as_str());
    named.filter_map(|frame| Some(frame.split('.').next()?.to_owned())).collect()
}

/// Returns the strings in a table.
fn strings(table: &Table) -> impl Iterator<Item = String> {
    table.entries.iter().filter_map(|(_, word)| word.as_str().map(str::to_owned))
}

/// Collects the roles whose facts a value refers to.
fn collect_facts(value: &Value, needs: &mut Vec<String>) {
    needs.extend(value.facts().into_iter().filter_map(|fact| Some(fact.word.split_once('.')?.0.to_owned())));
}

/// Splits a text into sections. A comment above a header belongs to the header.
fn sections(example: &str) -> BTreeMap<&'static str, String> {
    let mut sections: BTreeMap<&'static str, String> = BTreeMap::new();
    let (mut section, mut comments) = ("", String::new());
    for line in example.trim().lines() {
        if line.starts_with('#') {
            comments.extend([line, "\n"]);
            continue;
        }
        let header = line.strip_prefix('[').and_then(|rest| rest.split(']').next());
        let shared = header.and_then(|header| SHARED.into_iter().find(|shared| *shared == header));
        let is_block = header.is_some_and(|header| header.starts_with("nodes.") || header.starts_with("devices."));
        section = if is_block { "" } else { shared.unwrap_or(section) };
        let text = sections.entry(section).or_default();
        text.push_str(&std::mem::take(&mut comments));
        if shared.is_none() {
            text.extend([line, "\n"]);
        }
    }
    sections.entry(section).or_default().push_str(&comments);
    sections
}

/// Writes the graph. `swap` replaces one port by another everywhere but in the target.
fn text(chosen: &[&ExamplePart], target: &ExamplePart, swap: Option<(&str, &str)>) -> String {
    let swapped = |text: String| match swap {
        Some((from, to)) => text.replace(&format!("\"{from}\""), &format!("\"{to}\"")),
        None => text,
    };
    let devices = || chosen.iter().filter(|part| part.is_device);
    let clock = devices().flat_map(|device| &device.sensors).chain(devices().flat_map(|device| &device.names)).next();
    let clock = clock.map_or_else(|| "rate_hz = 250".to_owned(), |role| format!("clock = \"{role}\""));
    let shared = |name: &str| {
        let lines: String =
            devices().filter_map(|device| device.sections.get(name)).map(|text| trimmed(text)).collect();
        (!lines.is_empty()).then(|| swapped(format!("[{name}]\n{lines}")))
    };
    let block = |part: &&ExamplePart| {
        let text = trimmed(part.sections.get("").map_or("", String::as_str));
        if std::ptr::eq(*part, target) { format!("# ==== {} ====\n{text}", part.kind) } else { swapped(text) }
    };
    let nodes = chosen.iter().filter(|part| !part.is_device).map(block);
    let head = [Some(format!("[graph]\n{clock}\n")), shared("roles"), shared("commands")];
    let tail = shared("bind").into_iter().chain(devices().map(block));
    let all: Vec<String> = head.into_iter().flatten().chain(nodes).chain(tail).collect();
    all.join("\n")
}

/// Removes empty lines at both ends.
fn trimmed(text: &str) -> String {
    match text.trim_matches('\n') {
        "" => String::new(),
        text => format!("{text}\n"),
    }
}

#[cfg(test)]
mod tests;
