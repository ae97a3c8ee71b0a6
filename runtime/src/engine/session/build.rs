//! Builds an engine from a plan. Everything that a tick uses is allocated here, once.

use std::collections::{BTreeMap, BTreeSet};

use super::engine::{DisplayedPort, Engine, Logged};
use super::live_values::LiveValues;
use super::punctuality::Punctuality;
use super::schedule::TickSchedule;
use super::task_run::TaskRun;
use super::trouble::{Origin, WatchedBudget, WatchedFailure, WatchedWire};
use crate::device::{Commands, Driver, Samples};
use crate::engine::core::{
    AgedWire, CommandSlot, Core, DeviceLink, DeviceSlot, Inlet, ModeMachine, NodeRunner, ReportSlot, TaskTick, Timing,
};
use crate::graph::{
    AgeLimit, Compiled, Plan, PlannedCommand, PlannedDevice, PlannedNode, PlannedPort, PlannedShow, PlannedTask,
    PlannedView, PlannedWire, Policy, PortRef, Producer,
};
use crate::node::{Bus, PortId};
use crate::signal::{Mark, Shape};
use crate::source::SourceMap;

/// The ports of a graph on its bus.
#[derive(Default)]
struct BusPorts {
    bus: Bus,
    list: Vec<(PlannedPort, PortId)>,
    /// Index of each port in `list`.
    index: BTreeMap<PortRef, usize>,
}

impl BusPorts {
    /// Adds the ports of a plan, and returns them with an inlet for each port of a role.
    fn of(plan: &Plan) -> (Self, Vec<Inlet>) {
        let (mut ports, mut inlets) = (Self::default(), Vec::new());
        for (i, role) in plan.roles.iter().enumerate() {
            for (port, planned) in role.ports.iter().enumerate() {
                let id = ports.add(PortRef { producer: Producer::Role(i), port }, planned);
                let driver = &plan.devices[role.device].driver;
                let is_live =
                    matches!(driver, Driver::Live(_) | Driver::Beside { .. } | Driver::Recorded { is_live: true });
                let mut inlet = Inlet::new(i, role, port, id, is_live);
                if plan.devices[role.device].description.may_return {
                    inlet.returns = behind(plan, PortRef { producer: Producer::Role(i), port }, planned);
                }
                inlets.push(inlet);
            }
        }
        for (source, planned) in plan.nodes.iter().flat_map(PlannedNode::outputs) {
            ports.add(source, planned);
        }
        for (_, source, planned) in plan.tasks.iter().flat_map(|task| &task.flags) {
            ports.add(*source, planned);
        }
        (ports, inlets)
    }

    fn add(&mut self, source: PortRef, planned: &PlannedPort) -> PortId {
        let id = self.bus.add(&planned.shape);
        self.index.insert(source, self.list.len());
        self.list.push((planned.clone(), id));
        id
    }

    fn get(&self, source: PortRef) -> &(PlannedPort, PortId) {
        &self.list[self.index[&source]]
    }

    fn id(&self, source: PortRef) -> PortId {
        self.get(source).1
    }
}

/// Returns the runners of the nodes that read a port of a role, directly or through nodes that pass on the same kind: a
/// flag that is computed from an image is not that image.
fn behind(plan: &Plan, source: PortRef, port: &PlannedPort) -> Box<[usize]> {
    let (kind, mut reached, mut runners) = (port.shape.kind(), BTreeSet::from([source]), Vec::new());
    for (runner, node) in plan.nodes.iter().enumerate() {
        let mut wires = node.inputs.iter().flat_map(|(_, wires)| wires);
        if wires.any(|wire| reached.contains(&wire.source)) {
            runners.push(runner);
            let outputs = node.outputs().filter(|(_, output)| output.shape.kind() == kind);
            reached.extend(outputs.map(|(source, _)| source));
        }
    }
    runners.into()
}

