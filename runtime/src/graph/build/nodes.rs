//! Builds the nodes of a graph in the order of their steps, each from what its wires bring.

use std::collections::BTreeMap;

use crate::graph::bench::fill_facts;
use crate::graph::bench::{BoundRole, Opened, place};
use crate::graph::check::frames::Frames;
use crate::graph::check::units::{Clash, Units};
use crate::graph::net::{CommandWire, Net, Origin};
use crate::graph::plan::{PlannedCommand, PlannedNode, PlannedReport, PlannedRole, PlannedWire};
use crate::graph::plan::{PlannedPort, PortRef, Producer};
use crate::graph::syntax::{Age, Policy, PolicyTable};
use crate::node::{Built, Configured, Given, Need, NodeSpec, PortSpec, Reader, frame_args};
use crate::signal::{FlagShape, Kind, Shape};
use crate::source::{Code, Diagnostic, SourceMap, Value};

/// Builds the nodes one after the other and notes what is wrong with them.
pub(crate) struct Builder<'a> {
    pub(crate) net: &'a Net<'a>,
    opened: &'a Opened,
    frames: Frames,
    pub(crate) found: Vec<Diagnostic>,
    sources: SourceMap,
    /// Nominal time between two ticks [s].
    pub(crate) period: f64,
    /// Ports whose shape is known so far.
    pub(crate) ports: BTreeMap<PortRef, PlannedPort>,
    /// What the variables of each node stand for.
    units: BTreeMap<usize, Units>,
    /// What each node was made from, and whether it starts no motion by itself.
    kept: BTreeMap<usize, (Given, bool)>,
}

impl<'a> Builder<'a> {
    /// A builder to whom the ports of the roles are known.
    pub(crate) fn new(
        net: &'a Net<'a>,
        opened: &'a Opened,
        frames: Frames,
        (found, sources): (Vec<Diagnostic>, SourceMap),
        period: f64,
    ) -> Self {
        let (ports, units, kept) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
        let mut builder = Self { net, opened, frames, found, sources, period, ports, units, kept };
        builder.roles();
        builder
    }

    /// What was found to be wrong, and the texts it stands in.
    pub(crate) fn finish(self) -> (Vec<Diagnostic>, SourceMap) {
        (self.found, self.sources)
    }
}

