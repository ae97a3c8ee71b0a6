//! How a plan runs. [`Engine`] holds everything that a tick touches; the tick itself (`tick`: latch, step, commit) and
//! what it is made of (`station`, `inlet`, `command`) name no lock, no clock and no tokio. `timeline` says when the
//! next tick is; `shell` is the edge to real time, to live devices and to the operator.

mod command;
mod inlet;
mod modes;
mod shell;
mod station;
mod tick;
mod timeline;

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::device::{Commands, DeviceError, Driver, Linked, Live, Samples, Stepped};
use crate::fault::{Cause, Fault};
use crate::graph::{Plan, PlannedPort, Producer, Source, Sources};
use crate::node::{Bus, PortId, Tick};
use crate::signal::Stamp;
use command::CommandSlot;
use inlet::Inlet;
use modes::{Modes, Verdict};
use timeline::Timeline;

pub use inlet::Counters;
pub use modes::Change;
pub use shell::{End, Outcome, RunOptions, run};
pub(crate) use station::Station;
pub use tick::Timing;

/// A graph that runs.
pub struct Engine {
    core: tick::Core,
    decks: Vec<Deck>,
    timeline: Timeline,
    ports: Vec<(PlannedPort, PortId)>,
    logged: Vec<Logged>,
    /// Name and place of each limit's share.
    limits: Vec<(String, PortId)>,
    /// Name and place of each station.
    names: Vec<(String, String)>,
    /// Name of each role, and the place of the device behind it.
    roles: Vec<(String, String)>,
    timing: Timing,
    modes: Option<Modes>,
    is_done: bool,
    sources: Sources,
}

/// A node that logs what comes in on its wires.
#[derive(Debug, Clone)]
pub struct Logged {
    /// Name of the node.
    pub node: String,
    /// The flag that says when.
    pub due: PortId,
    /// What its wires come from, in the order of its inputs.
    pub inputs: Vec<(PlannedPort, PortId)>,
}

/// A device with what it is handed and what it hands over.
struct Deck {
    name: String,
    place: String,
    samples: Samples,
    commands: Commands,
    edge: Edge,
}

enum Edge {
    Stepped(Box<dyn Stepped>),
    /// A live device that the shell has not started yet.
    Idle(Box<dyn Live>),
    Live(Linked),
    /// A device that failed: it is not touched again.
    Gone,
}

