//! The picture of a graph: roles, nodes, and the wires between them.

use std::collections::HashMap;

use super::picture::{Look, Picture};
use crate::graph::{Outline, OutlinedWire, PlannedPort};
use crate::signal::Shape;

/// Returns the picture of a graph as it runs, with the time of each node if it is known. A role that is read and commanded
/// has a box for each.
pub(super) fn picture<'p>(
    outline: &'p Outline,
    ports: impl Iterator<Item = &'p PlannedPort>,
    times: &HashMap<String, String>,
    title: String,
) -> Picture {
    let ports = ports.map(|port| (port.name.as_str(), port)).collect();
    let mut drawing = Drawing { picture: Picture::new(title), outline, ports, sources: HashMap::new() };
    let mut nodes = Vec::new();
    for node in &outline.nodes {
        let (part, name) = node.name.rsplit_once('.').unwrap_or(("", &node.name));
        let group = drawing.picture.group(part);
        let kind = Some(&node.kind.text).filter(|kind| *kind != name).cloned();
        let time = times.get(&node.name).cloned();
        let lines = [name.to_owned()].into_iter().chain(kind).chain(time).collect();
        let number = drawing.picture.add(lines, Look::Inner, group);
        drawing.sources.insert(node.name.clone(), number);
        nodes.push(number);
    }
    for (node, number) in outline.nodes.iter().zip(nodes) {
        node.wires.iter().for_each(|wire| drawing.connect(wire, number));
    }
    let mut commanded: HashMap<&str, usize> = HashMap::new();
    for command in &outline.commands {
        let (role, _) = command.name.split_once('.').unwrap_or((&command.name, ""));
        let lines = || vec![role.to_owned(), "commands".to_owned()];
        let number = *commanded.entry(role).or_insert_with(|| drawing.picture.add(lines(), Look::Outer, None));
        drawing.connect(command, number);
    }
    drawing.picture
}

struct Drawing<'a> {
    picture: Picture,
    outline: &'a Outline,
    ports: HashMap<&'a str, &'a PlannedPort>,
    /// The box of each node, and of each role that is read.
    sources: HashMap<String, usize>,
}

impl Drawing<'_> {
    /// Draws a wire to a box.
    fn connect(&mut self, wire: &OutlinedWire, to: usize) {
        let producer = wire.source.rsplit_once('.').map_or(wire.source.as_str(), |(producer, _)| producer);
        let from = match self.sources.get(producer) {
            Some(from) => *from,
            None => self.outer(producer),
        };
        let port = self.ports.get(wire.source.as_str());
        let name = wire.source.rsplit_once('.').map_or("", |(_, port)| port);
        let line = port.map_or_else(|| name.to_owned(), |port| format!("{name}: {}", carried(port)));
        self.picture.connect(from, to, line);
    }

    /// Draws the box of a role, or of the modes of a task.
    fn outer(&mut self, name: &str) -> usize {
        let role = self.outline.roles.iter().find(|role| role.name == name);
        let below = role.map(|role| [role.kind.text.clone(), format!("on {}", role.device.text)]);
        let lines = [name.to_owned()].into_iter().chain(below.into_iter().flatten()).collect();
        let number = self.picture.add(lines, Look::Outer, None);
        self.sources.insert(name.to_owned(), number);
        number
    }
}

/// Returns what a wire carries: kind, unit and frames, and the names of features.
fn carried(port: &PlannedPort) -> String {
    let unit = port.shape.unit().map(|unit| format!(" [{unit}]")).unwrap_or_default();
    let features = match &port.shape {
        Shape::Features(shape) => {
            let names: Vec<&str> = shape.features.iter().map(|feature| &*feature.name).collect();
            format!(" {}", names.join(" "))
        }
        _ => String::new(),
    };
    let frames: Vec<&str> = port.frames.iter().flatten().map(String::as_str).collect();
    let frames = if frames.is_empty() { String::new() } else { format!(" in {}", frames.join(" in ")) };
    format!("{}{unit}{features}{frames}", port.shape.kind().name())
}
