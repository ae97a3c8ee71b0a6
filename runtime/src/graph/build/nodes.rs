//! Builds the nodes of a graph in step order, each from the shapes on its wires.

use std::collections::{BTreeMap, BTreeSet};

use super::sample_times::AllSampleTimes;
use crate::graph::bench::{BoundRole, OpenedBench, place_mistakes};
use crate::graph::check::frames::Frames;
use crate::graph::check::units::{UnitMismatch, UnitOrigin, Units};
use crate::graph::load::MeasuredValues;
use crate::graph::net::{CommandWire, Net, WireOrigin};
use crate::graph::plan::{PlannedCommand, PlannedNode, PlannedPort, PlannedRole, PlannedWire, PortRef, Producer};
use crate::graph::syntax::{AgeLimit, Policy, default_max_age_ns};
use crate::node::{Built, Components, Configured, Given, Motion, Need, NodeSpec, PortSpec, Reading, frame_args};
use crate::signal::{FlagShape, Joint, Kind, Shape};
use crate::source::{Code, Diagnostic, Diagnostics, Key, SourceMap, Value};

/// Builds the nodes one after the other and collects their diagnostics.
pub(crate) struct Builder<'a> {
    pub(crate) net: &'a Net<'a>,
    pub(super) opened: &'a OpenedBench,
    frames: Frames<'a>,
    pub(crate) diagnostics: Diagnostics,
    pub(super) sources: SourceMap,
    /// Nominal time between two ticks [s].
    pub(crate) period: f64,
    /// Times of the samples behind each port.
    pub(super) sample_times: AllSampleTimes,
    /// Ports whose shape is known so far.
    pub(crate) ports: BTreeMap<PortRef, PlannedPort>,
    /// The unit variables of each node.
    units: BTreeMap<usize, Units>,
    /// What determined the unit of each port.
    origins: BTreeMap<PortRef, UnitOrigin>,
    /// The shapes from which each node was built, the motion that it generates, and what it says about its input.
    pub(super) built: BTreeMap<usize, (Given, Motion, Reading)>,
    /// The parameters of each configuration of each node, with all facts filled in.
    pub(super) filled: BTreeMap<usize, Vec<Value>>,
    /// The components of the outputs that are read of each configuration of each node.
    pub(super) wanted: BTreeMap<usize, Vec<Vec<Components>>>,
    /// The values of parameters that were written with a unit.
    pub(crate) measured: MeasuredValues,
}

impl<'a> Builder<'a> {
    /// Creates a builder that knows the ports of the roles.
    pub(crate) fn new(
        net: &'a Net<'a>,
        opened: &'a OpenedBench,
        frames: Frames<'a>,
        (diagnostics, sources): (Diagnostics, SourceMap),
        period: f64,
    ) -> Self {
        let mut builder = Self {
            net,
            opened,
            frames,
            diagnostics,
            sources,
            period,
            sample_times: AllSampleTimes::new(net, opened, period),
            ports: BTreeMap::new(),
            units: BTreeMap::new(),
            origins: BTreeMap::new(),
            built: BTreeMap::new(),
            filled: BTreeMap::new(),
            wanted: BTreeMap::new(),
            measured: MeasuredValues::default(),
        };
        builder.add_roles();
        builder.add_modes();
        builder
    }

    /// Returns the diagnostics, their source texts, and the values that were written with a unit.
    pub(crate) fn finish(self) -> (Diagnostics, SourceMap, MeasuredValues) {
        (self.diagnostics, self.sources, self.measured)
    }
}

