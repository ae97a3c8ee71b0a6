//! The net of a flat graph: declarations, wires, and the order in which the nodes step.

mod beside;
mod connect;
mod declare;
pub(crate) mod limits;
mod meant_type;
mod order;
mod provenance;
mod resolve;
mod scope_ports;
mod slow;
mod sorter;
mod task_modes;
mod wire;

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::graph::load::{FlatGraph, Task};
use crate::graph::plan::{PortRef, Producer};
use crate::graph::syntax::NO_ARM;
use crate::node::{NodeSpec, PortSpec, frame_args};
use crate::source::{Code, Diagnostic, Diagnostics, Key, Value};

pub(crate) use beside::role_types;
use provenance::Provenance;
use scope_ports::ScopePorts;
pub(crate) use slow::slow_down;
use task_modes::TaskModes;
pub(crate) use wire::{CommandWire, Wire, WireOrigin};

/// What a name refers to. The error is a diagnostic, or `None` if another one explains why the name refers to nothing.
pub(crate) type Resolved<T> = Result<T, Option<Box<Diagnostic>>>;

/// Returns what a name refers to, or adds its diagnostic.
pub(crate) fn report<T>(resolved: Resolved<T>, diagnostics: &mut Diagnostics) -> Option<T> {
    resolved.map_err(|diagnostic| diagnostics.extend(diagnostic.map(|diagnostic| *diagnostic))).ok()
}

/// A flat graph with the declarations of its types, its resolved wires and its step order.
pub(crate) struct Net<'a> {
    pub(crate) flat: &'a FlatGraph,
    pub(crate) catalogue: &'a Catalogue,
    /// The types of the roles of nodes that compute beside the tick.
    beside: &'a [RoleType],
    /// The type of each role; `None` if it is unknown.
    pub(crate) roles: Vec<Option<&'a RoleType>>,
    /// Index of each node's type in the catalogue, and its declaration; `None` if it is unknown.
    pub(crate) nodes: Vec<Option<(usize, &'a NodeSpec)>>,
    /// Roles that the bench binds for scenarios and recordings only: name and type.
    pub(crate) observed: Vec<(&'a Key, &'a RoleType)>,
    /// The resolved wires of each node.
    pub(crate) wires: Vec<Vec<Wire>>,
    /// The resolved wires of commands and reports.
    pub(crate) commands: Vec<CommandWire>,
    /// The nodes in the order in which they step.
    pub(crate) order: Vec<usize>,
    provenance: Provenance,
    /// For each node the arms whose motion passes through it.
    arms: Vec<Vec<usize>>,
    /// What modes set of each node and each part, by its full name.
    settings: BTreeMap<String, Vec<&'a Value>>,
    /// The modes of each task as ports.
    modes: Vec<TaskModes>,
    /// The ports of each scope by name, which only suggestions and views need.
    scope_ports: Vec<OnceCell<ScopePorts>>,
}

impl<'a> Net<'a> {
    /// Looks up all types, connects all wires and orders the nodes.
    pub(crate) fn new(
        flat: &'a FlatGraph,
        catalogue: &'a Catalogue,
        beside: &'a [RoleType],
        diagnostics: &mut Diagnostics,
    ) -> Self {
        let mut net = Self::declare(flat, catalogue, beside, diagnostics);
        net.wires = net.connect(diagnostics);
        net.commands = net.connect_commands(diagnostics);
        net.order = net.find_order(diagnostics);
        net.provenance = Provenance::new(&net);
        net.arms = net.find_arms();
        net
    }

    /// Returns whether a node reads a role or the arm that carries it, directly or not. A node that reads none may use
    /// the facts of any role.
    pub(crate) fn reads(&self, node: usize, role: &str) -> bool {
        let carrier = self.flat.roles.position(role).and_then(|role| self.carrier(role));
        // A sensor on an unknown arm has its own diagnostic.
        if carrier.is_none() && self.flat.carriers.get(role).is_some_and(|on| on.value != NO_ARM) {
            return true;
        }
        if self.flat.roles.position(role).is_some_and(|role| self.rival_carriers(role).is_some()) {
            return true;
        }
        let mut roles = self.roles_of(Producer::Node(node)).peekable();
        roles.peek().is_none() || roles.any(|read| self.name(Producer::Role(read)) == role || Some(read) == carrier)
    }

    /// Returns the arm that carries a sensor: the one that it names, or the only arm of the graph. An arm carries none.
    pub(crate) fn carrier(&self, sensor: usize) -> Option<usize> {
        let (key, _) = &self.flat.roles[sensor];
        if let Some(on) = self.flat.carriers.get(&key.name) {
            return self.flat.roles.position(&on.value).filter(|arm| *arm != sensor && self.is_arm(*arm));
        }
        self.only_arm(0..self.roles.len(), sensor).or_else(|| self.carriers_in_tasks(sensor).next().map(|(_, arm)| arm))
    }

