//! Suggests the limiter of a second sensor on an arm: a part that holds the limits of both, or a block to insert.

use super::carried::guards;
use super::frames::{Frames, with_article};
use crate::graph::net::limits::PathNode;
use crate::graph::net::{CommandWire, Net};
use crate::graph::plan::{PortRef, Producer};
use crate::node::{NodeSpec, PortSpec, frame_args};
use crate::signal::Kind;
use crate::source::{FactRef, Table, Value};

/// Returns what to write so that the limits of `sensor` hold as well. `guard` is the limiter of another sensor on the
/// path of the command, whose last node is the first one.
pub(super) fn suggest(
    (wire, path): (&CommandWire, &[PathNode<'_>]),
    guard: &PathNode<'_>,
    sensor: usize,
    net: &Net<'_>,
    frames: &mut Frames<'_>,
) -> Option<String> {
    let first = net.flat.roles.position(&frames.of(guard.source).into_iter().next().flatten()?)?;
    let second = Second { net, wire, path, guard, first, sensor, spec: find_spec(net, guard.spec)? };
    match net.flat.nodes[guard.node].scope {
        0 => Some(second.block(frames)),
        scope => second.part(scope),
    }
}

/// Returns the type of limiter that holds the same limits for a sensor in whose frame the motion is not.
fn find_spec<'n>(net: &'n Net<'_>, guard: &NodeSpec) -> Option<&'n NodeSpec> {
    let is_second = |spec: &NodeSpec, input: &PortSpec| {
        let through = spec.inputs.iter().find(|input| Some(&*input.name) == spec.limits.through);
        let has_own_frame = through.is_some_and(|through| frame_args(through).first() != frame_args(input).first());
        has_own_frame && guard.limits.holds.iter().all(|limit| spec.limits.holds.contains(limit))
    };
    guards(net).find(|(spec, input)| is_second(spec, input)).map(|(spec, _)| spec)
}

/// The limiter of a second sensor.
struct Second<'a> {
    net: &'a Net<'a>,
    wire: &'a CommandWire,
    path: &'a [PathNode<'a>],
    guard: &'a PathNode<'a>,
    /// The sensor in whose frame the motion is.
    first: usize,
    sensor: usize,
    spec: &'a NodeSpec,
}