impl Builder<'_> {
    fn add_port(&mut self, source: PortRef, shape: Shape) -> PlannedPort {
        let frames = self.frames.of(source);
        let port = PlannedPort { name: self.net.port_name(source), shape, frames };
        self.ports.insert(source, port.clone());
        port
    }

    fn add_roles(&mut self) {
        for (i, bound) in self.opened.roles.iter().enumerate() {
            for (port, (_, shape)) in bound.iter().flat_map(|bound| &bound.outputs).enumerate() {
                let source = PortRef { producer: Producer::Role(i), port };
                let device = bound.as_ref().map(|bound| &self.opened.devices[bound.device]);
                let port = self.add_port(source, shape.clone());
                let unit = shape.unit().map(|unit| unit.to_string()).unwrap_or_default();
                self.origins.extend(device.map(|device| {
                    let text = format!("the device `{}` gives `{}` in `{unit}`", device.name, port.name);
                    (source, UnitOrigin { span: device.span.clone(), text })
                }));
            }
        }
    }

    /// Adds the flags of the modes of all tasks.
    fn add_modes(&mut self) {
        for task in 0..self.net.flat.tasks.len() {
            for port in 0..self.net.flat.mode_names(task).count() {
                let source = PortRef { producer: Producer::Task(task), port };
                let span = self.net.place(source.producer);
                let port = self.add_port(source, FlagShape.into());
                self.origins.insert(source, UnitOrigin { span, text: format!("`{}` is a flag", port.name) });
            }
        }
    }

    /// Returns the tasks that read or command each role.
    fn role_tasks(&self) -> Vec<BTreeSet<usize>> {
        let net = self.net;
        let mut tasks = vec![BTreeSet::new(); net.roles.len()];
        let nodes = net.wires.iter().zip(&net.flat.nodes);
        let wires =
            nodes.flat_map(|(wires, node)| wires.iter().map(|wire| (wire.source, net.flat.scopes[node.scope].task)));
        for (source, task) in wires.chain(net.commands.iter().map(|wire| (wire.source, wire.task))) {
            if let Producer::Role(role) = source.producer {
                tasks[role].insert(task);
            }
        }
        for wire in &net.commands {
            tasks[wire.role].insert(wire.task);
        }
        tasks
    }

    /// Plans the roles, with their age limits.
    ///
    /// Of several tasks that use a role, the strictest limit holds.
    pub(crate) fn plan_roles(&self) -> Vec<PlannedRole> {
        let policies: Vec<_> = (0..self.net.flat.tasks.len()).map(|task| self.net.flat.policy(task)).collect();
        let tasks = self.role_tasks();
        let plan = |key: &Key, bound: &BoundRole, ports, age, is_observed| PlannedRole {
            name: key.name.clone(),
            device: bound.device,
            numbers: bound.outputs.iter().map(|(number, _)| *number).collect(),
            ports,
            age,
            is_observed,
            period: (self.opened.period(bound) * 1e9) as i64,
        };
        let declared = self.net.flat.roles.iter().zip(&self.opened.roles).enumerate();
        let declared = declared.filter_map(|(i, ((key, _), bound))| {
            let bound = bound.as_ref()?;
            let source = |port| PortRef { producer: Producer::Role(i), port };
            let ports = (0..bound.outputs.len()).map(|port| self.ports[&source(port)].clone()).collect();
            let limit =
                |task: &usize| policies[*task].age_limit(self.net.flat.role_in(*task, i), self.opened.period(bound));
            let strictest = tasks[i].iter().map(limit).reduce(|one, other| one.and(Some(other)));
            Some(plan(key, bound, ports, strictest.unwrap_or_else(|| limit(&0)), false))
        });
        // The age of a sample for scenarios and recordings does not matter.
        let ageless = AgeLimit { max_age: i64::MAX, stale: Policy::Count };
        let observed = self.net.observed.iter().zip(&self.opened.observed).filter_map(|((key, role), bound)| {
            let bound = bound.as_ref()?;
            let port = |(spec, (_, shape)): (&PortSpec, &(usize, Shape))| PlannedPort {
                name: format!("{}.{}", key.name, spec.name),
                shape: shape.clone(),
                frames: frame_args(spec).iter().map(|_| Some(key.name.clone())).collect(),
            };
            let ports = role.outputs.iter().zip(&bound.outputs).map(port).collect();
            Some(plan(key, bound, ports, ageless, true))
        });
        declared.chain(observed).collect()
    }

    /// Builds a node, or returns `None` if it or its wires have mistakes.
    pub(crate) fn node(&mut self, index: usize) -> Option<PlannedNode> {
        let (node, wires) = (&self.net.flat.nodes[index], &self.net.wires[index]);
        let (kind, spec) = self.net.nodes[index]?;
        let mut inputs: Vec<(Need, Vec<PlannedWire>)> =
            spec.inputs.iter().map(|input| (input.need, Vec::new())).collect();
        let count = spec.inputs.len();
        let sample_periods = vec![self.period; count];
        let mut given = Given { inputs: vec![Vec::new(); count], period: self.period, sample_periods };
        let mut units = Units::default();
        let mut is_complete = wires.len() == node.block.wires.valid.len();
        for wire in wires {
            let input = &spec.inputs[wire.input];
            let slowest = &mut given.sample_periods[wire.input];
            *slowest = slowest.max(self.sample_times.of(wire.source.producer).period);
            inputs[wire.input].1.push(PlannedWire {
                source: wire.source,
                age: wire.origin.age,
                span: wire.origin.word.span.clone(),
            });
            if input.need.is_delayed {
                // The source of a delayed input is built later, so only the shape of a flag is known.
                if input.kind == Kind::Flag {
                    given.inputs[wire.input].push((wire.key.name.clone(), FlagShape.into()));
                }
                continue;
            }
            let Some(port) = self.ports.get(&wire.source) else {
                is_complete = false;
                continue;
            };
            let consumer = format!("{}.{}", node.name, wire.key.name);
            if let Err(mismatch) = units.take(input, &consumer, &port.shape, &self.origins[&wire.source]) {
                let diagnostic = self.unit_mismatch(wire.source, &consumer, mismatch, &wire.origin);
                self.diagnostics.push(diagnostic.with_help(self.suggest_rate_node(input)));
                is_complete = false;
            }
            given.inputs[wire.input].push((wire.key.name.clone(), port.shape.clone()));
        }
        let missing = |(need, ports): &(Need, Vec<PlannedWire>)| need.must_be_wired && ports.is_empty();
        is_complete &= !inputs.iter().any(missing);
        let (configured, params) = self.configure(index, kind, &node.block.params, &given, is_complete);
        if !is_complete || self.frames.has_clash(index) {
            return None;
        }
        let built = self.build(index, configured, &params, given.clone())?;
        self.filled.entry(index).or_default().push(params);
        let mut ports = Vec::new();
        for (port, (mut shape, output)) in built.outputs.into_iter().zip(&spec.outputs).enumerate() {
            let name = format!("{}.{}", node.name, output.name);
            let origin = units.give(output, &name, &node.block.key.span, &mut shape);
            let source = PortRef { producer: Producer::Node(index), port };
            self.origins.insert(source, origin);
            ports.push(self.add_port(source, shape));
        }
        self.units.insert(index, units);
        self.built.insert(index, (given, built.motion, built.reading));
        Some(PlannedNode {
            index,
            name: node.name.clone(),
            node: built.node,
            inputs,
            ports,
            sample_times: self.sample_times.of(Producer::Node(index)),
            is_every_tick: spec.every_tick,
            is_logged: spec.logs,
            holds: spec.limits.holds,
            budget: spec.limits.spends.and_then(|spent| self.budget(index, spec, spent)),
            fails: spec.limits.fails.and_then(|flag| spec.outputs.iter().position(|output| output.name == flag)),
            is_uncalibrated: built.is_uncalibrated,
            task: self.net.flat.scopes[node.scope].task,
            span: node.block.key.span.clone(),
        })
    }

    /// Returns the output of a limiter that is set while a budget is spent, and the role whose commands it limits.
    fn budget(&self, node: usize, spec: &NodeSpec, spent: &str) -> Option<(usize, String)> {
        let port = spec.outputs.iter().position(|output| output.name == spent)?;
        let mut commands = self.net.commands.iter().filter(|wire| !wire.is_report);
        let command = commands.find(|wire| self.net.upstream(wire.source.producer.node())[node])?;
        Some((port, self.net.name(Producer::Role(command.role)).to_owned()))
    }

    /// Returns the motion that a node generates with the parameters of the graph.
    pub(crate) fn motion(&self, node: usize) -> Motion {
        // A node that could not be built has its own diagnostic.
        self.built.get(&node).map_or(Motion::Still, |(_, motion, _)| *motion)
    }

    /// Returns what a node says about its first input with the parameters of the graph.
    pub(crate) fn reading(&self, node: usize) -> Reading {
        self.built.get(&node).map_or(Reading::Other, |(.., reading)| *reading)
    }

    /// Builds a node again with other parameters, from the same input shapes; its output shapes must not change.
    pub(crate) fn variant(&mut self, index: usize, params: &Value) -> Option<Built> {
        let (kind, spec) = self.net.nodes[index]?;
        let (given, ..) = self.built.get(&index)?.clone();
        let (configured, params) = self.configure(index, kind, params, &given, true);
        let mut built = self.build(index, configured, &params, given)?;
        let node = &self.net.flat.nodes[index];
        let name = &node.name;
        for (port, (shape, output)) in built.outputs.iter_mut().zip(&spec.outputs).enumerate() {
            let place = &node.block.key.span;
            self.units.get_mut(&index)?.give(output, &format!("{name}.{}", output.name), place, shape);
            if self.ports[&PortRef { producer: Producer::Node(index), port }].shape != *shape {
                let message =
                    format!("this mode would change the shape of `{name}.{}`, which is fixed at load", output.name);
                self.diagnostics.push(Diagnostic::new(Code::NotLive, params.span.clone(), message));
                return None;
            }
        }
        self.filled.entry(index).or_default().push(params);
        Some(built)
    }

    /// Builds a node from its parameters and the shapes on its wires, or reports its mistakes.
    fn build(
        &mut self,
        index: usize,
        configured: Option<Box<dyn Configured>>,
        params: &Value,
        given: Given,
    ) -> Option<Built> {
        let (mistakes, built) = match configured?.build(given) {
            Ok(mut built) => (std::mem::take(&mut built.warnings), Some(built)),
            Err(mistakes) => (mistakes.into_iter().map(|mistake| self.at_wire(mistake, index)).collect(), None),
        };
        let wires = &self.net.flat.nodes[index].block.wires.valid;
        place_mistakes(mistakes, params, wires, &mut self.sources, &mut self.diagnostics);
        built
    }

    /// Reports a wire whose ends differ in their units, with the places that determined both.
    fn unit_mismatch(
        &self,
        source: PortRef,
        consumer: &str,
        UnitMismatch { has, takes, by }: UnitMismatch,
        wire: &WireOrigin,
    ) -> Diagnostic {
        let message = format!("`{}` {has}, but `{consumer}` takes {takes}", self.ports[&source].name);
        let diagnostic = wire.diagnostic(Code::UnitMismatch, message);
        let origins = [self.origins.get(&source).cloned(), by].into_iter().flatten();
        origins.fold(diagnostic, |diagnostic, UnitOrigin { span, text }| diagnostic.note(span, text))
    }

    /// Suggests a node that converts any unit into that unit per second, for an input that takes only rates.
    fn suggest_rate_node(&self, input: &PortSpec) -> Option<String> {
        let unit = |port: &PortSpec| port.args.first().filter(|_| port.kind == input.kind).cloned();
        unit(input)?.strip_suffix("/s").filter(|of| *of == "_" || of.starts_with(|c: char| c.is_ascii_uppercase()))?;
        let takes =
            |spec: &NodeSpec, of: &str| spec.inputs.iter().any(|port| unit(port).is_some_and(|unit| unit == of));
        let makes = |spec: &NodeSpec| {
            let mut units = spec.outputs.iter().filter_map(unit);
            units.any(|unit| unit.strip_suffix("/s").is_some_and(|of| takes(spec, of)))
        };
        let maker = self.net.catalogue.specs().find(|spec| makes(spec))?;
        Some(format!("insert a `{}` between them", maker.name))
    }

    /// Compares the units of delayed inputs, once every shape is known.
    pub(crate) fn check_delayed_units(&mut self) {
        let net = self.net;
        for (index, wires) in net.wires.iter().enumerate() {
            let Some(spec) = self.net.spec(index) else { continue };
            for wire in wires.iter().filter(|wire| spec.inputs[wire.input].need.is_delayed) {
                let Some(port) = self.ports.get(&wire.source) else { continue };
                let consumer = format!("{}.{}", self.net.flat.nodes[index].name, wire.key.name);
                let units = self.units.entry(index).or_default();
                let origin = &self.origins[&wire.source];
                if let Err(mismatch) = units.take(&spec.inputs[wire.input], &consumer, &port.shape, origin) {
                    let diagnostic = self.unit_mismatch(wire.source, &consumer, mismatch, &wire.origin);
                    self.diagnostics.push(diagnostic);
                }
            }
        }
    }

    /// Plans a command or a report, or returns `None` if its wire has a mistake.
    pub(crate) fn command(&mut self, wire: &CommandWire) -> Option<PlannedCommand> {
        let bound = self.opened.roles[wire.role].as_ref()?;
        let port = self.ports.get(&wire.source)?;
        let (spec, consumer) = (self.net.command_port(wire), self.net.command_name(wire));
        if let Err(mismatch) = Units::default().take(spec, &consumer, &port.shape, &self.origins[&wire.source]) {
            self.diagnostics.push(self.unit_mismatch(wire.source, &consumer, mismatch, &wire.origin));
            return None;
        }
        let (number, takes) = &(if wire.is_report { &bound.reports } else { &bound.commands })[wire.command];
        let (given, moved) = (joints(&port.shape), joints(takes));
        let names = |joints: &[Joint]| joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
        let (has, wants) = (names(given), names(moved));
        if !wire.is_report && has != wants {
            let message = format!("`{}` has the joints {has:?}, but `{consumer}` takes {wants:?}", port.name);
            self.diagnostics.push(wire.origin.diagnostic(Code::ShapeMismatch, message));
            return None;
        }
        Some(PlannedCommand {
            source: wire.source,
            task: wire.task,
            tasks: motion_tasks(self.net, wire),
            device: bound.device,
            is_report: wire.is_report,
            port: *number,
            name: [self.net.flat.roles[wire.role].0.name.clone(), spec.name.to_string()],
            shape: port.shape.clone(),
            age: self.age_limit(wire),
            span: wire.origin.word.span.clone(),
            accelerations: given.iter().zip(moved).map(|(a, b)| a.acceleration.min(b.acceleration)).collect(),
        })
    }

    /// Returns the age limit of a command wire; the default is five periods of the slowest device behind it.
    fn age_limit(&self, wire: &CommandWire) -> AgeLimit {
        let period = self.sample_times.of(wire.source.producer).period;
        wire.origin.age.unwrap_or(AgeLimit { max_age: default_max_age_ns(period), stale: Policy::Hold })
    }
}

/// Returns the tasks of the nodes through which the motion of a command passes, and that of its wire.
fn motion_tasks(net: &Net<'_>, command: &CommandWire) -> Vec<usize> {
    let is_motion = |source: &PortRef| matches!(net.port(*source).kind, Kind::Twist | Kind::Joints);
    let (mut tasks, mut seen) = (BTreeSet::from([command.task]), BTreeSet::new());
    let mut open: Vec<usize> = command.source.producer.node().into_iter().collect();
    while let Some(node) = open.pop() {
        if net.flat.tasks.len() > 1 && seen.insert(node) {
            tasks.insert(net.flat.scopes[net.flat.nodes[node].scope].task);
            let sources = net.wires[node].iter().map(|wire| wire.source).filter(is_motion);
            open.extend(sources.filter_map(|source| source.producer.node()));
        }
    }
    tasks.into_iter().collect()
}

/// Returns the joints of a joint vector; other shapes have none.
fn joints(shape: &Shape) -> &[Joint] {
    match shape {
        Shape::Joints(shape) => &shape.joints,
        _ => &[],
    }
}
