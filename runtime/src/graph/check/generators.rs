//! The nodes that generate a motion, in the graph and in each mode.

use std::collections::{BTreeMap, BTreeSet};

use super::carried::can_carry;
use super::contact::{ContactPorts, is_sensor};
use super::limits::limiters;
use crate::graph::net::{CommandWire, Net, Wire};
use crate::graph::plan::{PortRef, Producer};
use crate::node::Motion;
use crate::signal::Kind;

/// The motion that each node generates: with the parameters of the graph, and where a mode changes them.
pub(crate) struct Motions {
    usual: Vec<Motion>,
    /// For each mode, the nodes that it changes.
    changes: Vec<BTreeMap<usize, Motion>>,
}

impl Motions {
    /// Creates it from the motions with the parameters of the graph.
    pub(crate) const fn new(usual: Vec<Motion>) -> Self {
        Self { usual, changes: Vec::new() }
    }

    /// Adds the next mode, with the nodes that it builds again.
    pub(crate) fn add_mode(&mut self, nodes: impl Iterator<Item = (usize, Motion)>) {
        let changes = nodes.filter(|(node, motion)| self.usual[*node] != *motion).collect();
        self.changes.push(changes);
    }

    /// Returns whether a mode lets a node move the sensor that is still otherwise.
    pub(super) fn wakes(&self, mode: usize) -> bool {
        self.changes[mode].iter().any(|(node, motion)| self.usual[*node] == Motion::Still && *motion != Motion::Still)
    }

    /// Returns the motion of a node in a mode.
    pub(super) fn of(&self, mode: usize, node: usize) -> Motion {
        self.changes[mode].get(&node).copied().unwrap_or(self.usual[node])
    }
}

/// The commands that each node drives.
pub(super) struct Drives<'a> {
    net: &'a Net<'a>,
    commands: Vec<Driven<'a>>,
}

/// A command and what it depends on.
struct Driven<'a> {
    wire: &'a CommandWire,
    /// Whether each node is upstream of the command.
    upstream: Vec<bool>,
    /// The roles that the limiters of the command read: its arm and the sensors on it.
    limiting: BTreeSet<usize>,
}

impl<'a> Drives<'a> {
    pub(super) fn new(net: &'a Net<'a>) -> Self {
        let commands = net.commands.iter().filter(|wire| !wire.is_report);
        Self { net, commands: commands.map(|wire| Driven::new(net, wire)).collect() }
    }

    /// Returns the commands that a node drives.
    pub(super) fn commands(&self, node: usize) -> impl Iterator<Item = &CommandWire> {
        self.driven(node).map(|command| command.wire)
    }

    fn driven(&self, node: usize) -> impl Iterator<Item = &Driven<'a>> {
        self.commands.iter().filter(move |command| command.upstream[node])
    }

    /// Returns whether the limiters of every command that a node drives read a sensor of the port. A sensor on another
    /// arm may have its contact while this one moves through air.
    pub(super) fn shares_sensor(&self, port: PortRef, node: usize) -> bool {
        let sensors: BTreeSet<usize> = self.net.roles_of(port.producer).collect();
        self.driven(node).all(|command| !command.limiting.is_disjoint(&sensors))
    }
}

impl<'a> Driven<'a> {
    fn new(net: &'a Net<'a>, wire: &'a CommandWire) -> Self {
        let upstream = net.upstream(wire.source.producer.node());
        let mut limiting: BTreeSet<usize> =
            limiters(net, wire).into_iter().flat_map(|node| known_roles(net, node)).collect();
        // A command whose limiters read no sensor has a mistake of its own.
        if can_carry(net, wire.role) && limiting.iter().all(|role| !is_sensor(net, *role)) {
            limiting = net.roles_of(wire.source.producer).collect();
        }
        Self { wire, upstream, limiting }
    }
}

/// Returns the roles upstream of the known inputs of a limiter.
fn known_roles(net: &Net<'_>, limiter: usize) -> Vec<usize> {
    let inputs = net.spec(limiter).map_or(&[][..], |spec| &spec.inputs);
    let known = net.wires[limiter].iter().filter(|wire| inputs[wire.input].need.must_be_known);
    known.flat_map(|wire| net.roles_of(wire.source.producer)).collect()
}

/// The nodes that start a motion of the arm without a sample.
pub(crate) struct Generators {
    /// Those with the parameters of the graph.
    usual: Vec<usize>,
    /// Those of each mode, in its task.
    of_modes: Vec<Vec<usize>>,
    /// All nodes that could start a motion with other parameters.
    all: Vec<usize>,
}

