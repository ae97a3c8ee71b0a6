//! The engine: everything that a tick touches, and what can be asked of it.

use super::halt::{Halt, Halts};
use super::timeline::Timeline;
use super::trouble::{Trouble, WatchedWire};
use crate::device::Report;
use crate::engine::core::{Change, Core, Counters, DeviceSlot, Link, Modes, Timing};
use crate::graph::{PlannedPort, Policy, PolicyTable};
use crate::node::{Bus, PortId};
use crate::signal::{Mark, Signal};
use crate::source::{SourceMap, closest};

/// A graph that runs.
pub struct Engine {
    pub(super) core: Core,
    pub(super) devices: Vec<DeviceSlot>,
    pub(super) timeline: Timeline,
    pub(super) ports: Vec<(PlannedPort, PortId)>,
    pub(super) logged: Vec<Logged>,
    pub(super) view: View,
    /// Name and place of each limit's share.
    pub(super) limits: Vec<(String, PortId)>,
    /// Name and place of each runner.
    pub(super) names: Vec<(String, String)>,
    /// Name of each role, and the place of the device behind it.
    pub(super) roles: Vec<(String, String)>,
    /// Each report that is wired, with its device and its number there.
    pub(super) reported: Vec<(String, usize, usize)>,
    /// What the parts export, and the port behind each.
    pub(super) exports: Vec<(String, String)>,
    pub(super) timing: Timing,
    pub(super) modes: Option<Modes>,
    pub(super) is_done: bool,
    pub(super) policy: PolicyTable,
    pub(super) halts: Halts,
    /// Wires whose age does more than that their node goes without.
    pub(super) watched: Vec<WatchedWire>,
    /// What went wrong in this tick, and what it does; the strictest.
    pub(super) trouble: Option<(Policy, Trouble)>,
    /// What the last panic had to say.
    pub(super) panic: String,
    /// A word from outside that no mode has seen yet.
    pub(super) sent: Option<String>,
    /// Ticks that began too late.
    pub(super) late: u64,
    /// How late the next tick begins, if too late [ns].
    pub(super) lateness: Option<i64>,
    pub(super) sources: SourceMap,
}

/// What a run shows of the graph, as its section [graph] says.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// The ports, each with what the graph calls it.
    pub ports: Vec<(String, PlannedPort, PortId)>,
    /// Where the contact is in the first image: the ports of its x and of its y [m].
    pub mark: Option<[PortId; 2]>,
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

impl Engine {
    /// Time of the next tick in virtual time [ns]; `None` when a device has ended.
    #[must_use]
    pub fn next(&self) -> Option<i64> {
        let mut clock = None;
        for (i, device) in self.devices.iter().enumerate() {
            if let Link::Stepped(driver) = &device.link {
                let next = driver.next()?;
                if self.timeline.is_clock(i) {
                    clock = Some(next);
                }
            }
        }
        Some(self.timeline.next(clock))
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

    /// Number of that mode, from 0 in the order of the file.
    #[must_use]
    pub fn mode_number(&self) -> Option<usize> {
        self.modes.as_ref().map(Modes::number)
    }

    /// Whether every command is held at zero, or on its way there.
    #[must_use]
    pub fn is_halted(&self) -> bool {
        self.halts.is_halted()
    }

    /// The modes so far, each with when it began and why, the start first.
    #[must_use]
    pub fn changes(&self) -> Vec<Change> {
        self.modes.iter().flat_map(Modes::changes).collect()
    }

    /// Every time in which the commands were held, with its reason, up to a thousand.
    #[must_use]
    pub fn halts(&self) -> &[Halt] {
        self.halts.list()
    }

    /// Times in which the commands were held that are not in [that list](Self::halts).
    #[must_use]
    pub const fn more_halts(&self) -> u64 {
        self.halts.more
    }

    /// Whether the commands wait for the operator.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.halts.is_stopped()
    }

    /// Ticks that began too late.
    #[must_use]
    pub const fn late(&self) -> u64 {
        self.late
    }

