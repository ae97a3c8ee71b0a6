//! The course of a trial: its modes, one after the other, and what is read in each of them.

use super::lift;
use super::stay::Stay;

/// Rows of each mode of a trial.
#[derive(Debug)]
pub(super) struct Course<R> {
    /// The modes in their order.
    modes: Vec<String>,
    /// Index of the current one.
    at: usize,
    /// The first mode, which may be left and entered again while the contact settles.
    first: Stay<R>,
    /// Rows of the others.
    rows: Vec<Vec<R>>,
    /// How a mode of a step ended that has not gone on to the next one.
    unplanned: Option<String>,
}

impl<R> Course<R> {
    /// Follows modes in their order. In the first one, the contact settles for a number of ticks.
    pub(super) fn new(modes: Vec<String>, settling: usize) -> Self {
        let first = Stay::new(modes[0].clone(), settling, usize::MAX);
        let rows = modes.iter().map(|_| Vec::new()).collect();
        Self { modes, at: 0, first, rows, unplanned: None }
    }

    /// Reads a row in a tick, by the mode in which the task is now.
    pub(super) fn see(&mut self, now: Option<&str>, read: impl FnOnce() -> R) {
        let now = now.unwrap_or("the end");
        let is_next = self.modes.get(self.at + 1).is_some_and(|next| next == now);
        self.at += usize::from(is_next);
        if self.at == 0 {
            self.first.see(Some(now), read);
        } else if self.modes[self.at] == now {
            self.rows[self.at].push(read());
        } else if self.at + 1 < self.modes.len() {
            self.unplanned.get_or_insert_with(|| lift::left(&self.modes[self.at], now));
        }
    }

    /// Returns whether the first mode is over.
    pub(super) const fn has_stepped(&self) -> bool {
        self.at > 0
    }

    /// Returns whether the pad has bounced at the first touch, and the task has not found it again.
    pub(super) const fn has_bounced(&self) -> bool {
        self.first.has_bounced()
    }

    /// Returns the rows of a mode.
    pub(super) fn rows(&self, mode: &str) -> &[R] {
        match self.modes.iter().position(|one| one == mode) {
            Some(0) => self.first.rows(),
            Some(i) => &self.rows[i],
            None => &[],
        }
    }

    /// Returns why the task has left its course.
    pub(super) fn failure(&self) -> Option<String> {
        match (self.first.left(), &self.unplanned) {
            (Some(mode), _) => Some(lift::left(&self.modes[0], mode)),
            (_, Some(left)) => Some(format!("after a step of a setpoint, {left}")),
            _ if self.at + 1 < self.modes.len() => Some(format!("the run ended in the mode `{}`", self.modes[self.at])),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the ticks of each of the modes s, a and l, and why a task in these modes has left its course.
    fn course(modes: &str) -> ([Vec<usize>; 3], Option<String>) {
        let mut course = Course::new(["s", "a", "l"].map(str::to_owned).into(), 2);
        for (tick, mode) in modes.char_indices() {
            course.see((mode != '-').then_some(&mode.to_string()), || tick);
        }
        (["s", "a", "l"].map(|mode| course.rows(mode).to_vec()), course.failure())
    }

    #[test]
    fn each_mode_has_its_rows() {
        assert_eq!(course("ppssssaaall-"), ([(2..6).collect(), (6..9).collect(), (9..11).collect()], None));
        assert_eq!(course("spssssal"), ([(2..6).collect(), vec![6], vec![7]], None), "a bounce at the first touch");
    }

    #[test]
    fn a_mode_that_is_not_the_next_one_is_a_failure() {
        for (modes, why) in [
            ("pssssps", "the mode `s` was left for `p`"),
            ("pssssaapssssaal", "after a step of a setpoint, the mode `a` was left for `p`"),
            ("pssssaa-", "after a step of a setpoint, the mode `a` was left for `the end`"),
            ("pssss", "the run ended in the mode `s`"),
        ] {
            assert_eq!(course(modes).1.as_deref(), Some(why), "{modes}");
        }
    }
}
