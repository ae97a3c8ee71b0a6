//! The tasks of a run: the graph itself and the parts that are tasks, each with modes, halts and an end of its own.

use super::halt::{Halt, HaltMachine};
use super::trouble::Trouble;
use crate::engine::core::{ModeChange, ModeMachine};
use crate::fault::Fault;
use crate::graph::{PlannedTask, Policy, PolicyTable};
use crate::node::{Bus, PortId, Tick};
use crate::signal::{Flag, Stamp};

/// How a task ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TaskEnd {
    /// A `done` condition of a mode holds, or the task around it is done.
    Done,
    /// A fault ended it, or the task around it.
    Failed(Box<Fault>),
}

/// A task of a run.
pub struct TaskRun {
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    pub(super) modes: Option<ModeMachine>,
    pub(super) policy: PolicyTable,
    pub(super) halts: HaltMachine,
    /// The trouble of this tick with the strictest policy.
    pub(super) trouble: Option<(Policy, Trouble)>,
    /// The trouble of the last tick, if it had one.
    pub(super) lasting: Option<Trouble>,
    /// An operator word that the modes have not processed yet.
    pub(super) sent: Option<String>,
    pub(super) end: Option<TaskEnd>,
    /// Whether it has commands or modes, so that the run waits for its end.
    pub(super) is_active: bool,
    /// Whether its failure ends the run.
    pub(super) ends_run: bool,
    /// The flags of its modes: the number of the mode, and the port.
    flags: Vec<(usize, PortId)>,
}

impl TaskRun {
    pub(super) fn new(planned: PlannedTask, modes: Option<ModeMachine>, flags: Vec<(usize, PortId)>) -> Self {
        let PlannedTask { name, parent, policy, is_active, ends_run, .. } = planned;
        let (halts, trouble, lasting, sent, end) = (HaltMachine::new(), None, None, None, None);
        Self { name, parent, modes, policy, halts, trouble, lasting, sent, end, is_active, ends_run, flags }
    }

    /// Returns the full name of the task; it is empty for the graph itself.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the name of the mode of the next tick, or `None` for a task without modes.
    #[must_use]
    pub fn mode(&self) -> Option<&str> {
        self.modes.as_ref().map(ModeMachine::name)
    }

    /// Returns the number of the mode of the next tick, from 0 in the order of the file.
    #[must_use]
    pub fn mode_number(&self) -> Option<usize> {
        self.modes.as_ref().map(ModeMachine::number)
    }

    /// Returns the names of its modes, in the order of the file.
    pub fn mode_names(&self) -> impl Iterator<Item = &str> {
        self.modes.iter().flat_map(ModeMachine::names)
    }

    /// Returns the mode changes so far, the start mode first.
    #[must_use]
    pub fn changes(&self) -> Vec<ModeChange> {
        self.modes.iter().flat_map(ModeMachine::changes).collect()
    }

    /// Returns the halts so far, at most 1000.
    #[must_use]
    pub fn halts(&self) -> &[Halt] {
        &self.halts.list
    }

    /// Returns the number of halts beyond those that [`halts`](Self::halts) lists.
    #[must_use]
    pub const fn unlisted_halts(&self) -> u64 {
        self.halts.unlisted
    }

    /// Returns how the task ended, or `None` while it goes on.
    #[must_use]
    pub const fn end(&self) -> Option<&TaskEnd> {
        self.end.as_ref()
    }

    /// Returns the time at which the task ended [ns], if it ended by a fault.
    #[must_use]
    pub fn ended_at(&self) -> Option<i64> {
        match self.end() {
            Some(TaskEnd::Failed(fault)) => Some(fault.time),
            _ => None,
        }
    }

    /// Whether it has commands or modes, so that the run waits for its end.
    #[must_use]
    pub const fn is_active(&self) -> bool {
        self.is_active
    }

    /// Whether its commands are zero or ramp to zero because of a halt.
    #[must_use]
    pub fn is_halted(&self) -> bool {
        self.halts.is_halted()
    }

    /// Whether its commands are zero or ramp to zero, because of a halt or because it has ended.
    #[must_use]
    pub fn is_resting(&self) -> bool {
        self.halts.is_halted() || self.end.is_some()
    }

    /// Whether its commands wait for the operator to resume.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.halts.is_stopped() && self.end.is_none()
    }

    /// Whether the run waits for its end.
    pub(super) const fn is_awaited(&self) -> bool {
        self.is_active && self.end.is_none()
    }

    /// Returns the operator words that its modes accept.
    pub(super) fn words(&self) -> impl Iterator<Item = &str> {
        self.modes.iter().flat_map(ModeMachine::words)
    }

    /// Keeps a trouble of this tick. Of several, the one with the strictest policy is kept.
    pub(super) fn keep(&mut self, policy: Policy, trouble: Trouble) {
        if self.trouble.is_none_or(|(known, _)| policy > known) {
            self.trouble = Some((policy, trouble));
        }
    }

    /// Writes the flags of the modes in which the task is since the last tick. A task that has ended, or that waits for
    /// the operator, is in no mode.
    pub(super) fn show_mode(&self, bus: &mut Bus, tick: &Tick) {
        let is_running = self.end.is_none() && !self.halts.is_stopped();
        for (mode, port) in &self.flags {
            let is_in = is_running && self.mode_number() == Some(*mode);
            *bus.slot_mut::<Flag>(*port) = is_in;
            bus.mark_mut(*port).renew(tick.index, Stamp::TIMELESS);
        }
    }
}
