//! The tick: latch, step, commit. One thread, a fixed order, no queue, no lock, no allocation, no `async`; and no clock
//! but the one that times the nodes in a few of the ticks.

use std::time::{Duration, Instant};

use super::Deck;
use super::command::{CommandSlot, ReportSlot};
use super::inlet::Inlet;
use super::station::Station;
use crate::graph::Policy;
use crate::node::{Bus, Tick};

/// Everything a tick touches.
pub(super) struct Core {
    pub(super) bus: Bus,
    pub(super) inlets: Vec<Inlet>,
    pub(super) tick: Tick,
    stations: Vec<Station>,
    slots: Vec<CommandSlot>,
    told: Vec<ReportSlot>,
    /// The station that steps: what a panic is blamed on.
    current: usize,
}

impl Core {
    pub(super) fn new(
        bus: Bus,
        stations: Vec<Station>,
        inlets: Vec<Inlet>,
        (slots, told): (Vec<CommandSlot>, Vec<ReportSlot>),
        tick: Tick,
    ) -> Self {
        Self { bus, inlets, tick, stations, slots, told, current: 0 }
    }

    /// Moves on to the tick at `now`.
    pub(super) fn begin(&mut self, now: i64) {
        let dt = if self.tick.index == 0 { 0.0 } else { (now - self.tick.now) as f64 * 1e-9 };
        self.tick = Tick { index: self.tick.index + 1, now, dt, ..self.tick };
    }

    /// Steps the nodes, each at most once. Whether all values are finite.
    pub(super) fn run(&mut self, timing: &mut Timing) -> bool {
        if timing.is_due(self.tick.index) {
            self.step_timed(timing);
        } else {
            self.step();
        }
        self.bus.arenas.are_finite()
    }

    /// A tick without what guards and measures it: latch, step, commit.
    pub(super) fn run_bare(&mut self, decks: &mut [Deck]) {
        self.latch(decks);
        self.step();
        self.commit(decks, false);
    }

    /// Takes the newest samples over.
    pub(super) fn latch(&mut self, decks: &mut [Deck]) {
        for inlet in &mut self.inlets {
            inlet.latch(&mut decks[inlet.device].samples, &mut self.bus, self.tick.index, self.tick.now);
        }
    }

    fn step(&mut self) {
        for (i, station) in self.stations.iter_mut().enumerate() {
            self.current = i;
            station.visit(&mut self.tick, &mut self.bus);
        }
    }

    fn step_timed(&mut self, timing: &mut Timing) {
        let mut before = Instant::now();
        for (i, station) in self.stations.iter_mut().enumerate() {
            self.current = i;
            station.visit(&mut self.tick, &mut self.bus);
            let after = Instant::now();
            timing.nodes[i].add(after - before);
            before = after;
        }
        timing.ticks += 1;
    }

    /// The sample that is too old now and whose policy is the strictest.
    pub(super) fn stale(&self) -> Option<(Policy, usize)> {
        let stale = self.inlets.iter().enumerate().filter(|(_, inlet)| inlet.is_stale(self.tick.now));
        stale.map(|(i, inlet)| (inlet.stale, i)).max_by_key(|(policy, _)| *policy)
    }

    /// Hands over the commands, or lets them go to zero; and what is reported.
    pub(super) fn commit(&mut self, decks: &mut [Deck], is_halted: bool) {
        for slot in &mut self.slots {
            slot.commit(&self.bus, &mut decks[slot.device].commands, &self.tick, is_halted);
        }
        for report in &self.told {
            report.commit(&self.bus, &mut decks[report.device].commands, &self.tick);
        }
    }

    /// Ramps every command one step of `dt` [s] toward zero; whether all are zero. The nodes rest, so nothing is reported.
    pub(super) fn ramp(&mut self, decks: &mut [Deck], dt: f64) -> bool {
        decks.iter_mut().for_each(|deck| deck.commands.fall_silent());
        self.slots.iter_mut().fold(true, |still, slot| slot.ramp(&mut decks[slot.device].commands, dt) & still)
    }

    /// Makes what the devices last gave count as new once more.
    pub(super) fn refresh(&mut self, decks: &mut [Deck]) {
        for inlet in &mut self.inlets {
            inlet.refresh(&mut decks[inlet.device].samples, &mut self.bus, self.tick.now);
        }
    }

    /// Gives stations the configurations of another mode: by their places, the number of each.
    pub(super) fn switch(&mut self, configurations: &[(usize, usize)]) {
        for (place, configuration) in configurations {
            self.stations[*place].switch(*configuration);
        }
    }

    /// Makes the states of a station and of all that come after it fresh.
    pub(super) fn reset_from(&mut self, station: usize) {
        self.stations[station..].iter_mut().for_each(Station::reset);
    }

    /// The station that stepped last panicked: it waits for its reset.
    pub(super) fn break_down(&mut self) {
        self.stations[self.current].break_down(self.tick.now);
    }

    /// The first station that waits for its reset after a panic.
    pub(super) fn broken(&self) -> Option<usize> {
        self.stations.iter().position(Station::is_broken)
    }

    pub(super) const fn current(&self) -> usize {
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

    pub(super) fn new(nodes: usize) -> Self {
        Self { nodes: vec![NodeTime::default(); nodes], ticks: 0, every: Self::EVERY }
    }

    const fn is_due(&self, tick: u64) -> bool {
        tick % self.every == self.every / 2
    }
}