    /// Time of the last sample that the clock device will give, if it knows [ns].
    #[must_use]
    pub fn end(&self) -> Option<i64> {
        self.devices.iter().enumerate().find_map(|(i, device)| match &device.link {
            Link::Stepped(driver) if self.timeline.is_clock(i) => driver.end(),
            _ => None,
        })
    }

    /// Whether a device runs on its own, in real time.
    pub(super) fn is_live(&self) -> bool {
        self.devices.iter().any(|device| matches!(device.link, Link::Idle(_) | Link::Live(_)))
    }

    /// Whether a device that is left knows of an end of its samples.
    pub(super) fn has_end(&self) -> bool {
        self.devices.iter().any(|device| matches!(&device.link, Link::Stepped(driver) if driver.end().is_some()))
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

    /// What the graph wants to be shown.
    #[must_use]
    pub const fn view(&self) -> &View {
        &self.view
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
        let device = self.devices.iter().find(|slot| slot.name == device)?;
        Some(device.commands.values.iter().flat_map(|values| values.iter().copied()).collect())
    }

    /// Returns what the graph reports to a device on `role.report`, or `None` while that is absent or not wired.
    #[must_use]
    pub fn report<T: Signal>(&self, name: &str) -> Option<&T> {
        let (_, device, report) = self.reported.iter().find(|(known, ..)| known == name)?;
        self.devices[*device].commands.report(Report::at(*report))
    }

    /// The devices, each with what it has counted; see [`Samples::count`].
    pub fn counts(&self) -> impl Iterator<Item = (&str, &[(&'static str, u64)])> {
        self.devices.iter().map(|slot| (slot.name.as_str(), slot.samples.counts.as_slice()))
    }

    /// Returns the place of a port, by its name in a record or in the wires of the task.
    #[must_use]
    pub fn port(&self, name: &str) -> Option<&(PlannedPort, PortId)> {
        let export = self.exports.iter().find(|(export, _)| export == name);
        let name = export.map_or(name, |(_, port)| port.as_str());
        self.ports.iter().find(|(port, _)| port.name == name)
    }

    /// Returns the value of a port as the last tick left it, or `None` while it is absent: `get::<Scalar>("truth.force")`.
    ///
    /// # Panics
    /// If there is no port of that name and kind.
    #[must_use]
    pub fn get<T: Signal>(&self, name: &str) -> Option<&T> {
        let (port, id) = self.known(name);
        assert_eq!(port.shape.kind(), T::KIND, "kind of port `{name}`");
        self.read(*id)
    }

    /// Returns the mark of a port, as the last tick left it.
    ///
    /// # Panics
    /// If there is no port of that name.
    #[must_use]
    pub fn mark(&self, name: &str) -> Mark {
        self.core.bus.marks[self.known(name).1.mark as usize]
    }

    /// Returns the value of a port that was looked up before; see [`port`](Self::port).
    pub(crate) fn read<T: Signal>(&self, id: PortId) -> Option<&T> {
        let Bus { marks, arenas } = &self.core.bus;
        marks[id.mark as usize].is_present().then(|| &T::arena(arenas)[id.slot as usize])
    }

    fn known(&self, name: &str) -> &(PlannedPort, PortId) {
        self.port(name).unwrap_or_else(|| {
            let names = self.ports.iter().map(|(port, _)| port.name.as_str());
            panic!("there is no port `{name}`: {}", closest(name, names, "ports"))
        })
    }

    /// The texts the graph was read from.
    #[must_use]
    pub const fn sources(&self) -> &SourceMap {
        &self.sources
    }

    /// Makes what the devices have last given count as sampled anew a period later: for measurements of a tick.
    pub fn refresh(&mut self) {
        let now = self.core.tick.now + self.timeline.period();
        self.core.begin(now);
        self.core.refresh(&mut self.devices);
    }

    /// Latch, step and commit without what guards and measures them: no finite check, no timing, nothing that catches a
    /// panic. For measurements.
    pub fn step_bare(&mut self) {
        self.core.run_bare(&mut self.devices);
    }
}