impl Engine {
    /// Allocates everything that the plan needs; nothing allocates in a tick.
    #[must_use]
    pub fn new(plan: Plan) -> Self {
        let mut bus = Bus::default();
        let mut ids = std::collections::BTreeMap::new();
        let mut ports = Vec::new();
        let mut inlets = Vec::new();
        let mut kinds = std::collections::BTreeMap::new();
        for (i, role) in plan.roles.iter().enumerate() {
            for (port, planned) in role.ports.iter().enumerate() {
                let id = bus.add(&planned.shape);
                ids.insert(Source { producer: Producer::Role(i), port }, id);
                kinds.insert(Source { producer: Producer::Role(i), port }, (id, planned.shape.kind()));
                inlets.push(Inlet::new(&planned.shape, role.device, role.first_port + port, id));
                ports.push((planned.clone(), id));
            }
        }
        for node in &plan.nodes {
            for (port, planned) in node.ports.iter().enumerate() {
                let id = bus.add(&planned.shape);
                ids.insert(Source { producer: Producer::Node(node.index), port }, id);
                kinds.insert(Source { producer: Producer::Node(node.index), port }, (id, planned.shape.kind()));
                ports.push((planned.clone(), id));
            }
        }
        let logged = plan.nodes.iter().filter(|node| node.is_logged).map(|node| {
            let sources = node.inputs.iter().flat_map(|(_, sources)| sources).map(|source| ids[source]);
            let port =
                |id: PortId| ports.iter().find(|(_, known)| *known == id).expect("a wire comes from a port").clone();
            let due = ids[&Source { producer: Producer::Node(node.index), port: 0 }];
            Logged { node: node.name.clone(), due, inputs: sources.map(port).collect() }
        });
        let logged = logged.collect();
        let is_share = |name: &str| {
            plan.nodes.iter().any(|node| node.holds.iter().any(|limit| name == format!("{}.{limit}", node.name)))
        };
        let limits = ports.iter().filter(|(port, _)| is_share(&port.name)).map(|(port, id)| (port.name.clone(), *id));
        let limits = limits.collect();
        let names = plan.nodes.iter().map(|node| (node.name.clone(), plan.sources.locate(node.span.start))).collect();
        let place = |device: usize| plan.sources.locate(plan.devices[device].span.start);
        let roles = plan.roles.iter().map(|role| (role.name.clone(), place(role.device))).collect();
        let slots = plan.commands.iter().map(|command| CommandSlot::new(ids[&command.source], command)).collect();
        let decks = plan.devices.into_iter().map(|device| Deck {
            place: plan.sources.locate(device.span.start),
            name: device.name,
            samples: Samples::with_shapes(device.outputs.iter()),
            commands: Commands::with_shapes(device.commands.iter()),
            edge: match device.driver {
                Driver::Stepped(driver) => Edge::Stepped(driver),
                Driver::Live(driver) => Edge::Idle(driver),
            },
        });
        let decks: Vec<Deck> = decks.collect();
        let station = |node: crate::graph::PlannedNode| {
            let inputs: Vec<_> =
                node.inputs.iter().map(|(need, from)| (*need, from.iter().map(|s| ids[s]).collect())).collect();
            let outputs = (0..node.ports.len()).map(|port| ids[&Source { producer: Producer::Node(node.index), port }]);
            Station::new(node.node, &inputs, outputs.collect(), node.is_every_tick)
        };
        let stations: Vec<Station> = plan.nodes.into_iter().map(station).collect();
        let tick = Tick {
            index: 0,
            now: 0,
            dt: 0.0,
            stamp: Stamp::TIMELESS,
            max_gap: plan.max_gap,
            reset_after: plan.reset_after,
        };
        let (timing, mut core) = (Timing::new(stations.len()), tick::Core::new(bus, stations, inlets, slots, tick));
        let modes = plan.modes.map(|modes| Modes::new(modes, &kinds));
        modes.iter().for_each(|modes| core.switch(modes.configurations()));
        Self {
            timing,
            core,
            modes,
            is_done: false,
            decks,
            timeline: Timeline::new(plan.clock, plan.period),
            ports,
            logged,
            limits,
            names,
            roles,
            sources: plan.sources,
        }
    }

    /// Time of the next tick in virtual time [ns]; `None` when a device has ended.
    #[must_use]
    pub fn next(&self) -> Option<i64> {
        let mut clock = None;
        for (i, deck) in self.decks.iter().enumerate() {
            if let Edge::Stepped(driver) = &deck.edge {
                let next = driver.next()?;
                if self.timeline.is_clock(i) {
                    clock = Some(next);
                }
            }
        }
        Some(self.timeline.next(clock))
    }

    /// Runs the tick at `now` [ns]: exchange with the devices, then latch, step and commit.
    ///
    /// # Errors
    /// The reason of a fault; nothing was commanded in this tick.
    pub fn tick(&mut self, now: i64) -> Result<(), Fault> {
        self.exchange(now)?;
        self.step()
    }

    /// The second half of a tick: latch, step, commit. It neither allocates nor calls the operating system.
    ///
    /// # Errors
    /// The reason of a fault; nothing was commanded in this tick.
    pub fn step(&mut self) -> Result<(), Fault> {
        match catch_unwind(AssertUnwindSafe(|| self.core.run(&mut self.decks, &mut self.timing))) {
            Ok(true) => self.decide(),
            Ok(false) => Err(self.first_not_finite()),
            Err(panic) => Err(self.panicked(&*panic)),
        }
    }

