//! Warnings of a driver that comes upon the same thing again and again.

use std::time::{Duration, Instant};

/// Shortest time between two warnings: not more often than a person reads.
const PAUSE: Duration = Duration::from_secs(5);

/// Says when the next warning is due.
#[derive(Debug, Default)]
pub(crate) struct Seldom(Option<Instant>);

impl Seldom {
    /// Returns whether a warning is due, which it is then not for a while.
    pub(crate) fn is_due(&mut self) -> bool {
        let is_due = self.0.is_none_or(|last| last.elapsed() >= PAUSE);
        if is_due {
            self.0 = Some(Instant::now());
        }
        is_due
    }
}