    /// Returns the parts that have a sensor on their only arm, each with the arm.
    fn carriers_in_tasks(&self, sensor: usize) -> impl Iterator<Item = (usize, usize)> {
        let tasks = self.flat.tasks.iter().enumerate().skip(1).filter(move |(_, task)| task.roles.contains(&sensor));
        tasks.filter_map(move |(number, task)| Some((number, self.only_arm(task.roles.iter().copied(), sensor)?)))
    }

    /// Returns the only arm among some roles, unless it is the sensor itself.
    fn only_arm(&self, roles: impl Iterator<Item = usize>, sensor: usize) -> Option<usize> {
        let mut arms = roles.filter(|role| self.is_arm(*role));
        arms.next().filter(|arm| *arm != sensor && arms.next().is_none())
    }

    /// Returns two parts that have one sensor on different arms, each with its arm, if no file says which arm it is on.
    pub(crate) fn rival_carriers(&self, sensor: usize) -> Option<[(usize, usize); 2]> {
        let first = self.carriers_in_tasks(sensor).next()?;
        let second = self.carriers_in_tasks(sensor).find(|(_, arm)| *arm != first.1)?;
        let is_open = self.flat.carriers.get(&self.flat.roles[sensor].0.name).is_none();
        (is_open && !self.is_arm(sensor)).then_some([first, second])
    }

    /// Returns the role of the graph that a name means which is written at `at`, in a parameter of a node.
    pub(crate) fn role_at<'n>(&'n self, node: Option<usize>, name: &'n str, at: usize) -> &'n str {
        self.flat.role_at(node.map_or(0, |node| self.flat.nodes[node].scope), name, at)
    }

