//! A stay in a mode: what is read in each of its ticks, and whether it was left too early.

/// Rows of one stay in a mode.
///
/// A pad can bounce at the first touch. So the mode may be left and entered again while the contact settles, and the
/// rows begin again.
#[derive(Debug)]
pub(super) struct Stay<R> {
    mode: String,
    /// Number of ticks in which the contact settles.
    settling: usize,
    /// Number of rows after which the mode may be left.
    wanted: usize,
    rows: Vec<R>,
    left: Option<String>,
}

impl<R> Stay<R> {
    pub(super) const fn new(mode: String, settling: usize, wanted: usize) -> Self {
        Self { mode, settling, wanted, rows: Vec::new(), left: None }
    }

    /// Reads a row in a tick, if the task is in the mode now and rows are missing.
    pub(super) fn see(&mut self, now: Option<&str>, read: impl FnOnce() -> R) {
        if self.rows.len() >= self.wanted {
            return;
        }
        if now != Some(&self.mode) {
            if !self.rows.is_empty() && self.left.is_none() {
                self.left = Some(now.unwrap_or("the end").to_owned());
            }
            return;
        }
        if self.left.is_some() && self.rows.len() <= self.settling {
            self.rows.clear();
            self.left = None;
        }
        if self.left.is_none() {
            self.rows.push(read());
        }
    }

    /// Returns the rows.
    pub(super) fn rows(&self) -> &[R] {
        &self.rows
    }

    /// Returns whether the mode was left while the contact settled, and not entered again.
    pub(super) const fn has_bounced(&self) -> bool {
        self.left.is_some() && self.rows.len() <= self.settling
    }

    /// Returns the mode to which the task went before there were enough rows.
    pub(super) fn left(&self) -> Option<&str> {
        self.left.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the ticks that count of a task that is in these modes, and the mode to which it went too early.
    fn stay(modes: &str) -> (Vec<usize>, Option<String>) {
        let stay = seen(modes);
        (stay.rows().to_vec(), stay.left().map(str::to_owned))
    }

    /// Follows a task that is in these modes.
    fn seen(modes: &str) -> Stay<usize> {
        let mut stay = Stay::new("s".to_owned(), 3, 6);
        for (tick, mode) in modes.char_indices() {
            let mode = mode.to_string();
            stay.see((mode != "-").then_some(&mode), || tick);
        }
        stay
    }

    #[test]
    fn a_bounce_while_the_contact_settles_begins_the_stay_again() {
        for (modes, rows) in [("ppssssssss", 2..8), ("pssspssssssss", 5..11), ("spspssssss", 4..10), ("ssssssll", 0..6)]
        {
            assert_eq!(stay(modes), (rows.collect(), None), "{modes}");
        }
    }

    #[test]
    fn a_pad_has_bounced_if_the_mode_is_left_while_the_contact_settles_and_not_entered_again() {
        for (modes, bounced) in [("pssl", true), ("psssl", true), ("pssssl", false), ("psspss", false), ("ppp", false)]
        {
            assert_eq!(seen(modes).has_bounced(), bounced, "{modes}");
        }
    }

    #[test]
    fn a_stay_that_is_left_while_it_is_measured_does_not_begin_again() {
        let left = |mode: &str| Some(mode.to_owned());
        for (modes, rows, to) in [
            ("sssspsssssss", 0..4, left("p")),
            ("psspp", 1..3, left("p")),
            ("pss-", 1..3, left("the end")),
            ("pssss", 1..5, None),
            ("ppp", 0..0, None),
        ] {
            assert_eq!(stay(modes), (rows.collect(), to), "{modes}");
        }
    }
}