impl Engine {
    /// Creates the engine of a compiled graph. Ticks do not allocate.
    #[must_use]
    pub fn new(compiled: Compiled) -> Self {
        let Compiled { plan, view, sources, exports, recorded, .. } = compiled;
        let (mut ports, inlets) = BusPorts::of(&plan);
        let logged = plan.nodes.iter().filter(|node| node.is_logged).map(|node| logged(node, &ports)).collect();
        let place = |device: usize| sources.locate(plan.devices[device].span.start);
        let roles = plan.roles.iter().map(|role| (role.name.clone(), place(role.device))).collect();
        let names = plan.nodes.iter().map(|node| (node.name.clone(), sources.locate(node.span.start))).collect();
        let mut owners: Vec<usize> = plan.nodes.iter().map(|node| node.task).collect();
        owners.retain(|_| plan.tasks.len() > 1);
        let writers = writers(&plan);
        let device_roles = device_roles(&plan);
        let limits = limits(&plan.nodes, &ports);
        let budgets = budgets(&plan.nodes, &ports);
        let failures = failures(&plan.nodes, &ports);
        let uncalibrated =
            plan.nodes.iter().filter(|node| node.is_uncalibrated).map(|node| node.name.clone()).collect();
        let mut watched = watched_commands(&plan.commands, &ports);
        let (devices, reports) = (plan.devices.into_iter().enumerate(), report_shapes(&plan.commands));
        let devices = devices.map(|(i, device)| device_slot(i, device, &reports, &sources)).collect();
        let runners: Vec<NodeRunner> =
            plan.nodes.into_iter().enumerate().map(|node| runner(node, &mut ports, &mut watched)).collect();
        let commanded = commanded(&plan.commands);
        let commands = plan.commands.iter().filter(|wire| !wire.is_report);
        let drivers = commands.map(|wire| (wire.task, wire.tasks.clone())).collect();
        let (reports, commands): (Vec<_>, Vec<_>) = plan.commands.into_iter().partition(|wire| wire.is_report);
        let report = |report: &PlannedCommand| ReportSlot::new(ports.id(report.source), report);
        let slots = reports.iter().map(report).collect();
        let reported = reports.into_iter().map(|report| (report.name.join("."), report.device, report.port)).collect();
        let commands =
            commands.into_iter().map(|command| CommandSlot::new(ports.id(command.source), command)).collect();
        let display = display(view, &ports);
        let contexts = plan.tasks.iter().map(task_tick).collect();
        let tasks: Vec<TaskRun> = plan.tasks.into_iter().map(|task| task_run(task, &ports)).collect();
        let timing = Timing::new(runners.len());
        let mut core = Core::new(ports.bus, (runners, owners), inlets, (commands, slots), contexts);
        tasks.iter().filter_map(|task| task.modes.as_ref()).for_each(|modes| core.switch(modes.configurations()));
        Self {
            timing,
            core,
            tasks,
            reach: plan.reach,
            device_roles,
            writers,
            devices,
            schedule: TickSchedule::new(plan.clock, plan.period),
            ports: ports.list,
            logged,
            display,
            limits,
            uncalibrated,
            budgets,
            failures,
            rests: Vec::new(),
            allowed: plan.allowed,
            names,
            roles,
            drivers,
            commanded,
            reported,
            exports,
            watched,
            panic: String::new(),
            late: 0,
            lateness: None,
            punctuality: Punctuality::default(),
            live: LiveValues::new(plan.live),
            inputs: None,
            recorded,
            replayed: None,
            sources,
        }
    }
}

/// Returns the roles that each device fills.
fn device_roles(plan: &Plan) -> Vec<Vec<usize>> {
    let mut roles = vec![Vec::new(); plan.devices.len()];
    plan.roles.iter().enumerate().for_each(|(i, role)| roles[role.device].push(i));
    roles
}

/// Returns the roles that are commanded, each once.
fn commanded(commands: &[PlannedCommand]) -> Vec<String> {
    let mut roles: Vec<String> =
        commands.iter().filter(|wire| !wire.is_report).map(|wire| wire.name[0].clone()).collect();
    roles.dedup();
    roles
}

/// Returns the shape of each wired report, by its device and its number there.
fn report_shapes(commands: &[PlannedCommand]) -> BTreeMap<(usize, usize), &Shape> {
    let reports = commands.iter().filter(|wire| wire.is_report);
    reports.map(|wire| ((wire.device, wire.port), &wire.shape)).collect()
}

fn logged(node: &PlannedNode, ports: &BusPorts) -> Logged {
    let wires = node.inputs.iter().flat_map(|(_, wires)| wires);
    let due = ports.id(PortRef { producer: Producer::Node(node.index), port: 0 });
    Logged { node: node.name.clone(), due, inputs: wires.map(|wire| ports.get(wire.source).clone()).collect() }
}

fn display(view: PlannedView, ports: &BusPorts) -> Vec<DisplayedPort> {
    let port = |PlannedShow { name, source, mark }: PlannedShow| {
        let (port, id) = ports.get(source).clone();
        DisplayedPort { name, port, id, mark: mark.map(|mark| mark.map(|source| ports.id(source))) }
    };
    view.ports.into_iter().map(port).collect()
}

/// Returns the index of the runner that writes each port, in the order of the ports on the bus.
fn writers(plan: &Plan) -> Vec<Option<usize>> {
    let roles = plan.roles.iter().flat_map(|role| &role.ports).map(|_| None);
    let nodes = plan.nodes.iter().enumerate().flat_map(|(runner, node)| vec![Some(runner); node.ports.len()]);
    let flags = plan.tasks.iter().flat_map(|task| &task.flags).map(|_| None);
    roles.chain(nodes).chain(flags).collect()
}

fn task_tick(task: &PlannedTask) -> TaskTick {
    TaskTick { max_gap: task.max_gap, reset_after: task.reset_after, is_halted: false, is_resumed: false }
}

fn task_run(mut task: PlannedTask, ports: &BusPorts) -> TaskRun {
    let port = |source: PortRef| {
        let (port, id) = ports.get(source);
        (*id, port.shape.kind())
    };
    let modes = task.modes.take().map(|modes| ModeMachine::new(modes, port));
    let flags = task.flags.iter().map(|(mode, source, _)| (*mode, ports.id(*source))).collect();
    TaskRun::new(task, modes, flags)
}

