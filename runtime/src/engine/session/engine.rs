//! The engine: the state of a running graph and its accessors.

use super::halt::{Halt, Rest};
use super::inputs::InputLog;
use super::live_values::{LiveValue, LiveValues, ValueChange};
use super::punctuality::Punctuality;
use super::schedule::TickSchedule;
use super::task_run::{TaskEnd, TaskRun};
use super::trouble::{WatchedBudget, WatchedFailure, WatchedWire};
use crate::device::Report;
use crate::engine::core::{Core, Counters, DeviceLink, DeviceSlot, ModeChange, Timing};
use crate::fault::Fault;
use crate::graph::{AllowedWarning, PlannedPort, Reach, RecordedPorts};
use crate::node::{Bus, PortId};
use crate::signal::{Mark, Scalar, Signal};
use crate::source::{SourceMap, suggestion};

/// A scale that differs from one by less is no limit [1].
const ROUNDING: f64 = 1e-6;

/// A running graph.
pub struct Engine {
    pub(super) core: Core,
    pub(super) devices: Vec<DeviceSlot>,
    pub(super) schedule: TickSchedule,
    pub(super) ports: Vec<(PlannedPort, PortId)>,
    pub(super) logged: Vec<Logged>,
    pub(super) display: Vec<DisplayedPort>,
    /// Name and port of the scale that each limit reports.
    pub(super) limits: Vec<(String, PortId)>,
    pub(super) budgets: Vec<WatchedBudget>,
    pub(super) failures: Vec<WatchedFailure>,
    pub(super) rests: Vec<Rest>,
    /// Names of the limiters whose limits are in raw readings.
    pub(super) uncalibrated: Vec<String>,
    pub(super) allowed: Vec<AllowedWarning>,
    /// Name and source location of each runner's node.
    pub(super) names: Vec<(String, String)>,
    /// Name of each role, and the source location of its device.
    pub(super) roles: Vec<(String, String)>,
    /// For each command, the task whose file wires it, and the tasks that drive it.
    pub(super) drivers: Vec<(usize, Vec<usize>)>,
    /// The roles that are commanded, each once.
    pub(super) commanded: Vec<String>,
    /// Name `role.report` of each wired report, the index of its device, and its number there.
    pub(super) reported: Vec<(String, usize, usize)>,
    /// Name of each export of a part, and the port behind it.
    pub(super) exports: Vec<(String, String)>,
    pub(super) timing: Timing,
    /// The graph itself, and the parts that are tasks.
    pub(super) tasks: Vec<TaskRun>,
    /// The tasks that a trouble of each role and of each runner concerns.
    pub(super) reach: Reach,
    /// The roles that each device fills.
    pub(super) device_roles: Vec<Vec<usize>>,
    /// The runner that writes each port.
    pub(super) writers: Vec<Option<usize>>,
    /// Wires whose policy stops the commands or ends the run when their value is too old.
    pub(super) watched: Vec<WatchedWire>,
    /// Message of the last panic of a node.
    pub(super) panic: String,
    /// Ticks that began too late.
    pub(super) late: u64,
    /// How late the next tick begins, if it is too late [ns].
    pub(super) lateness: Option<i64>,
    pub(super) punctuality: Punctuality,
    /// What a recording of the whole run contains.
    pub(super) recorded: RecordedPorts,
    /// The parameters that may change while the graph runs.
    pub(super) live: LiveValues,
    /// The inputs of the tick, if they are logged.
    pub(super) inputs: Option<Box<InputLog>>,
    /// Whether the clock device has sampled in a tick that is replayed.
    pub(super) replayed: Option<bool>,
    pub(super) sources: SourceMap,
}

/// A port that a run displays, from the keys `show` and `mark` of the section [graph].
#[derive(Debug, Clone)]
pub struct DisplayedPort {
    /// Its name in the graph file.
    pub name: String,
    /// Its full name and shape.
    pub port: PlannedPort,
    /// Its place on the bus.
    pub id: PortId,
    /// The ports of the x and the y of the contact that is marked in it [m], if it is an image.
    pub mark: Option<[PortId; 2]>,
}

/// A node whose inputs are logged.
#[derive(Debug, Clone)]
pub struct Logged {
    /// Name of the node.
    pub node: String,
    /// The flag that is set in the ticks that are logged.
    pub due: PortId,
    /// The sources of its wires, in the order of its inputs.
    pub inputs: Vec<(PlannedPort, PortId)>,
}

impl Engine {
    /// Returns the time of the next tick in virtual time [ns], or `None` when a device has no more samples.
    #[must_use]
    pub fn next(&self) -> Option<i64> {
        let mut clock = None;
        for (i, device) in self.devices.iter().enumerate() {
            match &device.link {
                DeviceLink::Stepped(driver) => {
                    let next = driver.next()?;
                    if self.schedule.is_clock(i) {
                        clock = Some(next);
                    }
                }
                DeviceLink::Live(linked) if linked.is_finished() => return None,
                _ => {}
            }
        }
        Some(self.schedule.next(clock))
    }

    /// Returns the tasks: the graph itself, and the parts that are tasks.
    #[must_use]
    pub fn tasks(&self) -> &[TaskRun] {
        &self.tasks
    }

