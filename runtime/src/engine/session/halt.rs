//! The halt machine: holds the commands at zero while something is wrong.
//!
//! During a halt the nodes keep stepping, so the engine sees when the trouble is over. Every command ramps to zero and
//! stays there.

use crate::fault::Fault;
use crate::graph::Policy;

/// A period in which the commands were held at zero.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halt {
    /// The fault that started it.
    pub fault: Fault,
    /// The policy for that fault: hold or stop.
    pub policy: Policy,
    /// Time at which it ended [ns]; `None` while it lasts.
    pub until: Option<i64>,
}

/// A time in which one arm rested because a budget of its limiter was spent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rest {
    /// The role of the arm.
    pub role: String,
    /// Which limiter, and when.
    pub fault: Fault,
    /// Time at which the budget was refilled [ns]; `None` while it is spent.
    pub until: Option<i64>,
}

/// Number of halts that are kept for the summary.
const MAX_HALTS: usize = 1000;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum HaltState {
    /// The commands follow the graph.
    Running,
    /// The commands are zero until the trouble is over.
    Held,
    /// The commands are zero until the operator resumes.
    Stopped,
}

/// The state of the halt machine and the list of halts.
pub(crate) struct HaltMachine {
    state: HaltState,
    /// The halts so far, at most [`MAX_HALTS`].
    pub(crate) list: Vec<Halt>,
    /// Number of halts beyond [`MAX_HALTS`].
    pub(crate) unlisted: u64,
    /// Whether the operator has asked to resume.
    pub(crate) resumes: bool,
}

impl HaltMachine {
    pub(crate) const fn new() -> Self {
        Self { state: HaltState::Running, list: Vec::new(), unlisted: 0, resumes: false }
    }

    /// Whether the commands are zero or ramp to zero.
    pub(crate) fn is_halted(&self) -> bool {
        self.state != HaltState::Running
    }

    /// Whether the commands wait for the operator to resume.
    pub(crate) fn is_stopped(&self) -> bool {
        self.state == HaltState::Stopped
    }

    /// Whether a trouble with that policy starts a halt or turns a hold into a stop.
    pub(crate) fn is_escalated_by(&self, policy: Policy) -> bool {
        self.state == HaltState::Running || self.state == HaltState::Held && policy == Policy::Stop
    }

    /// Starts a halt of a task, whose name is empty for the graph itself. Call it only if the policy [escalates](Self::is_escalated_by) the state.
    pub(crate) fn halt(&mut self, task: &str, policy: Policy, fault: Fault) {
        self.end(fault.time);
        match task {
            "" => tracing::warn!("{fault}: every command ramps to zero"),
            task => tracing::warn!("{fault}: the commands of `{task}` ramp to zero"),
        }
        if self.list.len() < MAX_HALTS {
            self.list.push(Halt { fault, policy, until: None });
        } else {
            self.unlisted += 1;
        }
        self.state = if policy == Policy::Stop { HaltState::Stopped } else { HaltState::Held };
    }

    /// Ends the halt if it can end after the tick at `now` [ns]. Returns whether the operator has resumed from a stop,
    /// so that the modes must restart.
    pub(crate) fn update(&mut self, has_trouble: bool, now: i64) -> bool {
        let resumes = std::mem::take(&mut self.resumes);
        let previous = self.state;
        match (previous, has_trouble) {
            (HaltState::Held, false) => self.state = HaltState::Running,
            (HaltState::Stopped, false) if resumes => self.state = HaltState::Running,
            // The trouble is not over yet, so the stop becomes a hold.
            (HaltState::Stopped, true) if resumes => self.state = HaltState::Held,
            _ => return false,
        }
        if self.state == HaltState::Running {
            self.end(now);
        }
        previous == HaltState::Stopped
    }

    fn end(&mut self, now: i64) {
        if let Some(last) = self.list.last_mut().filter(|last| last.until.is_none()) {
            last.until = Some(now);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::Cause;

    fn fault() -> Fault {
        let cause = Cause::NotFinite;
        Fault { node: "a".into(), port: None, tick: 1, time: 5, cause, place: String::new() }
    }

    #[test]
    fn a_hold_ends_with_its_trouble_and_a_stop_when_the_operator_resumes() {
        // Policy of the trouble in a tick, whether the operator resumes, and whether the commands are halted afterwards.
        let (hold, stop) = (Some(Policy::Hold), Some(Policy::Stop));
        let cases: [&[(Option<Policy>, bool, bool)]; 6] = [
            &[(hold, false, true), (hold, false, true), (None, false, false)],
            &[(stop, false, true), (None, false, true), (None, true, false)],
            &[(hold, false, true), (stop, false, true), (None, false, true), (None, true, false)],
            &[(stop, false, true), (stop, true, true), (None, false, false)],
            // A stop after the resume is a new stop.
            &[(stop, false, true), (stop, true, true), (stop, false, true), (None, false, true), (None, true, false)],
            &[(stop, false, true), (hold, false, true), (None, false, true), (None, true, false), (None, false, false)],
        ];
        for case in cases {
            let mut halts = HaltMachine::new();
            for (i, (trouble, resumes, is_halted)) in case.iter().enumerate() {
                if let Some(policy) = trouble.filter(|policy| halts.is_escalated_by(*policy)) {
                    halts.halt("", policy, fault());
                }
                if *resumes {
                    halts.resumes = true;
                }
                halts.update(trouble.is_some(), 10);
                assert_eq!(halts.is_halted(), *is_halted, "step {i} of {case:?}");
            }
            assert!(halts.list.iter().all(|halt| halt.until.is_some()));
        }
    }
}
