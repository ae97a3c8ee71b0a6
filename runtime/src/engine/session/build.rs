//! From a plan to an engine: everything that a tick touches is allocated here, once.

use std::collections::BTreeMap;
use std::ops::Range;

use super::engine::{Engine, Logged, View};
use super::halt::Halts;
use super::timeline::Timeline;
use super::trouble::WatchedWire;
use crate::device::{Commands, Driver, Samples};
use crate::engine::core::{Aged, CommandSlot, Core, DeviceSlot, Inlet, Link, Modes, NodeRunner, ReportSlot, Timing};
use crate::graph::{
    AgeLimit, Compiled, PlannedCommand, PlannedDevice, PlannedNode, PlannedPort, PlannedReport, PlannedShow,
    PlannedView, PlannedWire, Policy, PortRef, Producer,
};
use crate::node::{Bus, PortId, Tick};
use crate::signal::{Mark, Shape, Stamp};
use crate::source::SourceMap;

/// Where every port is.
type Ids = BTreeMap<PortRef, PortId>;

impl Engine {
    /// Allocates everything that the plan needs; nothing allocates in a tick.
    #[must_use]
    pub fn new(compiled: Compiled) -> Self {
        let Compiled { plan, view: shown, sources, .. } = compiled;
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
        let view = view(shown, &ids, &ports);
        let limits = limits(&plan.nodes, &ports);
        let mut watched = watched_ends(&plan.commands, &plan.reports, &ids);
        let slot = |command: PlannedCommand| CommandSlot::new(ids[&command.source], command);
        let slots = plan.commands.into_iter().map(slot).collect();
        let tell = |report: &PlannedReport| ReportSlot::new(ids[&report.source], report);
        let told = plan.reports.iter().map(tell).collect();
        let shape = |(device, report): (usize, usize)| {
            let planned = plan.reports.iter().find(|planned| (planned.device, planned.report) == (device, report));
            planned.map(|planned| &planned.shape)
        };
        let devices = plan.devices.into_iter().enumerate();
        let devices = devices.map(|(i, device)| device_slot(device, |report| shape((i, report)), &sources)).collect();
        let runners = plan.nodes.into_iter().map(|node| runner(node, &ids, &mut bus, &mut watched));
        let runners: Vec<NodeRunner> = runners.collect();
        let (max_gap, reset_after) = (plan.max_gap, plan.reset_after);
        let tick = Tick { index: 0, now: 0, dt: 0.0, stamp: Stamp::TIMELESS, max_gap, reset_after, is_halted: false };
        let (timing, mut core) = (Timing::new(runners.len()), Core::new(bus, runners, inlets, (slots, told), tick));
        let kind = |id: PortId| ports.iter().find(|(_, known)| *known == id).map(|(port, _)| port.shape.kind());
        let modes = plan.modes.map(|modes| {
            let kinds = ids.iter().map(|(source, id)| (*source, (*id, kind(*id).expect("a port has a kind"))));
            Modes::new(modes, &kinds.collect())
        });
        modes.iter().for_each(|modes| core.switch(modes.configurations()));
        Self {
            timing,
            core,
            modes,
            is_done: false,
            devices,
            timeline: Timeline::new(plan.clock, plan.period),
            ports,
            logged,
            view,
            limits,
            names,
            roles,
            policy: plan.policy,
            halts: Halts::new(),
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

fn view(view: PlannedView, ids: &Ids, ports: &[(PlannedPort, PortId)]) -> View {
    let port = |PlannedShow { name, source }: PlannedShow| {
        let id = ids[&source];
        let (port, _) = ports.iter().find(|(_, known)| *known == id).expect("what is shown is a port");
        (name, port.clone(), id)
    };
    View { ports: view.ports.into_iter().map(port).collect(), mark: view.mark.map(|mark| mark.map(|at| ids[&at])) }
}

/// The shares that the limiters tell.
fn limits(nodes: &[PlannedNode], ports: &[(PlannedPort, PortId)]) -> Vec<(String, PortId)> {
    let is_share =
        |name: &str| nodes.iter().any(|node| node.holds.iter().any(|limit| name == format!("{}.{limit}", node.name)));
    let shares = ports.iter().filter(|(port, _)| is_share(&port.name));
    shares.map(|(port, id)| (port.name.clone(), *id)).collect()
}

fn device_slot<'s>(
    device: PlannedDevice,
    report: impl Fn(usize) -> Option<&'s Shape>,
    sources: &SourceMap,
) -> DeviceSlot {
    let commands = Commands::with_shapes(device.commands.iter());
    DeviceSlot {
        place: sources.locate(device.span.start),
        name: device.name,
        samples: Samples::with_shapes(device.outputs.iter()),
        commands: (0..device.reports).fold(commands, |commands, i| commands.with_report(report(i))),
        link: match device.driver {
            Driver::Stepped(driver) => Link::Stepped(driver),
            Driver::Live(driver) => Link::Idle(driver),
        },
        failed: None,
    }
}

/// The commands and reports whose age does more than that they ramp to zero or fall silent.
fn watched_ends(commands: &[PlannedCommand], reports: &[PlannedReport], ids: &Ids) -> Vec<WatchedWire> {
    let commands = commands.iter().map(|wire| (wire.source, &wire.name, wire.age, &wire.span));
    let ends = commands.chain(reports.iter().map(|wire| (wire.source, &wire.name, wire.age, &wire.span)));
    ends.filter_map(|(source, name, age, span)| watched_end(name, age, span, ids[&source])).collect()
}

/// A command or a report whose age does more than that it ramps to zero or falls silent.
fn watched_end(name: &[String; 2], age: AgeLimit, span: &Range<usize>, id: PortId) -> Option<WatchedWire> {
    let (AgeLimit { max_age, stale }, [role, name]) = (age, name.clone());
    // Its slot looks at the mark itself.
    let aged = Aged { from: id.mark, to: id.mark, max_age };
    let watched = WatchedWire { aged, stale, node: role, port: Some(name), span: span.clone() };
    (stale > Policy::Hold).then_some(watched)
}

/// A node in its place. A wire that may grow only so old has a mark of its own, and shares the value.
fn runner(node: PlannedNode, ids: &Ids, bus: &mut Bus, watched: &mut Vec<WatchedWire>) -> NodeRunner {
    let mut aged = Vec::new();
    let mut end = |wire: &PlannedWire| {
        let id = ids[&wire.source];
        let Some(AgeLimit { max_age, stale }) = wire.age else { return id };
        bus.marks.push(Mark::default());
        let to = bus.marks.len() as u32 - 1;
        aged.push(Aged { from: id.mark, to, max_age });
        if stale > Policy::Hold {
            let (aged, span) = (Aged { from: id.mark, to, max_age }, wire.span.clone());
            watched.push(WatchedWire { aged, stale, node: node.name.clone(), port: None, span });
        }
        PortId { mark: to, ..id }
    };
    let inputs: Vec<_> =
        node.inputs.iter().map(|(need, wires)| (*need, wires.iter().map(&mut end).collect())).collect();
    let outputs = (0..node.ports.len()).map(|port| ids[&PortRef { producer: Producer::Node(node.index), port }]);
    NodeRunner::new(node.node, &inputs, outputs.collect(), node.is_every_tick).with_aged(aged)
}
