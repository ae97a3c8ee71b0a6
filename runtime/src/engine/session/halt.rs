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

/// Longest hold that ends by itself [ns]. What lasts longer is no short gap any more, and the operator decides.
const MAX_HOLD: i64 = 1_000_000_000;

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
    /// Time from which a hold counts [ns].
    since: i64,
    /// The halts so far, at most [`MAX_HALTS`].
    pub(crate) list: Vec<Halt>,
    /// Number of halts beyond [`MAX_HALTS`].
    pub(crate) unlisted: u64,
    /// Whether the operator has asked to resume.
    pub(crate) resumes: bool,
}

impl HaltMachine {
    pub(crate) const fn new() -> Self {
        Self { state: HaltState::Running, since: 0, list: Vec::new(), unlisted: 0, resumes: false }
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

    /// Starts a halt of a task, whose name is empty for the graph itself. A halt that gets another reason goes on: a hold
    /// counts from the first one, and a stop stays a stop.
    pub(crate) fn halt(&mut self, task: &str, policy: Policy, fault: Fault) {
        self.end(fault.time);
        if !self.is_halted() {
            self.since = fault.time;
        }
        match task {
            "" => tracing::warn!("{fault}: every command ramps to zero"),
            task => tracing::warn!("{fault}: the commands of `{task}` ramp to zero"),
        }
        if self.list.len() < MAX_HALTS {
            self.list.push(Halt { fault, policy, until: None });
        } else {
            self.unlisted += 1;
        }
        self.state = match (self.state, policy) {
            (HaltState::Stopped, _) | (_, Policy::Stop) => HaltState::Stopped,
            _ => HaltState::Held,
        };
    }

    /// Does not count the time of a hold up to `now` [ns].
    pub(crate) const fn wait(&mut self, now: i64) {
        self.since = now;
    }

    /// Ends the halt of a task if it can end after the tick at `now` [ns], and stops a task that has been held for too
    /// long. Returns whether the operator has resumed from a stop, so that the modes must restart.
    pub(crate) fn update(&mut self, task: &str, has_trouble: bool, now: i64) -> bool {
        let resumes = std::mem::take(&mut self.resumes);
        let previous = self.state;
        match (previous, has_trouble) {
            // Also if no tick came in the meantime.
            (HaltState::Held, _) if now - self.since > MAX_HOLD => {
                self.stop(task);
                return false;
            }
            (HaltState::Held, false) => self.state = HaltState::Running,
            (HaltState::Stopped, false) if resumes => self.state = HaltState::Running,
            _ => return false,
        }
        self.end(now);
        previous == HaltState::Stopped
    }

    /// Turns a hold into a stop.
    #[cold]
    fn stop(&mut self, task: &str) {
        self.state = HaltState::Stopped;
        if let Some(last) = self.list.last_mut().filter(|last| last.until.is_none()) {
            last.policy = Policy::Stop;
        }
        let resume = if task.is_empty() { "resume".to_owned() } else { format!("{task}.resume") };
        tracing::warn!("the commands have been held for more than 1 s, so they wait for `{resume}`");
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
            // A `resume` during the trouble has no effect, then or later.
            &[(stop, false, true), (stop, true, true), (None, false, true), (None, true, false)],
            &[(stop, false, true), (hold, true, true), (None, false, true), (None, true, false)],
            &[(stop, false, true), (None, true, false), (stop, false, true), (None, false, true), (None, true, false)],
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
                halts.update("", trouble.is_some(), 10);
                assert_eq!(halts.is_halted(), *is_halted, "step {i} of {case:?}");
            }
            assert!(halts.list.iter().all(|halt| halt.until.is_some()));
        }
    }

    #[test]
    fn a_hold_that_no_tick_ended_within_a_second_is_a_stop() {
        let mut halts = HaltMachine::new();
        halts.halt("", Policy::Hold, fault());
        halts.update("", true, 900_000_000);
        halts.update("", false, 5_000_000_000);
        assert!(halts.is_stopped());
        halts.halt("", Policy::Hold, fault());
        assert!(halts.is_stopped(), "a stop stays a stop");
    }

    #[test]
    fn a_hold_lasts_from_its_first_reason_on() {
        let mut halts = HaltMachine::new();
        halts.halt("", Policy::Hold, fault());
        halts.update("", true, 980_000_000);
        halts.halt("", Policy::Hold, Fault { time: 990_000_000, ..fault() });
        halts.update("", true, 1_010_000_000);
        assert!(halts.is_stopped());
        assert_eq!(halts.list.iter().map(|halt| halt.policy).collect::<Vec<_>>(), [Policy::Hold, Policy::Stop]);
        halts.resumes = true;
        halts.update("", false, 1_020_000_000);
        halts.halt("", Policy::Hold, Fault { time: 1_500_000_000, ..fault() });
        halts.update("", true, 2_030_000_000);
        assert!(!halts.is_stopped(), "another hold counts by itself");
    }

    #[test]
    fn a_hold_that_lasts_longer_than_a_second_becomes_a_stop() {
        // When its trouble is over, how much of that does not count, and whether it is a stop then [ms].
        for (over, waits, is_stopped) in [(990, 0, false), (1020, 0, true), (5000, 4500, false), (5000, 3900, true)] {
            let mut halts = HaltMachine::new();
            halts.halt("", Policy::Hold, fault());
            for now in (10..over).step_by(10) {
                if now <= waits {
                    halts.wait(now * 1_000_000);
                }
                halts.update("", true, now * 1_000_000);
            }
            halts.update("", false, over * 1_000_000);
            assert_eq!((halts.is_halted(), halts.is_stopped()), (is_stopped, is_stopped), "{over}, {waits}");
            let policy = if is_stopped { Policy::Stop } else { Policy::Hold };
            assert_eq!((halts.list[0].policy, halts.list.len()), (policy, 1));
        }
    }
}
