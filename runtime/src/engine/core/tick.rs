//! The tick: latch, step, commit. It runs on one thread in a fixed order, without queues, locks, allocation or `async`.
//! It reads the clock only in the few ticks that time the nodes.

use std::time::{Duration, Instant};

use super::command::{CommandSlot, ReportSlot};
use super::inlet::Inlet;
use super::runner::NodeRunner;
use super::slot::DeviceSlot;
use crate::node::{AnyNode, Bus, Tick};

/// Everything a tick touches.
pub(crate) struct Core {
    pub(crate) bus: Bus,
    pub(crate) inlets: Vec<Inlet>,
    pub(crate) tick: Tick,
    runners: Vec<NodeRunner>,
    /// The task of each runner; empty for a graph with one task.
    owners: Vec<usize>,
    /// What holds in the tick for the nodes of each task.
    pub(crate) tasks: Vec<TaskTick>,
    pub(crate) commands: Vec<CommandSlot>,
    reports: Vec<ReportSlot>,
    /// Index of the runner that is stepping. A panic is attributed to it.
    current: usize,
}

/// What holds in a tick for the nodes of one task.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TaskTick {
    /// Maximum time between two samples that counts as one step [s].
    pub(crate) max_gap: f64,
    /// Time of absence after which a state is reset [ns].
    pub(crate) reset_after: i64,
    /// Whether the commands of the task are held at zero.
    pub(crate) is_halted: bool,
    /// Whether the operator sent `resume` to the task before this tick.
    pub(crate) is_resumed: bool,
}

impl TaskTick {
    fn apply(&self, tick: &mut Tick) {
        (tick.max_gap, tick.reset_after) = (self.max_gap, self.reset_after);
        (tick.is_halted, tick.is_resumed) = (self.is_halted, self.is_resumed);
    }
}

impl Core {
    /// Creates the core. `runners` are the nodes in step order, each with its task; a graph with one
    /// task names none.
    pub(crate) fn new(
        bus: Bus,
        (runners, owners): (Vec<NodeRunner>, Vec<usize>),
        inlets: Vec<Inlet>,
        (mut commands, reports): (Vec<CommandSlot>, Vec<ReportSlot>),
        tasks: Vec<TaskTick>,
    ) -> Self {
        for command in &mut commands {
            command.maker = runners.iter().position(|runner| runner.writes(command.source));
        }
        let tick = Tick { index: 0, ..Tick::first() };
        Self { bus, inlets, tick, runners, owners, tasks, commands, reports, current: 0 }
    }

    /// Returns the task of a runner.
    pub(crate) fn task_of(&self, runner: usize) -> usize {
        self.owners.get(runner).copied().unwrap_or(0)
    }

    /// Returns what each node has found out so far, in step order.
    pub(crate) fn found(&self) -> impl Iterator<Item = Option<String>> {
        self.runners.iter().map(NodeRunner::found)
    }

    /// Starts the tick at `now` [ns].
    pub(crate) fn begin(&mut self, now: i64) {
        let dt = if self.tick.index == 0 { 0.0 } else { (now - self.tick.now) as f64 * 1e-9 };
        self.tick = Tick { index: self.tick.index + 1, now, dt, ..self.tick };
    }

    /// Steps the nodes from the runner `first` on, each at most once. Returns whether all values are finite.
    pub(crate) fn run(&mut self, first: usize, timing: &mut Timing) -> bool {
        if timing.is_due(self.tick.index) {
            self.step_timed(first, timing);
        } else {
            self.step(first);
        }
        self.bus.arenas.are_finite()
    }

    /// Runs latch, step and commit without the finite check and the timing.
    pub(crate) fn run_bare(&mut self, devices: &mut [DeviceSlot]) {
        self.latch(devices);
        self.step(0);
        self.commit(devices);
    }

    /// Latches the newest samples of the devices that have not failed.
    pub(crate) fn latch(&mut self, devices: &mut [DeviceSlot]) {
        for inlet in &mut self.inlets {
            let device = &mut devices[inlet.device];
            if device.failed.is_none() {
                let was_lost = inlet.latch(&mut device.samples, &mut self.bus, self.tick.index, self.tick.now);
                let returns = if was_lost { &*inlet.returns } else { &[] };
                returns.iter().for_each(|runner| self.runners[*runner].returned());
            }
        }
    }

    fn step(&mut self, first: usize) {
        self.tasks[0].apply(&mut self.tick);
        let runners = self.runners[first..].iter_mut().zip(first..);
        if self.owners.is_empty() {
            for (runner, i) in runners {
                self.current = i;
                runner.visit(&mut self.tick, &mut self.bus);
            }
            return;
        }
        for (runner, i) in runners {
            self.current = i;
            self.tasks[self.owners[i]].apply(&mut self.tick);
            runner.visit(&mut self.tick, &mut self.bus);
        }
    }