impl Builder<'_> {
    fn port(&mut self, source: PortRef, shape: Shape) -> PlannedPort {
        let frames = self.frames.of(self.net, source);
        let port = PlannedPort { name: self.net.port_name(source), shape, frames };
        self.ports.insert(source, port.clone());
        port
    }

    fn roles(&mut self) {
        for (i, bound) in self.opened.roles.iter().enumerate() {
            for (port, (_, shape)) in bound.iter().flat_map(|bound| &bound.outputs).enumerate() {
                self.port(PortRef { producer: Producer::Role(i), port }, shape.clone());
            }
        }
    }

    pub(crate) fn planned_roles(&self, policy: &PolicyTable) -> Vec<PlannedRole> {
        let role = |(i, bound): (usize, &Option<BoundRole>)| {
            let bound = bound.as_ref()?;
            let source = |port| PortRef { producer: Producer::Role(i), port };
            let ports = (0..bound.outputs.len()).map(|port| self.ports[&source(port)].clone()).collect();
            let name = self.net.flat.roles[i].0.name.clone();
            let period = self.opened.periods[bound.device];
            let (max_age, stale) = policy.of(&name, period);
            let (device, numbers, period) = (bound.device, numbers(bound), (period * 1e9) as i64);
            Some(PlannedRole { name, device, numbers, ports, max_age, stale, is_observed: false, period })
        };
        let declared = self.opened.roles.iter().enumerate().filter_map(role);
        declared.chain(self.observed_roles()).collect()
    }

    /// Roles that no wire comes from: however old their samples are, the run goes on as it would without them.
    fn observed_roles(&self) -> impl Iterator<Item = PlannedRole> {
        self.net.observed.iter().zip(&self.opened.observed).filter_map(|((key, _, role), bound)| {
            let bound = bound.as_ref()?;
            let port = |(spec, (_, shape)): (&PortSpec, &(usize, Shape))| PlannedPort {
                name: format!("{}.{}", key.name, spec.name),
                shape: shape.clone(),
                frames: frame_args(spec).iter().map(|_| Some(key.name.clone())).collect(),
            };
            Some(PlannedRole {
                name: key.name.clone(),
                device: bound.device,
                numbers: numbers(bound),
                ports: role.outputs.iter().zip(&bound.outputs).map(port).collect(),
                max_age: i64::MAX,
                stale: Policy::Count,
                is_observed: true,
                period: (self.opened.periods[bound.device] * 1e9) as i64,
            })
        })
    }

    pub(crate) fn node(&mut self, index: usize) -> Option<PlannedNode> {
        let (node, wires) = (&self.net.flat.nodes[index], &self.net.wires[index]);
        let (kind, spec) = self.net.nodes[index]?;
        let (configured, params) = self.configure(kind, &node.block.params);
        let mut inputs: Vec<(Need, Vec<PlannedWire>)> =
            spec.inputs.iter().map(|input| (input.need, Vec::new())).collect();
        let mut given = Given { inputs: vec![Vec::new(); spec.inputs.len()], period: self.period };
        let mut units = Units::default();
        let mut is_whole = wires.len() == node.block.wires.len();
        for wire in wires {
            let input = &spec.inputs[wire.input];
            inputs[wire.input].1.push(PlannedWire {
                source: wire.source,
                age: wire.origin.age,
                span: wire.origin.word.span.clone(),
            });
            if input.need.is_delayed {
                // What it brings is made later, so its shape is not known yet; of a flag there is nothing to know.
                if input.kind == Kind::Flag {
                    given.inputs[wire.input].push((wire.key.name.clone(), FlagShape.into()));
                }
                continue;
            }
            let Some(port) = self.ports.get(&wire.source) else {
                is_whole = false;
                continue;
            };
            let consumer = format!("{}.{}", node.name, wire.key.name);
            if let Err(clash) = units.take(input, &consumer, &port.shape) {
                self.found.push(unit_mismatch(port, &consumer, &clash, &wire.origin).with_help(self.rate_maker(input)));
                is_whole = false;
            }
            given.inputs[wire.input].push((wire.key.name.clone(), port.shape.clone()));
        }
        let missing = |(need, ports): &(Need, Vec<PlannedWire>)| need.must_be_wired && ports.is_empty();
        if !is_whole || inputs.iter().any(missing) || self.frames.has_clash(index) {
            return None;
        }
        let built = match configured?.build(given.clone()) {
            Ok(built) => built,
            Err(mistakes) => {
                let block = &node.block;
                place(mistakes, &params, &block.wires, &mut self.sources, &mut self.found);
                return None;
            }
        };
        let mut ports = Vec::new();
        for (port, (mut shape, output)) in built.outputs.into_iter().zip(&spec.outputs).enumerate() {
            units.give(output, &format!("{}.{}", node.name, output.name), &mut shape);
            ports.push(self.port(PortRef { producer: Producer::Node(index), port }, shape));
        }
        self.units.insert(index, units);
        self.kept.insert(index, (given, built.is_still));
        Some(PlannedNode {
            index,
            name: node.name.clone(),
            node: built.node,
            inputs,
            ports,
            is_every_tick: spec.every_tick,
            is_logged: spec.logs,
            holds: spec.limits.holds,
            span: node.block.key.span.clone(),
        })
    }

    /// Whether a node starts no motion by itself as the base graph sets it.
    pub(crate) fn is_still(&self, node: usize) -> bool {
        // One that could not be made has been told of.
        self.kept.get(&node).is_none_or(|(_, is_still)| *is_still)
    }

    /// A node once more, with other parameters: from what it was made the first time, with the same outputs.
    pub(crate) fn variant(&mut self, index: usize, params: &Value) -> Option<Built> {
        let (kind, spec) = self.net.nodes[index]?;
        let (given, _) = self.kept.get(&index)?.clone();
        let block = &self.net.flat.nodes[index].block;
        let (configured, params) = self.configure(kind, params);
        let mut built = match configured?.build(given) {
            Ok(built) => built,
            Err(mistakes) => {
                place(mistakes, &params, &block.wires, &mut self.sources, &mut self.found);
                return None;
            }
        };
        let name = &self.net.flat.nodes[index].name;
        for (port, (shape, output)) in built.outputs.iter_mut().zip(&spec.outputs).enumerate() {
            self.units.get_mut(&index)?.give(output, &format!("{name}.{}", output.name), shape);
            if self.ports[&PortRef { producer: Producer::Node(index), port }].shape != *shape {
                let message = format!("`{name}.{}` would be of another shape: no mode can set that", output.name);
                self.found.push(Diagnostic::new(Code::NotLive, params.span.clone(), message));
                return None;
            }
        }
        Some(built)
    }

    /// Reads the parameters of a node, and gives them back with all facts filled in: a mistake shows where a number of
    /// [limits] stands, and not where it is asked for.
    fn configure(&mut self, kind: usize, params: &Value) -> (Option<Box<dyn Configured>>, Value) {
        let mut params = params.clone();
        let has_facts = fill_facts(&mut params, self.net, self.opened, &mut self.found);
        let mut reader = Reader::new(&self.sources);
        if !has_facts {
            return (None, params);
        }
        let configured = self.net.catalogue.nodes()[kind].configure(&params, &mut reader);
        let mistakes = reader.mistakes;
        let is_good = mistakes.is_empty();
        place(mistakes, &params, &[], &mut self.sources, &mut self.found);
        (configured.filter(|_| is_good), params)
    }

    /// How to make rates for an input that takes nothing else: a node that takes any unit and gives it per second.
    fn rate_maker(&self, input: &PortSpec) -> Option<String> {
        let unit = |port: &PortSpec| port.args.first().filter(|_| port.kind == input.kind).cloned();
        unit(input)?.strip_suffix("/s").filter(|of| *of == "_" || of.starts_with(|c: char| c.is_ascii_uppercase()))?;
        let takes =
            |spec: &NodeSpec, of: &str| spec.inputs.iter().any(|port| unit(port).is_some_and(|unit| unit == of));
        let makes = |spec: &NodeSpec| {
            let mut units = spec.outputs.iter().filter_map(unit);
            units.any(|unit| unit.strip_suffix("/s").is_some_and(|of| takes(spec, of)))
        };
        let maker = self.net.catalogue.specs().find(|spec| makes(spec))?;
        Some(format!("put a `{}` between them", maker.name))
    }

    /// Delayed inputs are compared once every shape is known.
    pub(crate) fn delayed(&mut self) {
        let net = self.net;
        for (index, wires) in net.wires.iter().enumerate() {
            let Some(spec) = self.net.spec(index) else { continue };
            for wire in wires.iter().filter(|wire| spec.inputs[wire.input].need.is_delayed) {
                let Some(port) = self.ports.get(&wire.source) else { continue };
                let consumer = format!("{}.{}", self.net.flat.nodes[index].name, wire.key.name);
                let units = self.units.entry(index).or_default();
                if let Err(clash) = units.take(&spec.inputs[wire.input], &consumer, &port.shape) {
                    self.found.push(unit_mismatch(port, &consumer, &clash, &wire.origin));
                }
            }
        }
    }

    pub(crate) fn command(&mut self, wire: &CommandWire) -> Option<PlannedCommand> {
        let bound = self.opened.roles[wire.role].as_ref()?;
        let port = self.taken(wire)?;
        let (spec, (command, takes)) = (self.net.taken(wire), &bound.commands[wire.command]);
        let (has, wants) = (joint_names(&port.shape), joint_names(takes));
        if has != wants {
            let consumer = self.net.taken_name(wire);
            let message = format!("`{}` has the joints {has:?}, but `{consumer}` takes {wants:?}", port.name);
            self.found.push(wire.origin.mistake(Code::ShapeMismatch, message));
            return None;
        }
        let accelerations = accelerations(&port.shape).zip(accelerations(takes)).map(|(a, b)| a.min(b)).collect();
        Some(PlannedCommand {
            source: wire.source,
            device: bound.device,
            command: *command,
            name: [self.net.flat.roles[wire.role].0.name.clone(), spec.name.to_string()],
            age: self.age(wire),
            span: wire.origin.word.span.clone(),
            accelerations,
        })
    }

    pub(crate) fn report(&mut self, wire: &CommandWire) -> Option<PlannedReport> {
        let bound = self.opened.roles[wire.role].as_ref()?;
        Some(PlannedReport {
            source: wire.source,
            shape: self.taken(wire)?.shape,
            device: bound.device,
            report: bound.reports[wire.command].0,
            name: [self.net.flat.roles[wire.role].0.name.clone(), self.net.taken(wire).name.to_string()],
            age: self.age(wire),
            span: wire.origin.word.span.clone(),
        })
    }

    /// What a command wire brings, if it is in the unit that is taken.
    fn taken(&mut self, wire: &CommandWire) -> Option<PlannedPort> {
        let port = self.ports.get(&wire.source)?;
        let consumer = self.net.taken_name(wire);
        match Units::default().take(self.net.taken(wire), &consumer, &port.shape) {
            Ok(()) => Some(port.clone()),
            Err(clash) => {
                self.found.push(unit_mismatch(port, &consumer, &clash, &wire.origin));
                None
            }
        }
    }

    /// A device takes nothing that is older than five periods, unless its wire says so.
    fn age(&self, wire: &CommandWire) -> Age {
        wire.origin.age.unwrap_or(Age { max_age: (5e9 * self.period) as i64, stale: Policy::Hold })
    }
}

/// Numbers of a role's outputs among those of its device.
fn numbers(bound: &BoundRole) -> Vec<usize> {
    bound.outputs.iter().map(|(number, _)| *number).collect()
}

/// Greatest acceleration of each joint [rad/s²].
fn accelerations(shape: &Shape) -> impl Iterator<Item = f64> {
    let joints = match shape {
        Shape::Joints(shape) => shape.joints.as_slice(),
        _ => &[],
    };
    joints.iter().map(|joint| joint.acceleration)
}

fn joint_names(shape: &Shape) -> Vec<&str> {
    match shape {
        Shape::Joints(shape) => shape.joints.iter().map(|joint| joint.name.as_str()).collect(),
        _ => Vec::new(),
    }
}

fn unit_mismatch(port: &PlannedPort, consumer: &str, clash: &Clash, origin: &Origin) -> Diagnostic {
    let message = format!("`{}` {}, but `{consumer}` takes {}", port.name, clash.has, clash.takes);
    origin.mistake(Code::UnitMismatch, message)
}
