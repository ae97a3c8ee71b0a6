//! The time between two attempts to connect.

use std::time::Duration;

use tactflow_runtime::device::Link;
use tokio::time::sleep;

/// Time before the second attempt.
const FIRST: Duration = Duration::from_millis(50);
/// Longest time between two attempts.
const LONGEST: Duration = Duration::from_secs(2);

/// Waits that double up to two seconds.
#[derive(Debug)]
pub(crate) struct Backoff {
    next: Duration,
}

impl Backoff {
    pub(crate) const fn new() -> Self {
        Self { next: FIRST }
    }

    /// Returns the time to wait now.
    fn wait(&mut self) -> Duration {
        let wait = self.next;
        self.next = (2 * wait).min(LONGEST);
        wait
    }

    /// Waits, and returns whether the run goes on.
    pub(crate) async fn pause(&mut self, link: &Link) -> bool {
        tokio::select! {
            () = link.stopped() => false,
            () = sleep(self.wait()) => true,
        }
    }

    /// Begins again, after a success.
    pub(crate) fn reset(&mut self) {
        self.next = FIRST;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_two_seconds_and_begin_again_after_a_success() {
        let mut backoff = Backoff::new();
        let waits: Vec<u128> = (0..8).map(|_| backoff.wait().as_millis()).collect();
        assert_eq!(waits, [50, 100, 200, 400, 800, 1600, 2000, 2000]);
        backoff.reset();
        assert_eq!(backoff.wait().as_millis(), 50);
    }
}
