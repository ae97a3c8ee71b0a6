//! Builds an engine from a plan. Everything that a tick uses is allocated here, once.

use std::collections::BTreeMap;
use std::ops::Range;

use super::engine::{Display, Engine, Logged};
use super::halt::HaltMachine;
use super::schedule::TickSchedule;
use super::trouble::WatchedWire;
use crate::device::{Commands, Driver, Samples};
use crate::engine::core::{
    AgedWire, CommandSlot, Core, DeviceSlot, Inlet, Link, ModeMachine, NodeRunner, ReportSlot, Timing,
};
use crate::graph::{
    AgeLimit, Compiled, PlannedCommand, PlannedDevice, PlannedNode, PlannedPort, PlannedReport, PlannedShow,
    PlannedView, PlannedWire, Policy, PortRef, Producer,
};
use crate::node::{Bus, PortId, Tick};
use crate::signal::{Mark, Stamp};
use crate::source::SourceMap;

/// The bus port of every output.
type Ids = BTreeMap<PortRef, PortId>;

impl Engine {
    /// Creates the engine of a compiled graph. Ticks do not allocate.
    #[must_use]
    pub fn new(compiled: Compiled) -> Self {
        let Compiled { plan, view, sources, exports, .. } = compiled;
        let (mut bus, mut ids, mut ports, mut inlets) = (Bus::default(), Ids::new(), Vec::new(), Vec::new());
        let mut add = |source: PortRef, planned: &PlannedPort| {
            let id = bus.add(&planned.shape);
            ids.insert(source, id);
            ports.push((planned.clone(), id));
            id
        };
        for (i, role) in plan.roles.iter().enumerate() {
            for (port, planned) in role.ports.iter().enumerate() {
                let id = add(PortRef { producer: Producer::Role(i), port }, planned);
                inlets.push(Inlet::new(role, port, id));
            }
        }
        for node in &plan.nodes {
            for (port, planned) in node.ports.iter().enumerate() {
                add(PortRef { producer: Producer::Node(node.index), port }, planned);
            }
        }
        let logged = plan.nodes.iter().filter(|node| node.is_logged).map(|node| logged(node, &ids, &ports)).collect();
        let place = |device: usize| sources.locate(plan.devices[device].span.start);
        let roles = plan.roles.iter().map(|role| (role.name.clone(), place(role.device))).collect();
        let names = plan.nodes.iter().map(|node| (node.name.clone(), sources.locate(node.span.start))).collect();
        let display = display(view, &ids, &ports);
        let limits = limits(&plan.nodes, &ports);
        let mut watched = watched_ends(&plan.commands, &plan.reports, &ids);
        let slot = |command: PlannedCommand| CommandSlot::new(ids[&command.source], command);
        let commands = plan.commands.into_iter().map(slot).collect();
        let slot = |report: &PlannedReport| ReportSlot::new(ids[&report.source], report);
        let reports = plan.reports.iter().map(slot).collect();
        let reported = reported(&plan.reports);
        let devices = plan.devices.into_iter().enumerate();
        let devices = devices.map(|(i, device)| device_slot(i, device, &plan.reports, &sources)).collect();
        let runners = plan.nodes.into_iter().map(|node| runner(node, &ids, &mut bus, &mut watched));
        let runners: Vec<NodeRunner> = runners.collect();
        let (max_gap, reset_after) = (plan.max_gap, plan.reset_after);
        let tick = Tick { index: 0, now: 0, dt: 0.0, stamp: Stamp::TIMELESS, max_gap, reset_after, is_halted: false };
        let timing = Timing::new(runners.len());
        let mut core = Core::new(bus, runners, inlets, (commands, reports), tick);
        let kind = |id: PortId| ports.iter().find(|(_, known)| *known == id).map(|(port, _)| port.shape.kind());
        let modes = plan.modes.map(|modes| {
            let kinds = ids.iter().map(|(source, id)| (*source, (*id, kind(*id).expect("a port has a kind"))));
            ModeMachine::new(modes, &kinds.collect())
        });
        modes.iter().for_each(|modes| core.switch(modes.configurations()));
        Self {
            timing,
            core,
            modes,
            is_done: false,
            devices,
            schedule: TickSchedule::new(plan.clock, plan.period),
            ports,
            logged,
            display,
            limits,
            names,
            roles,
            reported,
            exports,
            policy: plan.policy,
            halts: HaltMachine::new(),
            trouble: None,
            watched,
            panic: String::new(),
            sent: None,
            late: 0,
            lateness: None,
            sources,
        }
    }
}