impl Second<'_> {
    /// Returns the block of a built-in part that replaces the part with the limiter of the first sensor.
    fn part(&self, scope: usize) -> Option<String> {
        let net = self.net;
        let old = &net.flat.scopes[scope];
        let name = &old.part.as_ref()?.name;
        let files = net.catalogue.builtin_files().iter().filter(|(file, _)| file.ends_with(".toml"));
        let mut parts =
            files.filter_map(|(file, bytes)| Some((*file, str::from_utf8(bytes).ok()?.parse::<toml::Table>().ok()?)));
        let has = |part: &toml::Table, kind: &str| nodes(part).any(|node| type_of(node) == Some(kind));
        let (file, part) = parts.find(|(_, part)| has(part, &self.spec.name) && has(part, &self.guard.spec.name))?;
        let mut block = format!("[parts.{name}]\nfile = \"builtin:{file}\"");
        for input in part.get("inputs").and_then(toml::Value::as_table)?.keys() {
            let given = old.inputs.iter().find(|(key, _)| key.name == *input).map(|(_, wire)| wire.from.value.clone());
            let port = || self.port_of(&part, input).unwrap_or_else(|| "?".into());
            block.push_str(&format!("\nin.{input} = \"{}\"", given.unwrap_or_else(port)));
        }
        block.push_str(&format!("\nroles = {{ {} }}", self.roles_of(&part, scope).join(", ")));
        let help = format!("limit both pads with the part `builtin:{file}`; what the block sets stays:\n{block}");
        let sensor = net.name(Producer::Role(self.sensor));
        let open = block.contains("\"?\"").then(|| format!("\nports of `{sensor}` that no node has yet are `?`"));
        Some(help + &open.unwrap_or_default())
    }

    /// Returns what the names of roles in a part mean: those that the other part has, and a new one for the sensor.
    fn roles_of(&self, part: &toml::Table, scope: usize) -> Vec<String> {
        let net = self.net;
        let (given, sensor) = (&net.flat.scopes[scope].roles, net.name(Producer::Role(self.sensor)));
        // The name of a role that a node is only for joins by itself.
        let always = nodes(part).filter(|node| node.get("only_with").is_none());
        let mut names: Vec<&str> = always.flat_map(facts).filter_map(|fact| Some(fact.split_once('.')?.0)).collect();
        names.sort_unstable();
        names.dedup();
        let first = net.name(Producer::Role(self.first));
        let mean = |name: &str| match given.get(name) {
            Some(role) => Some(role.clone()),
            // The part of the first sensor knows these names without a table.
            None if net.flat.roles.position(name).is_some() && name != sensor => Some(name.to_owned()),
            None => Some(sensor.to_owned()).filter(|_| name != first),
        };
        let names = names.into_iter().filter(|name| *name != crate::graph::syntax::LIMITS);
        names.filter_map(|name| Some(format!("{name} = \"{}\"", mean(name)?))).collect()
    }

    /// Returns the port of the second sensor that fits an input of a part: the last one in the order of the graph.
    fn port_of(&self, part: &toml::Table, input: &str) -> Option<String> {
        let net = self.net;
        let word = format!("inputs.{input}");
        let read = nodes(part).find_map(|node| {
            let wires = node.get("in")?.as_table()?;
            let (key, _) = wires.iter().find(|(_, source)| source.as_str() == Some(&word))?;
            let (_, spec) = net.catalogue.find_node(type_of(node)?)?;
            spec.inputs.iter().find(|input| input.name == **key)
        })?;
        self.find_port(read)
    }

    /// Returns the last port of the graph that fits an input and descends from the second sensor alone.
    fn find_port(&self, input: &PortSpec) -> Option<String> {
        let net = self.net;
        let fits = |port: PortRef| {
            let declared = net.port(port);
            let is_known = declared.quantity == input.quantity || is_passed(declared.quantity.as_deref());
            let mut roles = net.roles_of(port.producer).peekable();
            declared.kind == input.kind && is_known && roles.peek().is_some() && roles.all(|role| role == self.sensor)
        };
        let rank = |port: PortRef| net.order.iter().position(|node| Some(*node) == port.producer.node());
        let ports = net.ports_in(0).filter(|(_, port)| fits(*port));
        ports.max_by_key(|(_, port)| rank(*port)).map(|(name, _)| name)
    }

    /// Returns the block of the limiter behind the first one, and that of the pose of the second sensor if it has none.
    fn block(&self, frames: &mut Frames<'_>) -> String {
        let (net, name) = (self.net, &*self.spec.name);
        let first = &net.flat.nodes[self.guard.node].name;
        let output = self.guard.spec.outputs.first().map_or("", |port| &port.name);
        let through = self.spec.limits.through.unwrap_or_default();
        let (guards, mut poses) = (self.spec.limits.guards.unwrap_or_default(), String::new());
        let frame_of = |input: &PortSpec| frame_args(input).first().cloned();
        let of_motion = self.spec.inputs.iter().find(|input| input.name == through).and_then(frame_of);
        let mut block = format!("[nodes.{name}]\ntype = \"{name}\"\nin.{through} = \"{first}.{output}\"");
        for input in self.spec.inputs.iter().filter(|input| input.name != through) {
            let port = match input.kind {
                _ if input.name == guards => self.find_port(input),
                Kind::Pose => {
                    let role = if frame_of(input) == of_motion { self.first } else { self.sensor };
                    pose_of(net, frames, role).or_else(|| {
                        let (port, node) = self.second_pose(frames)?;
                        poses = format!("\n{node}");
                        Some(port)
                    })
                }
                _ => None,
            };
            // What need not be wired is left to the author.
            if port.is_some() || input.need.must_be_wired {
                block.push_str(&format!("\nin.{} = \"{}\"", input.name, port.unwrap_or_else(|| "?".into())));
            }
        }
        let params = net.flat.nodes[self.guard.node].block.params.as_table();
        for (key, value) in params.into_iter().flat_map(|table| &table.entries) {
            block.push_str(&format!("\n{} = {}", key.name, text(value)));
        }
        let taker = self.path.iter().find(|stop| stop.source.producer == Producer::Node(self.guard.node));
        let taker = taker.map_or_else(
            || net.command_name(self.wire),
            |stop| {
                let through = stop.spec.limits.through.unwrap_or_default();
                format!("{}.{through}", net.flat.nodes[stop.node].name)
            },
        );
        let limiter = with_article(name);
        format!(
            "insert {limiter} between `{first}.{output}` and `{taker}`, which then takes `{name}.{output}`:\n\
             {block}{poses}"
        )
    }

    /// Returns the pose of the second sensor and the node that computes it: that of the first one in another frame.
    fn second_pose(&self, frames: &mut Frames<'_>) -> Option<(String, String)> {
        let net = self.net;
        let [first, sensor] = [self.first, self.sensor].map(|role| net.name(Producer::Role(role)));
        let of_first = pose_of(net, frames, self.first)?;
        let (own, port) = of_first.split_once('.')?;
        let node = net.flat.nodes.iter().find(|node| node.name == own)?;
        let name = format!("{sensor}_{own}");
        let mut block = format!("[nodes.{name}]\ntype = \"{}\"", node.block.kind.as_ref()?.value);
        for wire in &node.block.wires.valid {
            block.push_str(&format!("\nin.{} = \"{}\"", wire.key.name, wire.from.value));
        }
        for (key, value) in node.block.params.as_table().into_iter().flat_map(|table| &table.entries) {
            let fact = value.as_table().and_then(Table::fact);
            let moved = |FactRef { word, .. }: FactRef<'_>| word.strip_prefix(&format!("{first}.")).map(str::to_owned);
            let line = match (fact.and_then(moved), value.as_str()) {
                (Some(fact), _) => format!("{{ from = \"{sensor}.{fact}\" }}"),
                (_, Some(role)) if role == first => format!("\"{sensor}\""),
                _ => text(value),
            };
            block.push_str(&format!("\n{} = {line}", key.name));
        }
        Some((format!("{name}.{port}"), block))
    }
}