    /// Returns the words of the parameters with which a node names frames, such as the `sensor` of a pose.
    pub(crate) fn named_frames(&self, node: usize) -> Vec<&'a str> {
        let ports = self.spec(node).into_iter().flat_map(|spec| spec.inputs.iter().chain(&spec.outputs));
        let params: BTreeSet<&str> = ports.flat_map(frame_args).filter_map(|arg| arg.strip_prefix('$')).collect();
        let table = self.flat.nodes[node].block.params.as_table();
        let values = params.into_iter().filter_map(|param| table?.get(param));
        let role =
            |value: &'a Value| Some(self.flat.role_at(self.flat.nodes[node].scope, value.as_str()?, value.span.start));
        values.filter_map(role).collect()
    }

    /// Returns whether two tasks drive one command, which has its own diagnostic: then nothing is known about the arms
    /// that are meant.
    pub(crate) fn has_two_drivers(&self) -> bool {
        let mut seen = BTreeSet::new();
        let mut wires = self.commands.iter().map(|wire| (wire.role, wire.is_report, wire.command));
        !wires.all(|command| seen.insert(command))
    }

    /// Returns whether a role is commanded.
    pub(crate) fn is_arm(&self, role: usize) -> bool {
        self.roles[role].is_some_and(|role| !role.commands.is_empty())
    }

    /// Returns the roles whose samples a producer descends from.
    pub(crate) fn roles_of(&self, producer: Producer) -> impl Iterator<Item = usize> {
        self.provenance.roles(producer)
    }

    /// Returns a type of role by its name.
    pub(crate) fn role_type(&self, name: &str) -> Option<&'a RoleType> {
        self.catalogue.role_type(name).or_else(|| self.beside.iter().find(|role| role.name == name))
    }

    /// Returns whether a role is a node that computes beside the tick.
    pub(crate) fn is_beside(&self, role: usize) -> bool {
        self.beside.iter().any(|known| known.name == self.flat.roles[role].1.value)
    }

    /// Returns the declaration of a node, or `None` if its type is unknown.
    pub(crate) fn spec(&self, node: usize) -> Option<&'a NodeSpec> {
        self.nodes[node].map(|(_, spec)| spec)
    }

    /// Returns whether a wire of a node is missing or has a mistake, so that what follows from it is unknown.
    pub(crate) fn lacks_wires(&self, node: usize) -> bool {
        let (given, found) = (&self.flat.nodes[node].block.wires, &self.wires[node]);
        let inputs = self.spec(node).map_or(&[][..], |spec| &spec.inputs);
        let is_open = |i: usize| inputs[i].need.must_be_wired && !found.iter().any(|wire| wire.input == i);
        given.has_invalid() || given.valid.len() != found.len() || (0..inputs.len()).any(is_open)
    }

    /// Returns whether the author of the graph chooses the names of the wires into a node.
    pub(crate) fn takes_any_wire(&self, node: usize) -> bool {
        self.spec(node).is_some_and(|spec| spec.inputs.iter().any(|input| input.need.is_many))
    }

    /// Returns the declaration of the input at the end of a wire.
    pub(crate) fn input(&self, node: usize, wire: &Wire) -> &'a PortSpec {
        &self.spec(node).expect("only known nodes have wires").inputs[wire.input]
    }

    /// Returns the declared outputs of a producer, or `None` if its type is unknown.
    pub(crate) fn outputs(&self, producer: Producer) -> Option<&[PortSpec]> {
        match producer {
            Producer::Role(i) => self.roles[i].map(|role| role.outputs.as_slice()),
            Producer::Node(i) => self.spec(i).map(|spec| spec.outputs.as_slice()),
            Producer::Task(i) => Some(&self.modes[i].ports),
        }
    }

    /// Returns the full name of a producer.
    pub(crate) fn name(&self, producer: Producer) -> &str {
        match producer {
            Producer::Role(i) => &self.flat.roles[i].0.name,
            Producer::Node(i) => &self.flat.nodes[i].name,
            Producer::Task(i) => &self.modes[i].name,
        }
    }

    /// Returns where a producer is declared.
    pub(crate) fn place(&self, producer: Producer) -> Range<usize> {
        match producer {
            Producer::Role(i) => self.flat.roles[i].0.span.clone(),
            Producer::Node(i) => self.flat.nodes[i].block.key.span.clone(),
            Producer::Task(i) => self.flat.tasks[i].place.clone(),
        }
    }

    /// Creates a diagnostic about a node. For a node in a part it is at the part in the graph file.
    pub(crate) fn diagnostic_at(&self, node: usize, code: Code, message: String) -> Diagnostic {
        let own = self.place(Producer::Node(node));
        match self.part_of(node) {
            Some(part) => Diagnostic::new(code, part.span.clone(), message).note(own, "the part has it here"),
            None => Diagnostic::new(code, own, message),
        }
    }

    /// Returns the part of the file of its task that contains a node, or `None` for a node of that file itself.
    pub(crate) fn part_of(&self, node: usize) -> Option<&'a Key> {
        let task = self.task_of(node);
        let (part, _) = self.flat.nodes[node].name[task.prefix.len()..].split_once('.')?;
        self.flat.scopes[task.scope].names.get(part).map(|(key, _)| key)
    }

    /// Returns the innermost task around a node.
    pub(crate) fn task_of(&self, node: usize) -> &'a Task {
        &self.flat.tasks[self.flat.scopes[self.flat.nodes[node].scope].task]
    }

    /// Returns the declaration of the command or report at the end of a wire.
    pub(crate) fn command_port(&self, wire: &CommandWire) -> &PortSpec {
        let role = self.roles[wire.role].expect("only known roles have commands");
        &(if wire.is_report { &role.reports } else { &role.commands })[wire.command]
    }

    /// Formats the end of a command wire as `role.command`.
    pub(crate) fn command_name(&self, wire: &CommandWire) -> String {
        format!("{}.{}", self.name(Producer::Role(wire.role)), self.command_port(wire).name)
    }

    /// Returns the declaration of the port at the start of a wire.
    pub(crate) fn port(&self, source: PortRef) -> &PortSpec {
        &self.outputs(source.producer).expect("a wire comes from a known port")[source.port]
    }

    /// Formats a port as `node.port`.
    pub(crate) fn port_name(&self, source: PortRef) -> String {
        format!("{}.{}", self.name(source.producer), self.port(source).name)
    }

    /// Returns the tables of parameters that modes set of a node.
    pub(crate) fn settings_of(&self, node: usize) -> impl Iterator<Item = &'a Value> {
        let flat = &self.flat.nodes[node];
        let around = self.flat.tasks_around(flat.scope).map(|task| self.flat.tasks[task].prefix.len());
        around.flat_map(move |start| {
            let mut path = flat.name[start..].split('.');
            let first = path.next().map_or(0, str::len);
            let tables = self.settings.get(&flat.name[..start + first]).into_iter().flatten();
            tables.filter_map(move |table| path.clone().try_fold(*table, |value, name| value.as_table()?.get(name)))
        })
    }

    /// Returns the table of parameters that a mode sets of a node.
    pub(crate) fn setting(&self, mode: usize, node: usize) -> Option<&'a Value> {
        let block = &self.flat.modes[mode];
        let mut path = self.flat.nodes[node].name.strip_prefix(&self.flat.tasks[block.task].prefix)?.split('.');
        let first = block.set.get(path.next()?)?;
        path.try_fold(first, |value, name| value.as_table()?.get(name))
    }

    /// Marks the given nodes and all nodes upstream of them, and goes no further where a node is marked.
    pub(crate) fn mark_upstream(&self, nodes: impl IntoIterator<Item = usize>, marked: &mut [bool]) {
        let mut open: Vec<usize> = nodes.into_iter().collect();
        while let Some(node) = open.pop() {
            if !std::mem::replace(&mut marked[node], true) {
                open.extend(self.wires[node].iter().filter_map(|wire| wire.source.producer.node()));
            }
        }
    }

    /// Returns for each node whether it is one of the given ones or upstream of them.
    pub(crate) fn upstream(&self, nodes: impl IntoIterator<Item = usize>) -> Vec<bool> {
        let mut marked = vec![false; self.wires.len()];
        self.mark_upstream(nodes, &mut marked);
        marked
    }

    /// Returns for each node whether a node reads one of its outputs.
    pub(crate) fn read_nodes(&self) -> Vec<bool> {
        let mut is_read = vec![false; self.wires.len()];
        for source in self.wires.iter().flatten().filter_map(|wire| wire.source.producer.node()) {
            is_read[source] = true;
        }
        is_read
    }
}