    /// The boundary between two ticks: another mode, if the conditions of the present one say so.
    fn decide(&mut self) -> Result<(), Fault> {
        let Some(modes) = &mut self.modes else { return Ok(()) };
        match modes.decide(&self.core.bus, &self.core.tick, None) {
            Verdict::Stay => {}
            Verdict::Switched => self.core.switch(modes.configurations()),
            Verdict::Done => self.is_done = true,
            Verdict::Failed => {
                let ((why, place), name) = (modes.taken(), modes.name().to_owned());
                let (why, place) = (Cause::Mode(why.to_owned()), self.sources.locate(place));
                return Err(self.fault(&name, None, why, place));
            }
        }
        Ok(())
    }

    /// Whether a mode says that the task is done.
    #[must_use]
    pub const fn is_done(&self) -> bool {
        self.is_done
    }

    /// Name of the mode that the next tick is in; none in a graph without modes.
    #[must_use]
    pub fn mode(&self) -> Option<&str> {
        self.modes.as_ref().map(Modes::name)
    }

    /// The modes so far, each with when it began and why, the start first.
    #[must_use]
    pub fn changes(&self) -> Vec<Change> {
        self.modes.iter().flat_map(Modes::changes).collect()
    }

    /// Time of a stepped clock device's next sample.
    fn clock_sample(&self) -> Option<i64> {
        self.decks.iter().enumerate().find_map(|(i, deck)| match &deck.edge {
            Edge::Stepped(driver) if self.timeline.is_clock(i) => driver.next(),
            _ => None,
        })
    }

    /// The first half of a tick at `now` [ns]: hands the commands of the last tick to the devices and takes what they
    /// have sampled since.
    ///
    /// # Errors
    /// If a device fails.
    pub fn exchange(&mut self, now: i64) -> Result<(), Fault> {
        let due = self.clock_sample().is_some_and(|sample| sample <= now);
        self.core.begin(now);
        let has_sampled = self.exchange_with_devices(now)? || due;
        self.timeline.ticked(now, has_sampled);
        let decks = &self.decks;
        match self.core.inlets.iter().position(|inlet| !inlet.is_finite(&decks[inlet.device].samples)) {
            // The ports of the roles come first, an inlet each.
            Some(inlet) => Err(self.not_finite(&self.ports[inlet].0)),
            None => Ok(()),
        }
    }

    /// Whether a live clock device has sampled.
    fn exchange_with_devices(&mut self, now: i64) -> Result<bool, Fault> {
        let mut has_sampled = false;
        for (i, deck) in self.decks.iter_mut().enumerate() {
            match &mut deck.edge {
                Edge::Stepped(driver) => {
                    let exchange = || driver.exchange(now, &deck.commands, &mut deck.samples);
                    let result = catch_unwind(AssertUnwindSafe(exchange));
                    let failed =
                        result.unwrap_or_else(|panic| Err(DeviceError(format!("it panicked: {}", said(&*panic)))));
                    if let Err(error) = failed {
                        deck.edge = Edge::Gone;
                        return Err(Fault {
                            node: deck.name.clone(),
                            port: None,
                            tick: self.core.tick.index,
                            time: now,
                            cause: Cause::Device(error.0),
                            place: deck.place.clone(),
                        });
                    }
                }
                Edge::Live(linked) => {
                    let is_newer = linked.exchange(&deck.commands, &mut deck.samples);
                    has_sampled |= is_newer && self.timeline.is_clock(i);
                }
                Edge::Idle(_) | Edge::Gone => {}
            }
        }
        Ok(has_sampled)
    }

    /// One period of the end of a run: the commands go one step further down to zero, and the devices are told.
    /// Whether they are zero.
    pub fn wind_down(&mut self) -> bool {
        let now = self.core.tick.now + self.timeline.period();
        self.core.begin(now);
        let is_still = self.core.ramp(&mut self.decks, self.timeline.period() as f64 * 1e-9);
        // A device that fails now has had its zero or will time out by itself; the reason of the stop stays the first.
        let _ = self.exchange_with_devices(now);
        is_still
    }