    fn step_timed(&mut self, first: usize, timing: &mut Timing) {
        self.tasks[0].apply(&mut self.tick);
        let mut before = Instant::now();
        for (i, runner) in self.runners.iter_mut().enumerate().skip(first) {
            self.current = i;
            if let Some(task) = self.owners.get(i) {
                self.tasks[*task].apply(&mut self.tick);
            }
            runner.visit(&mut self.tick, &mut self.bus);
            let after = Instant::now();
            timing.nodes[i].add(after - before);
            before = after;
        }
        timing.ticks += 1;
        timing.last_tick = self.tick.index;
    }

    /// Commits the commands, which ramp to zero while their task is halted, and the reports.
    pub(crate) fn commit(&mut self, devices: &mut [DeviceSlot]) {
        for command in &mut self.commands {
            let is_halted = command.tasks.iter().any(|task| self.tasks[*task].is_halted);
            command.commit(&self.bus, &mut devices[command.device].commands, &self.tick, is_halted);
            if let Some(maker) = command.maker {
                let is_open_loop = devices[command.device].description.is_open_loop;
                self.runners[maker].is_overruled = is_open_loop || !command.follows;
            }
        }
        for report in &self.reports {
            report.commit(&self.bus, &mut devices[report.device].commands, &self.tick);
        }
    }

    /// Ramps every command toward zero for `dt` [s]. Returns whether all are zero. Reports are absent, since no node
    /// steps.
    pub(crate) fn ramp(&mut self, devices: &mut [DeviceSlot], dt: f64) -> bool {
        devices.iter_mut().for_each(|device| device.commands.clear_reports());
        let commands = self.commands.iter_mut();
        commands.fold(true, |still, command| command.ramp(&mut devices[command.device].commands, dt) & still)
    }

    /// Makes the current value of every inlet a pending sample; see [`Inlet::refresh`].
    pub(crate) fn refresh(&mut self, devices: &mut [DeviceSlot]) {
        for inlet in &mut self.inlets {
            inlet.refresh(&mut devices[inlet.device].samples, &mut self.bus, self.tick.now);
        }
    }

    /// Switches the configurations of runners: the index of each runner and the number of its configuration.
    pub(crate) fn switch(&mut self, configurations: impl Iterator<Item = (usize, usize)>) {
        for (runner, configuration) in configurations {
            self.runners[runner].switch(configuration);
        }
    }

    /// Exchanges the configurations of a runner with those of another node of its type.
    pub(crate) fn exchange(&mut self, runner: usize, other: &mut dyn AnyNode) {
        self.runners[runner].exchange(other);
    }

    /// Whether the runner with that index can take its zero anew; `None` if it keeps none.
    #[cold]
    pub(crate) fn can_tare(&self, runner: usize) -> Option<Result<(), String>> {
        self.runners[runner].can_tare(&self.tick, &self.bus)
    }

    /// Makes the runner with that index take its zero anew.
    #[cold]
    pub(crate) fn tare(&mut self, runner: usize) {
        self.runners[runner].tare();
    }

    /// Resets the runner with that index.
    pub(crate) fn reset(&mut self, runner: usize) {
        self.runners[runner].reset();
    }

    /// Notes that the runner that stepped last has panicked.
    pub(crate) fn set_panicked(&mut self) {
        self.runners[self.current].set_panicked(self.tick.now);
    }

    /// Returns the first runner from `first` on that waits for its reset after a panic.
    pub(crate) fn panicked(&self, first: usize) -> Option<usize> {
        self.runners[first..].iter().position(NodeRunner::has_panicked).map(|at| first + at)
    }

    /// Returns the index of the runner that stepped last.
    pub(crate) const fn current(&self) -> usize {
        self.current
    }
}

/// Step time of one node.
#[derive(Debug, Clone, Copy, Default)]
pub struct NodeTime {
    /// Sum over the timed ticks.
    pub total: Duration,
    /// Longest time in one tick.
    pub longest: Duration,
    /// Time in the last timed tick.
    pub(crate) last: Duration,
}

impl NodeTime {
    fn add(&mut self, time: Duration) {
        (self.total, self.last) = (self.total + time, time);
        self.longest = self.longest.max(time);
    }
}

/// Step times of the nodes. One tick in 64 is timed, because reading the clock costs more than most nodes; in real time,
/// every tick after one that was late.
#[derive(Debug, Clone)]
pub struct Timing {
    /// The nodes, in the order in which they step.
    pub nodes: Vec<NodeTime>,
    /// Number of timed ticks.
    pub ticks: u64,
    /// Whether every tick is timed.
    pub(crate) is_always_on: bool,
    /// Number of the last timed tick.
    pub(crate) last_tick: u64,
}

impl Timing {
    /// Interval between timed ticks [ticks].
    const INTERVAL_TICKS: u64 = 64;

    pub(crate) fn new(nodes: usize) -> Self {
        Self { nodes: vec![NodeTime::default(); nodes], ticks: 0, is_always_on: false, last_tick: 0 }
    }

    const fn is_due(&self, tick: u64) -> bool {
        self.is_always_on || tick % Self::INTERVAL_TICKS == Self::INTERVAL_TICKS / 2
    }
}