/// Returns the ports on which limit nodes report the scale of the motion.
fn limits(nodes: &[PlannedNode], ports: &BusPorts) -> Vec<(String, PortId)> {
    let scales = nodes.iter().flat_map(|node| {
        let is_scale = |name: &str| node.holds.iter().any(|limit| name == format!("{}.{limit}", node.name));
        node.outputs().filter(move |(_, port)| is_scale(&port.name))
    });
    scales.map(|(source, port)| (port.name.clone(), ports.id(source))).collect()
}

/// Returns the budgets of the limiters.
fn budgets(nodes: &[PlannedNode], ports: &BusPorts) -> Vec<WatchedBudget> {
    let budget = |(runner, node): (usize, &PlannedNode)| {
        let (port, role) = node.budget.clone()?;
        let flag = ports.id(PortRef { producer: Producer::Node(node.index), port });
        Some(WatchedBudget { role, runner, flag, is_spent: false })
    };
    nodes.iter().enumerate().filter_map(budget).collect()
}

/// Returns the nodes that can end their task.
fn failures(nodes: &[PlannedNode], ports: &BusPorts) -> Vec<WatchedFailure> {
    let failure = |(runner, node): (usize, &PlannedNode)| {
        let flag = ports.id(PortRef { producer: Producer::Node(node.index), port: node.fails? });
        Some(WatchedFailure { runner, flag })
    };
    nodes.iter().enumerate().filter_map(failure).collect()
}

/// `reports` holds the shape of each wired report, by its device and its number there.
fn device_slot(
    i: usize,
    device: PlannedDevice,
    reports: &BTreeMap<(usize, usize), &Shape>,
    sources: &SourceMap,
) -> DeviceSlot {
    let wired = |report: usize| reports.get(&(i, report)).copied();
    let (link, in_real_time) = match device.driver {
        Driver::Stepped(driver) | Driver::Lockstep(driver) => (DeviceLink::Stepped(driver), None),
        Driver::Beside { stepped, live } => (DeviceLink::Stepped(stepped), Some(live)),
        Driver::Live(driver) => (DeviceLink::Idle(driver), None),
        Driver::Recorded { is_live } => (DeviceLink::Recorded { is_live }, None),
    };
    DeviceSlot {
        place: sources.locate(device.span.start),
        name: device.name,
        samples: Samples::of(&device.description),
        commands: Commands::with_reports(&device.description, wired),
        description: device.description,
        link,
        is_beside: in_real_time.is_some(),
        in_real_time,
        failed: None,
        pause: DeviceSlot::FIRST_PAUSE,
        writes_at_start: 0,
        has_rested: false,
        lease_lost: None,
        refusal: None,
    }
}

/// Returns the commands and reports that stop the run, or halt every command, when they are too old.
fn watched_commands(commands: &[PlannedCommand], ports: &BusPorts) -> Vec<WatchedWire> {
    let strict = commands.iter().filter(|command| command.age.stale > Policy::Hold);
    let watched =
        strict.map(|PlannedCommand { source, task, age: AgeLimit { max_age, stale }, name, span, .. }| {
            // The slot of a command or report checks the age itself, so the wire needs no mark of its own.
            let (mark, [role, name]) = (ports.id(*source).mark, name.clone());
            let aged = AgedWire { from: mark, to: mark, max_age: *max_age };
            let origin = Origin::Task(*task);
            WatchedWire { aged, stale: *stale, node: role, port: Some(name), span: span.clone(), origin }
        });
    watched.collect()
}

/// Creates the runner of a node. A wire with a maximum age gets a mark of its own and shares the value.
fn runner((i, node): (usize, PlannedNode), ports: &mut BusPorts, watched: &mut Vec<WatchedWire>) -> NodeRunner {
    let outputs = node.outputs().map(|(source, _)| ports.id(source)).collect();
    let mut aged = Vec::new();
    let mut end = |wire: &PlannedWire| {
        let id = ports.id(wire.source);
        let Some(AgeLimit { max_age, stale }) = wire.age else { return id };
        let marks = &mut ports.bus.marks;
        marks.push(Mark::default());
        let to = marks.len() as u32 - 1;
        let wire_end = AgedWire { from: id.mark, to, max_age };
        aged.push(wire_end);
        if stale > Policy::Hold {
            let (node, span) = (node.name.clone(), wire.span.clone());
            let origin = Origin::Runner(i);
            watched.push(WatchedWire { aged: wire_end, stale, node, port: None, span, origin });
        }
        PortId { mark: to, ..id }
    };
    let inputs: Vec<_> =
        node.inputs.iter().map(|(need, wires)| (*need, wires.iter().map(&mut end).collect())).collect();
    NodeRunner::new(node.node, &inputs, outputs, node.is_every_tick).with_aged(aged)
}