    /// Returns the graph itself as a task.
    fn root(&self) -> &TaskRun {
        &self.tasks[0]
    }

    /// Whether every task that has modes or commands has ended, and none of them has failed.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.is_over() && self.failures().next().is_none()
    }

    /// Whether every task that has modes or commands is done or has failed.
    pub(super) fn is_over(&self) -> bool {
        self.tasks.iter().any(|task| task.end.is_some()) && (0..self.tasks.len()).all(|task| !self.is_awaited(task))
    }

    /// Whether the run waits for the end of a task. One without modes has ended when the tasks that drive its commands
    /// have.
    fn is_awaited(&self, task: usize) -> bool {
        let has_ended = |driver: &usize| self.tasks[*driver].end.is_some();
        let mut own = self.drivers.iter().filter(|(owner, _)| *owner == task).peekable();
        let is_driven_by_ended = own.peek().is_some() && own.all(|(_, drivers)| drivers.iter().any(has_ended));
        self.tasks[task].is_awaited() && (self.tasks[task].modes.is_some() || !is_driven_by_ended)
    }

    /// Returns the fault of each task that has failed, with the name of the task.
    pub fn failures(&self) -> impl Iterator<Item = (&str, &Fault)> {
        self.tasks.iter().filter_map(|task| match &task.end {
            Some(TaskEnd::Failed(fault)) => Some((task.name(), &**fault)),
            _ => None,
        })
    }

    /// Returns the name of the mode of the next tick, or `None` if the graph itself has no modes.
    #[must_use]
    pub fn mode(&self) -> Option<&str> {
        self.root().mode()
    }

    /// Returns the number of the mode of the next tick, from 0 in the order of the file.
    #[must_use]
    pub fn mode_number(&self) -> Option<usize> {
        self.root().mode_number()
    }

    /// Whether every command of the graph itself is zero or ramps to zero because of a halt.
    #[must_use]
    pub fn is_halted(&self) -> bool {
        self.root().is_halted()
    }

    /// Returns the mode changes of the graph itself so far, the start mode first.
    #[must_use]
    pub fn changes(&self) -> Vec<ModeChange> {
        self.root().changes()
    }

    /// Returns the halts of the graph itself so far, at most 1000.
    #[must_use]
    pub fn halts(&self) -> &[Halt] {
        self.root().halts()
    }

    /// Whether the commands of every task that has not ended wait for the operator to resume.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        let mut awaited = self.tasks.iter().filter(|task| task.is_awaited()).peekable();
        if awaited.peek().is_none() { self.root().is_stopped() } else { awaited.all(TaskRun::is_stopped) }
    }

    /// Returns the number of ticks that began too late.
    #[must_use]
    pub const fn late(&self) -> u64 {
        self.late
    }

    /// Returns the time of the clock device's last sample, if the device knows it [ns].
    #[must_use]
    pub fn end(&self) -> Option<i64> {
        self.clock()?.link.stepped()?.end()
    }

    /// Returns the device whose samples trigger the ticks; a graph with a rate has none.
    pub(super) fn clock(&self) -> Option<&DeviceSlot> {
        self.devices.get(self.schedule.clock_device()?)
    }

    /// Whether a device runs in real time.
    pub(super) fn is_live(&self) -> bool {
        let is_live =
            |link: &DeviceLink| matches!(link, DeviceLink::Idle(_) | DeviceLink::Live(_) | DeviceLink::Down(_));
        self.devices.iter().any(|device| is_live(&device.link))
    }

    /// Whether the samples of a stepped device end at a known time.
    pub(super) fn has_end(&self) -> bool {
        self.devices.iter().any(|device| device.link.stepped().is_some_and(|driver| driver.end().is_some()))
    }

    /// Returns the number of the last tick.
    #[must_use]
    pub const fn ticks(&self) -> u64 {
        self.core.tick.index
    }

    /// Returns the time of the last tick in the graph's clock [ns].
    #[must_use]
    pub const fn now(&self) -> i64 {
        self.core.tick.now
    }

    /// Returns the nominal time between two ticks [ns].
    #[must_use]
    pub const fn period(&self) -> i64 {
        self.schedule.period()
    }

    /// Returns the bus, with the values after the last tick.
    #[must_use]
    pub const fn bus(&self) -> &Bus {
        &self.core.bus
    }

    /// Returns every port with its place on the bus, the ports of the roles first.
    #[must_use]
    pub fn ports(&self) -> &[(PlannedPort, PortId)] {
        &self.ports
    }

    /// Returns the nodes whose inputs are logged, in the order in which they step.
    #[must_use]
    pub fn logged(&self) -> &[Logged] {
        &self.logged
    }

    /// Returns the ports that the graph asks to display.
    #[must_use]
    pub fn display(&self) -> &[DisplayedPort] {
        &self.display
    }

    /// Returns the name `node.limit` of each limit, and the factor by which it scales the motion in the last tick [1]: from
    /// 0, where it stops it, to 1, where it does not act. The order is always the same.
    pub fn limits(&self) -> impl Iterator<Item = (&str, f64)> {
        let scale = |id| self.bus().get::<Scalar>(id).copied().filter(|scale| *scale < 1.0 - ROUNDING).unwrap_or(1.0);
        self.limits.iter().map(move |(name, id)| (name.as_str(), scale(*id)))
    }

    /// Returns the roles that are commanded, each once.
    #[must_use]
    pub fn commanded(&self) -> &[String] {
        &self.commanded
    }

    /// Returns the warnings that a section [allow] silences, each with its reason.
    #[must_use]
    pub fn allowed(&self) -> &[AllowedWarning] {
        &self.allowed
    }

    /// Returns the names of the limiters whose limits are in raw readings.
    #[must_use]
    pub fn uncalibrated(&self) -> &[String] {
        &self.uncalibrated
    }

    /// Returns the names of the nodes in the order in which they step.
    pub fn order(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(|(name, _)| name.as_str())
    }

    /// Returns the sample counts of each role's ports, in the order of [`ports`](Self::ports).
    pub fn counters(&self) -> impl Iterator<Item = &Counters> {
        self.core.inlets.iter().map(|inlet| &inlet.counters)
    }

    /// Returns the step times of the nodes.
    #[must_use]
    pub const fn timing(&self) -> &Timing {
        &self.timing
    }

    /// Returns the current command of a device, with the values of all its command ports one after the other.
    #[must_use]
    pub fn commands(&self, device: &str) -> Option<Vec<f64>> {
        let device = self.devices.iter().find(|slot| slot.name == device)?;
        Some(device.commands.values.iter().flat_map(|values| values.iter().copied()).collect())
    }

    /// Keeps the driver of a live device from sending anything to it, as if this process had died, or lets it send again;
    /// see [`Link::is_mute`](crate::device::Link::is_mute).
    pub fn mute(&self, device: &str, is_mute: bool) {
        let named = self.devices.iter().filter(|slot| slot.name == device);
        named.filter_map(|slot| slot.link.live()).for_each(|linked| linked.mute(is_mute));
    }

    /// Returns what the graph reports to a device on `role.report`, or `None` while that is absent or not wired.
    #[must_use]
    pub fn report<T: Signal>(&self, name: &str) -> Option<&T> {
        let (_, device, report) = self.reported.iter().find(|(known, ..)| known == name)?;
        self.devices[*device].commands.report(Report::at(*report))
    }

    /// Returns the name of each device with its counts; see [`Samples::count`].
    pub fn counts(&self) -> impl Iterator<Item = (&str, &[(&'static str, u64)])> {
        self.devices.iter().map(|slot| (slot.name.as_str(), slot.samples.counts.as_slice()))
    }

    /// Finds a port by its name in a recording or in the wires of the task.
    #[must_use]
    pub fn port(&self, name: &str) -> Option<&(PlannedPort, PortId)> {
        let export = self.exports.iter().find(|(export, _)| export == name);
        let name = export.map_or(name, |(_, port)| port.as_str());
        self.ports.iter().find(|(port, _)| port.name == name)
    }

    /// Returns the value of a port after the last tick, or `None` while it is absent: `get::<Scalar>("truth.force")`.
    ///
    /// # Panics
    /// If there is no port with that name and kind.
    #[must_use]
    pub fn get<T: Signal>(&self, name: &str) -> Option<&T> {
        let (port, id) = self.known(name);
        assert_eq!(port.shape.kind(), T::KIND, "kind of port `{name}`");
        self.core.bus.get(*id)
    }

    /// Returns the mark of a port after the last tick.
    ///
    /// # Panics
    /// If there is no port with that name.
    #[must_use]
    pub fn mark(&self, name: &str) -> Mark {
        *self.core.bus.mark(self.known(name).1)
    }

    fn known(&self, name: &str) -> &(PlannedPort, PortId) {
        self.port(name).unwrap_or_else(|| {
            let names = self.ports.iter().map(|(port, _)| port.name.as_str());
            panic!("there is no port `{name}`: {}", suggestion(name, names, "ports"))
        })
    }

    /// Returns what a recording of the whole run contains.
    #[must_use]
    pub const fn recorded_ports(&self) -> &RecordedPorts {
        &self.recorded
    }

    /// Returns the parameters that may change while the graph runs, in the order of `[live]`.
    pub fn live_values(&self) -> impl Iterator<Item = LiveValue<'_>> {
        self.live.iter()
    }

    /// Returns the changes of parameters so far, at most 10 000.
    #[must_use]
    pub fn value_changes(&self) -> &[ValueChange] {
        self.live.changes()
    }

    /// Returns the sources of the graph.
    #[must_use]
    pub const fn sources(&self) -> &SourceMap {
        &self.sources
    }

    /// Presents the last samples of the devices as new ones, one period later. For benchmarks.
    pub fn refresh(&mut self) {
        let now = self.core.tick.now + self.schedule.period();
        self.core.begin(now);
        self.core.refresh(&mut self.devices);
    }

    /// Runs latch, step and commit without the finite check, the timing and the catching of panics. For benchmarks.
    pub fn step_bare(&mut self) {
        self.core.run_bare(&mut self.devices);
    }
}