    /// Ports stand in the order in which they are written, so the first that is not finite is the one that made it so.
    fn first_not_finite(&self) -> Fault {
        let is_bad = |(port, id): &&(PlannedPort, PortId)| !self.core.bus.arenas.is_finite(port.shape.kind(), id.slot);
        let (port, _) = self.ports.iter().find(is_bad).expect("one of them is not finite");
        self.not_finite(port)
    }

    fn not_finite(&self, port: &PlannedPort) -> Fault {
        let (node, name) = port.name.rsplit_once('.').expect("a port's name has two parts");
        let (_, place) =
            self.names.iter().chain(&self.roles).find(|(known, _)| known == node).expect("a port has an owner");
        self.fault(node, Some(name.to_owned()), Cause::NotFinite, place.clone())
    }

    fn panicked(&self, panic: &(dyn std::any::Any + Send)) -> Fault {
        let (node, place) = &self.names[self.core.current()];
        self.fault(node, None, Cause::Panicked(said(panic)), place.clone())
    }

    fn fault(&self, node: &str, port: Option<String>, cause: Cause, place: String) -> Fault {
        Fault { node: node.into(), port, tick: self.core.tick.index, time: self.core.tick.now, cause, place }
    }

    /// Time of the last sample that the clock device will give, if it knows [ns].
    #[must_use]
    pub fn end(&self) -> Option<i64> {
        self.decks.iter().enumerate().find_map(|(i, deck)| match &deck.edge {
            Edge::Stepped(driver) if self.timeline.is_clock(i) => driver.end(),
            _ => None,
        })
    }

    /// Number of the last tick.
    #[must_use]
    pub const fn ticks(&self) -> u64 {
        self.core.tick.index
    }

    /// Time of the last tick in the graph's clock [ns].
    #[must_use]
    pub const fn now(&self) -> i64 {
        self.core.tick.now
    }

    /// Nominal time between two ticks [ns].
    #[must_use]
    pub const fn period(&self) -> i64 {
        self.timeline.period()
    }

    /// Every value, as the last tick left it.
    #[must_use]
    pub const fn bus(&self) -> &Bus {
        &self.core.bus
    }

    /// Every port, those of the roles first, and where its value is.
    #[must_use]
    pub fn ports(&self) -> &[(PlannedPort, PortId)] {
        &self.ports
    }

    /// The nodes that log, in the order in which they step.
    #[must_use]
    pub fn logged(&self) -> &[Logged] {
        &self.logged
    }

    /// Where each limit says what share of the motion it lets pass, from 0 to 1: its name, `node.limit`, and its port.
    pub fn limits(&self) -> impl Iterator<Item = (&str, PortId)> {
        self.limits.iter().map(|(name, id)| (name.as_str(), *id))
    }

    /// The names of the nodes in the order in which they step.
    pub fn order(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(|(name, _)| name.as_str())
    }

    /// What came in on each role's ports, in the order of [`ports`](Self::ports).
    pub fn counters(&self) -> impl Iterator<Item = &Counters> {
        self.core.inlets.iter().map(|inlet| &inlet.counters)
    }

    /// How long the nodes took.
    #[must_use]
    pub const fn timing(&self) -> &Timing {
        &self.timing
    }

    /// The command that a device holds: those of its ports, end to end.
    #[must_use]
    pub fn commands(&self, device: &str) -> Option<Vec<f64>> {
        let deck = self.decks.iter().find(|deck| deck.name == device)?;
        Some(deck.commands.values.iter().flat_map(|values| values.iter().copied()).collect())
    }

    /// The texts the graph was read from.
    #[must_use]
    pub const fn sources(&self) -> &Sources {
        &self.sources
    }

    /// Makes what the devices have last given count as sampled anew a period later: for measurements of a tick.
    pub fn refresh(&mut self) {
        let now = self.core.tick.now + self.timeline.period();
        self.core.begin(now);
        self.core.refresh(&mut self.decks);
    }

    /// Latch, step and commit without what guards and measures them: no finite check, no timing, nothing that catches a
    /// panic. For measurements.
    pub fn step_bare(&mut self) {
        self.core.run_bare(&mut self.decks);
    }
}

/// What a panic had to say.
fn said(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