fn logged(node: &PlannedNode, ids: &Ids, ports: &[(PlannedPort, PortId)]) -> Logged {
    let sources = node.inputs.iter().flat_map(|(_, wires)| wires).map(|wire| ids[&wire.source]);
    let port = |id: PortId| ports.iter().find(|(_, known)| *known == id).expect("a wire comes from a port").clone();
    let due = ids[&PortRef { producer: Producer::Node(node.index), port: 0 }];
    Logged { node: node.name.clone(), due, inputs: sources.map(port).collect() }
}

fn display(view: PlannedView, ids: &Ids, ports: &[(PlannedPort, PortId)]) -> Display {
    let port = |PlannedShow { name, source }: PlannedShow| {
        let id = ids[&source];
        let (port, _) = ports.iter().find(|(_, known)| *known == id).expect("the check resolved every shown port");
        (name, port.clone(), id)
    };
    let contact = view.mark.map(|mark| mark.map(|at| ids[&at]));
    Display { ports: view.ports.into_iter().map(port).collect(), contact }
}

/// Returns the ports on which limit nodes report the scale of the motion.
fn limits(nodes: &[PlannedNode], ports: &[(PlannedPort, PortId)]) -> Vec<(String, PortId)> {
    let is_scale =
        |name: &str| nodes.iter().any(|node| node.holds.iter().any(|limit| name == format!("{}.{limit}", node.name)));
    let scales = ports.iter().filter(|(port, _)| is_scale(&port.name));
    scales.map(|(port, id)| (port.name.clone(), *id)).collect()
}

/// Each report that is wired, with its device and its number there.
fn reported(reports: &[PlannedReport]) -> Vec<(String, usize, usize)> {
    reports.iter().map(|planned| (planned.name.join("."), planned.device, planned.report)).collect()
}

fn device_slot(i: usize, device: PlannedDevice, reports: &[PlannedReport], sources: &SourceMap) -> DeviceSlot {
    let wired = |report: usize| {
        let planned = reports.iter().find(|planned| (planned.device, planned.report) == (i, report));
        planned.map(|planned| &planned.shape)
    };
    DeviceSlot {
        place: sources.locate(device.span.start),
        name: device.name,
        samples: Samples::of(&device.description),
        commands: Commands::with_reports(&device.description, wired),
        link: match device.driver {
            Driver::Stepped(driver) => Link::Stepped(driver),
            Driver::Live(driver) => Link::Idle(driver),
        },
        failed: None,
    }
}

/// Returns the commands and reports that stop the run, or halt every command, when they are too old.
fn watched_ends(commands: &[PlannedCommand], reports: &[PlannedReport], ids: &Ids) -> Vec<WatchedWire> {
    let commands = commands.iter().map(|wire| (wire.source, &wire.name, wire.age, &wire.span));
    let ends = commands.chain(reports.iter().map(|wire| (wire.source, &wire.name, wire.age, &wire.span)));
    ends.filter_map(|(source, name, age, span)| watched_end(name, age, span, ids[&source])).collect()
}

fn watched_end(name: &[String; 2], age: AgeLimit, span: &Range<usize>, id: PortId) -> Option<WatchedWire> {
    let (AgeLimit { max_age, stale }, [role, name]) = (age, name.clone());
    // The slot of a command or report checks the age itself, so the wire needs no mark of its own.
    let aged = AgedWire { from: id.mark, to: id.mark, max_age };
    let watched = WatchedWire { aged, stale, node: role, port: Some(name), span: span.clone() };
    (stale > Policy::Hold).then_some(watched)
}

/// Creates the runner of a node. A wire with a maximum age gets a mark of its own and shares the value.
fn runner(node: PlannedNode, ids: &Ids, bus: &mut Bus, watched: &mut Vec<WatchedWire>) -> NodeRunner {
    let mut aged = Vec::new();
    let mut end = |wire: &PlannedWire| {
        let id = ids[&wire.source];
        let Some(AgeLimit { max_age, stale }) = wire.age else { return id };
        bus.marks.push(Mark::default());
        let to = bus.marks.len() as u32 - 1;
        aged.push(AgedWire { from: id.mark, to, max_age });
        if stale > Policy::Hold {
            let (aged, span) = (AgedWire { from: id.mark, to, max_age }, wire.span.clone());
            watched.push(WatchedWire { aged, stale, node: node.name.clone(), port: None, span });
        }
        PortId { mark: to, ..id }
    };
    let inputs: Vec<_> =
        node.inputs.iter().map(|(need, wires)| (*need, wires.iter().map(&mut end).collect())).collect();
    let outputs = (0..node.ports.len()).map(|port| ids[&PortRef { producer: Producer::Node(node.index), port }]);
    NodeRunner::new(node.node, &inputs, outputs.collect(), node.is_every_tick).with_aged(aged)
}