impl Generators {
    pub(crate) fn new(net: &Net<'_>, contact: &ContactPorts, motions: &Motions) -> Self {
        let drives = Drives::new(net);
        let find = |is_still: &dyn Fn(usize) -> bool| find(net, contact, &drives, is_still);
        let usual = find(&|node| motions.usual[node] == Motion::Still);
        let of_modes = motions.changes.iter().enumerate().map(|(mode, changes)| {
            let task = net.flat.modes[mode].task;
            let shut = shut(net, mode);
            let generators = match changes.is_empty() && shut.is_empty() {
                true => usual.clone(),
                false => find(&|node| shut.contains(&node) || motions.of(mode, node) == Motion::Still),
            };
            let generators = generators.into_iter();
            generators.filter(|node| net.flat.task_with_modes(*node) == Some(task)).collect()
        });
        let of_modes = of_modes.collect();
        Self { usual, of_modes, all: find(&|_| false) }
    }

    /// Returns the generators outside of all tasks with modes.
    pub(super) fn outside_modes(&self, net: &Net<'_>) -> Vec<usize> {
        self.usual.iter().copied().filter(|node| net.flat.task_with_modes(*node).is_none()).collect()
    }

    /// Returns the nodes of a task with modes that could start a motion with other parameters.
    pub(super) fn all_in(&self, net: &Net<'_>, task: usize) -> Vec<usize> {
        self.all.iter().copied().filter(|node| net.flat.task_with_modes(*node) == Some(task)).collect()
    }

    /// Returns the generators of a mode.
    pub(super) fn of(&self, mode: usize) -> &[usize] {
        &self.of_modes[mode]
    }
}

/// Returns the nodes whose only wire is a gate that is shut in this mode: the flag of another mode of its task. Such a node
/// writes nothing then, as docs/writing-a-node.md asks of it.
fn shut(net: &Net<'_>, mode: usize) -> BTreeSet<usize> {
    let task = net.flat.modes[mode].task;
    let number = net.flat.modes[..mode].iter().filter(|other| other.task == task).count();
    let is_other = |wire: &Wire| wire.source.producer == Producer::Task(task) && wire.source.port != number;
    let is_alone = |node: &usize| matches!(&net.wires[*node][..], [wire] if is_other(wire));
    (0..net.wires.len()).filter(is_alone).collect()
}

/// Returns the nodes that start a motion of the arm without a sample.
fn find(net: &Net<'_>, contact: &ContactPorts, drives: &Drives<'_>, is_still: &dyn Fn(usize) -> bool) -> Vec<usize> {
    let nodes = net.wires.len();
    let (mut sampled, mut still) = (vec![false; nodes], vec![false; nodes]);
    // `moved` also contains the nodes that pass on a generated motion.
    let (mut generators, mut moved) = (Vec::new(), vec![false; nodes]);
    for &node in &net.order {
        let Some(spec) = net.spec(node) else { continue };
        let wires = || net.wires[node].iter().filter(|wire| !spec.inputs[wire.input].need.is_delayed);
        // A flag that nothing ties to a contact of that arm may be set forever, so it gates nothing.
        let is_contact = |port: PortRef| contact.need(net, port) && drives.shares_sensor(port, node);
        let is_gate = |wire: &Wire| net.port(wire.source).kind != Kind::Flag || is_contact(wire.source);
        let is_sampled =
            |wire: &Wire| is_gate(wire) && wire.source.producer.node().is_none_or(|source| sampled[source]);
        // A wire with a mistake may be the gate.
        if net.lacks_wires(node) || wires().any(is_sampled) {
            sampled[node] = true;
            continue;
        }
        let sources: Vec<usize> = wires().filter_map(|wire| wire.source.producer.node()).collect();
        let gives_motion = spec.outputs.iter().any(|port| matches!(port.kind, Kind::Twist | Kind::Joints));
        // A motion of what rests is none. A flag opens a gate whatever it is made of, and a number that is 0 can become an
        // error or a setpoint.
        let is_value = |wire: &&Wire| net.port(wire.source).kind != Kind::Flag;
        let mut values = wires().filter(is_value).filter_map(|wire| wire.source.producer.node()).peekable();
        let all_still = gives_motion && values.peek().is_some() && values.all(|source| still[source]);
        if is_still(node) || all_still {
            still[node] = true;
        } else if sources.iter().any(|source| moved[*source]) {
            moved[node] = true;
        } else if gives_motion && drives.commands(node).next().is_some() {
            moved[node] = true;
            generators.push(node);
        }
    }
    generators
}
