//! Why commands are held: a small machine that each trouble of a tick is told to. While it halts, nodes go on stepping, so
//! that the trouble can be seen to be over, but every command ramps to zero and stays there.

use crate::fault::Fault;
use crate::graph::Policy;

/// A time in which the commands were held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Halt {
    /// What began it.
    pub fault: Fault,
    /// What was done about it.
    pub policy: Policy,
    /// When it was over [ns]; not yet, if none.
    pub until: Option<i64>,
}

/// As many halts are remembered.
const MOST: usize = 1000;

/// What the commands do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// They follow the graph.
    Running,
    /// They are zero until the trouble is over.
    Held,
    /// They are zero until the operator lets them go on.
    Stopped,
}

/// The machine, and all that it went through.
pub(crate) struct Halts {
    state: State,
    list: Vec<Halt>,
    /// Halts that are not in the list any more.
    pub(crate) more: u64,
    /// Whether the operator has asked to go on.
    resumes: bool,
}

impl Halts {
    pub(crate) const fn new() -> Self {
        Self { state: State::Running, list: Vec::new(), more: 0, resumes: false }
    }

    /// Whether commands go to zero.
    pub(crate) fn is_halted(&self) -> bool {
        self.state != State::Running
    }

    /// Whether only the operator lets them go on.
    pub(crate) fn is_stopped(&self) -> bool {
        self.state == State::Stopped
    }

    /// The operator lets the commands go on.
    pub(crate) const fn resume(&mut self) {
        self.resumes = true;
    }

    /// The operator wants a stop: what was said before of going on holds no more.
    pub(crate) const fn stop(&mut self) {
        self.resumes = false;
    }

    /// Everything so far.
    pub(crate) fn list(&self) -> &[Halt] {
        &self.list
    }

    /// Whether a trouble with that policy halts anew, or makes wait for the operator what would have gone on by itself.
    pub(crate) fn is_news(&self, policy: Policy) -> bool {
        self.state == State::Running || self.state == State::Held && policy == Policy::Stop
    }

    /// Halts because of a trouble that [is news](Self::is_news).
    pub(crate) fn trouble(&mut self, policy: Policy, fault: Fault) {
        self.end(fault.time);
        tracing::warn!("{fault}: every command goes to zero");
        if self.list.len() < MOST {
            self.list.push(Halt { fault, policy, until: None });
        } else {
            self.more += 1;
        }
        self.state = if policy == Policy::Stop { State::Stopped } else { State::Held };
    }

    /// The tick at `now` had a trouble or not: whether the commands go on from a stop, and so from the start.
    pub(crate) fn settle(&mut self, has_trouble: bool, now: i64) -> bool {
        let resumes = std::mem::take(&mut self.resumes);
        let was = self.state;
        match (was, has_trouble) {
            (State::Held, false) => self.state = State::Running,
            (State::Stopped, false) if resumes => self.state = State::Running,
            // It goes on by itself as soon as the trouble is over.
            (State::Stopped, true) if resumes => self.state = State::Held,
            _ => return false,
        }
        if self.state == State::Running {
            self.end(now);
        }
        was == State::Stopped
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
    fn a_hold_ends_with_its_trouble_and_a_stop_with_the_operators_word() {
        // Policy of the trouble in a tick, whether the operator says to go on, and whether commands are halted after.
        let (hold, stop) = (Some(Policy::Hold), Some(Policy::Stop));
        let cases: [&[(Option<Policy>, bool, bool)]; 6] = [
            &[(hold, false, true), (hold, false, true), (None, false, false)],
            &[(stop, false, true), (None, false, true), (None, true, false)],
            &[(hold, false, true), (stop, false, true), (None, false, true), (None, true, false)],
            &[(stop, false, true), (stop, true, true), (None, false, false)],
            // What stops anew after the word is a new stop.
            &[(stop, false, true), (stop, true, true), (stop, false, true), (None, false, true), (None, true, false)],
            &[(stop, false, true), (hold, false, true), (None, false, true), (None, true, false), (None, false, false)],
        ];
        for case in cases {
            let mut halts = Halts::new();
            for (i, (trouble, resumes, is_halted)) in case.iter().enumerate() {
                if let Some(policy) = trouble.filter(|policy| halts.is_news(*policy)) {
                    halts.trouble(policy, fault());
                }
                if *resumes {
                    halts.resume();
                }
                halts.settle(trouble.is_some(), 10);
                assert_eq!(halts.is_halted(), *is_halted, "step {i} of {case:?}");
            }
            assert!(halts.list().iter().all(|halt| halt.until.is_some()));
        }
    }
}
