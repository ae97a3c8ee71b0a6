//! Whether the clock of a publisher agrees with the one of this machine.
//!
//! The header of a command states when it was made. A controller that gets it late can drop it only if both clocks agree.
//! The stamps of the joint states show it: a message is never older than its delay, and never younger.

use std::time::{Duration, Instant};

/// How long the smallest difference holds.
const WINDOW: Duration = Duration::from_secs(1);
/// A difference that no drift explains [ns]: a year.
const YEAR: i64 = 365 * 24 * 3600 * 1_000_000_000;

/// The smallest differences between the arrival of a message and its stamp, in this window and in the one before [ns].
#[derive(Debug)]
pub(super) struct Agreement {
    bound: i64,
    begin: Instant,
    smallest: [Option<i64>; 2],
}

impl Agreement {
    /// `bound` is the largest difference of two clocks that agree [ns].
    pub(super) fn new(bound: i64, now: Instant) -> Self {
        Self { bound, begin: now, smallest: [None; 2] }
    }

    /// Takes a message that has arrived, with both times of the wall clock [ns].
    pub(super) fn hear(&mut self, now: Instant, arrived: i64, stamp: i64) {
        if now.duration_since(self.begin) > WINDOW {
            self.begin = now;
            self.smallest = [None, self.smallest[0]];
        }
        let difference = arrived - stamp;
        let smallest = self.smallest[0].filter(|smallest| smallest.abs() <= difference.abs());
        self.smallest[0] = Some(smallest.unwrap_or(difference));
    }

    /// Says why a controller could not recognize an old command. `None` if the clocks agree.
    pub(super) fn why_not(&self, topic: &str) -> Option<String> {
        let smallest = self.smallest.iter().flatten().copied().min_by_key(|difference| difference.abs());
        let Some(difference) = smallest else {
            return Some(format!("the messages of `{topic}` have no stamp, so the clocks cannot be compared"));
        };
        if difference.abs() > YEAR {
            let reason =
                "the publisher has another clock, such as that of a simulation: it must not have `use_sim_time`";
            return Some(format!("the stamps of `{topic}` are years away from the clock of this machine: {reason}"));
        }
        let (seconds, bound_ms) = (difference.abs() as f64 * 1e-9, self.bound as f64 * 1e-6);
        let side = if difference > 0 { "behind" } else { "ahead of" };
        (difference.abs() > self.bound).then(|| {
            format!(
                "the stamps of `{topic}` are {seconds:.3} s {side} the clock of this machine, and at most {bound_ms} ms are \
                 allowed, so that an old command is recognized: synchronize the clocks, or raise `clock_bound_ms`"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn clocks_agree_if_the_fastest_message_is_young() {
        let now = Instant::now();
        let cases = [
            (&[5 * MS, 300 * MS, 2 * MS][..], None),
            (&[], Some("have no stamp")),
            (&[300 * MS, 250 * MS], Some("0.250 s behind")),
            (&[-80 * MS], Some("0.080 s ahead of")),
            (&[56 * YEAR], Some("use_sim_time")),
        ];
        for (differences, expected) in cases {
            let mut agreement = Agreement::new(20 * MS, now);
            differences.iter().for_each(|difference| agreement.hear(now, 0, -difference));
            let why = agreement.why_not("/joint_states");
            match expected {
                None => assert_eq!(why, None),
                Some(text) => assert!(why.as_ref().is_some_and(|why| why.contains(text)), "{why:?}"),
            }
        }
    }

    #[test]
    fn a_clock_that_steps_away_is_noticed_after_two_windows() {
        let (begin, mut agreement) = (Instant::now(), Agreement::new(20 * MS, Instant::now()));
        for ms in 0..3000 {
            let difference = if ms < 1000 { MS } else { 500 * MS };
            agreement.hear(begin + Duration::from_millis(ms), 0, -difference);
        }
        assert!(agreement.why_not("/joint_states").is_some());
    }
}