/// Returns the name of a port with the pose of a sensor in the base, if the graph has one.
fn pose_of(net: &Net<'_>, frames: &mut Frames<'_>, sensor: usize) -> Option<String> {
    let name = net.name(Producer::Role(sensor));
    let poses = net.ports_in(0).filter(|(_, port)| net.port(*port).kind == Kind::Pose);
    let mut poses = poses.filter(|(_, port)| net.port(*port).quantity.is_some());
    poses.find(|(_, port)| frames.of(*port).first() == Some(&Some(name.to_owned()))).map(|(port, _)| port)
}

/// Whether a quantity is a letter, so that the node passes on that of an input.
fn is_passed(quantity: Option<&str>) -> bool {
    quantity.is_some_and(|text| text.starts_with(|c: char| c.is_ascii_uppercase()))
}

fn text(value: &Value) -> String {
    toml::Value::try_from(value).map(|value| value.to_string()).unwrap_or_default()
}

fn nodes(part: &toml::Table) -> impl Iterator<Item = &toml::Table> {
    let nodes = part.get("nodes").and_then(toml::Value::as_table);
    nodes.into_iter().flat_map(toml::Table::values).filter_map(toml::Value::as_table)
}

fn type_of(node: &toml::Table) -> Option<&str> {
    node.get("type")?.as_str()
}

/// Returns the facts that the parameters of a node read.
fn facts(node: &toml::Table) -> impl Iterator<Item = &str> {
    node.values().filter_map(|value| value.get("from")?.as_str())
}
