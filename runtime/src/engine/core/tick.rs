//! The tick: latch, step, commit. One thread, a fixed order, no queue, no lock, no allocation, no `async`; and no clock
//! but the one that times the nodes in a few of the ticks.

use std::time::{Duration, Instant};

use super::command::{CommandSlot, ReportSlot};
use super::inlet::Inlet;
use super::runner::NodeRunner;
use super::slot::DeviceSlot;
use crate::graph::Policy;
use crate::node::{Bus, Tick};

/// Everything a tick touches.
pub(crate) struct Core {
    pub(crate) bus: Bus,
    pub(crate) inlets: Vec<Inlet>,
    pub(crate) tick: Tick,
    runners: Vec<NodeRunner>,
    slots: Vec<CommandSlot>,
    told: Vec<ReportSlot>,
    /// The runner that steps: what a panic is blamed on.
    current: usize,
}

impl Core {
    pub(crate) fn new(
        bus: Bus,
        runners: Vec<NodeRunner>,
        inlets: Vec<Inlet>,
        (slots, told): (Vec<CommandSlot>, Vec<ReportSlot>),
        tick: Tick,
    ) -> Self {
        Self { bus, inlets, tick, runners, slots, told, current: 0 }
    }

    /// Moves on to the tick at `now`.
    pub(crate) fn begin(&mut self, now: i64) {
        let dt = if self.tick.index == 0 { 0.0 } else { (now - self.tick.now) as f64 * 1e-9 };
        self.tick = Tick { index: self.tick.index + 1, now, dt, ..self.tick };
    }

    /// Steps the nodes, each at most once. Whether all values are finite.
    pub(crate) fn run(&mut self, timing: &mut Timing) -> bool {
        if timing.is_due(self.tick.index) {
            self.step_timed(timing);
        } else {
            self.step();
        }
        self.bus.arenas.are_finite()
    }

    /// A tick without what guards and measures it: latch, step, commit.
    pub(crate) fn run_bare(&mut self, devices: &mut [DeviceSlot]) {
        self.latch(devices);
        self.step();
        self.commit(devices, false);
    }

    /// Takes over the newest samples of the devices that have not failed.
    pub(crate) fn latch(&mut self, devices: &mut [DeviceSlot]) {
        for inlet in &mut self.inlets {
            let device = &mut devices[inlet.device];
            if device.failed.is_none() {
                inlet.latch(&mut device.samples, &mut self.bus, self.tick.index, self.tick.now);
            }
        }
    }

    fn step(&mut self) {
        for (i, runner) in self.runners.iter_mut().enumerate() {
            self.current = i;
            runner.visit(&mut self.tick, &mut self.bus);
        }
    }

    fn step_timed(&mut self, timing: &mut Timing) {
        let mut before = Instant::now();
        for (i, runner) in self.runners.iter_mut().enumerate() {
            self.current = i;
            runner.visit(&mut self.tick, &mut self.bus);
            let after = Instant::now();
            timing.nodes[i].add(after - before);
            before = after;
        }
        timing.ticks += 1;
    }

    /// The sample that is too old now and whose policy is the strictest.
    pub(crate) fn stale(&self) -> Option<(Policy, usize)> {
        let stale = self.inlets.iter().enumerate().filter(|(_, inlet)| inlet.is_stale(self.tick.now));
        stale.map(|(i, inlet)| (inlet.stale, i)).max_by_key(|(policy, _)| *policy)
    }

    /// Hands over the commands, or lets them go to zero; and what is reported.
    pub(crate) fn commit(&mut self, devices: &mut [DeviceSlot], is_halted: bool) {
        for slot in &mut self.slots {
            slot.commit(&self.bus, &mut devices[slot.device].commands, &self.tick, is_halted);
        }
        for report in &self.told {
            report.commit(&self.bus, &mut devices[report.device].commands, &self.tick);
        }
    }

    /// Ramps every command one step of `dt` [s] toward zero; whether all are zero. The nodes rest, so nothing is reported.
    pub(crate) fn ramp(&mut self, devices: &mut [DeviceSlot], dt: f64) -> bool {
        devices.iter_mut().for_each(|device| device.commands.fall_silent());
        self.slots.iter_mut().fold(true, |still, slot| slot.ramp(&mut devices[slot.device].commands, dt) & still)
    }

    /// Makes what the devices last gave count as new once more.
    pub(crate) fn refresh(&mut self, devices: &mut [DeviceSlot]) {
        for inlet in &mut self.inlets {
            inlet.refresh(&mut devices[inlet.device].samples, &mut self.bus, self.tick.now);
        }
    }

    /// Gives runners the configurations of another mode: by their places, the number of each.
    pub(crate) fn switch(&mut self, configurations: &[(usize, usize)]) {
        for (place, configuration) in configurations {
            self.runners[*place].switch(*configuration);
        }
    }

    /// Makes the states of a runner and of all that come after it fresh.
    pub(crate) fn reset_from(&mut self, runner: usize) {
        self.runners[runner..].iter_mut().for_each(NodeRunner::reset);
    }

    /// The runner that stepped last panicked: it waits for its reset.
    pub(crate) fn break_down(&mut self) {
        self.runners[self.current].break_down(self.tick.now);
    }

    /// The first runner that waits for its reset after a panic.
    pub(crate) fn broken(&self) -> Option<usize> {
        self.runners.iter().position(NodeRunner::is_broken)
    }

    pub(crate) const fn current(&self) -> usize {
        self.current
    }
}

/// How long one node took.
#[derive(Debug, Clone, Copy, Default)]
pub struct NodeTime {
    /// Sum over the ticks that were timed.
    pub total: Duration,
    /// Longest of them.
    pub longest: Duration,
}

impl NodeTime {
    fn add(&mut self, time: Duration) {
        self.total += time;
        self.longest = self.longest.max(time);
    }
}

/// How long the nodes took, in a few of the ticks: a stamp at every node of every tick would cost more than the nodes.
#[derive(Debug, Clone)]
pub struct Timing {
    /// Each node, in the order in which they step.
    pub nodes: Vec<NodeTime>,
    /// How many ticks were timed.
    pub ticks: u64,
    every: u64,
}

impl Timing {
    /// One tick of as many is timed.
    const EVERY: u64 = 64;

    pub(crate) fn new(nodes: usize) -> Self {
        Self { nodes: vec![NodeTime::default(); nodes], ticks: 0, every: Self::EVERY }
    }

    const fn is_due(&self, tick: u64) -> bool {
        tick % self.every == self.every / 2
    }
}
