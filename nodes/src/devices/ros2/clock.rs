//! Whether the clock of a publisher agrees with the one of this machine.
//!
//! The header of a command states when it was made. A controller that gets it late can drop it only if both clocks agree.
//! The stamps of its messages show it: a message is never older than its delay, and never younger. One that comes before it
//! was made shows at once that the clocks differ. One that comes late may have been delayed, so that takes several.

use std::time::{Duration, Instant};

/// Shortest time over which messages that come late are those of another clock, and smallest number of them.
const WINDOW: Duration = Duration::from_millis(100);
const MIN_MESSAGES: u32 = 5;
/// How long a message from the future is remembered.
const MEMORY: Duration = Duration::from_millis(500);
/// A difference that no drift explains [ns]: a year.
const YEAR: i64 = 365 * 24 * 3600 * 1_000_000_000;

/// The differences between the arrival of a message and its stamp [ns].
#[derive(Debug)]
pub(super) struct Agreement {
    bound: i64,
    begin: Instant,
    /// Number of messages in this window.
    messages: u32,
    /// The smallest in this window and in the one before.
    smallest: [Option<i64>; 2],
    /// The newest one below the bound: a message that came before it was made.
    ahead: Option<(Instant, i64)>,
}

impl Agreement {
    /// `bound` is the largest difference of two clocks that agree [ns].
    pub(super) fn new(bound: i64, now: Instant) -> Self {
        Self { bound, begin: now, messages: 0, smallest: [None; 2], ahead: None }
    }

    /// Takes a message that has arrived, with both times of the wall clock [ns].
    pub(super) fn hear(&mut self, now: Instant, arrived: i64, stamp: i64) {
        if now.duration_since(self.begin) > WINDOW && self.messages >= MIN_MESSAGES {
            (self.begin, self.messages) = (now, 0);
            self.smallest = [None, self.smallest[0]];
        }
        self.messages += 1;
        let difference = arrived.saturating_sub(stamp);
        let smallest = self.smallest[0].filter(|smallest| smallest.abs() <= difference.abs());
        self.smallest[0] = Some(smallest.unwrap_or(difference));
        if difference < -self.bound {
            self.ahead = Some((now, difference));
        }
        self.ahead.take_if(|(at, _)| now.duration_since(*at) > MEMORY);
    }

    /// Says why a controller could not recognize an old command. `None` if the clocks agree.
    pub(super) fn why_not(&self, topic: &str) -> Option<String> {
        let smallest = self.smallest.iter().flatten().copied().min_by_key(|difference| difference.abs());
        let Some(difference) = self.ahead.map(|(_, difference)| difference).or(smallest) else {
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

    /// Messages every 2 ms, each 1 ms old, and a clock that steps at one second: when it is noticed [ms].
    fn noticed(step: i64) -> Option<u64> {
        let (begin, mut agreement) = (Instant::now(), Agreement::new(20 * MS, Instant::now()));
        (0..3000).step_by(2).find(|ms| {
            let difference = if *ms < 1000 { MS } else { MS + step };
            agreement.hear(begin + Duration::from_millis(*ms), 0, -difference);
            agreement.why_not("/joint_states").is_some()
        })
    }

    #[test]
    fn a_clock_that_steps_is_noticed_at_once_or_as_soon_as_it_is_no_delay() {
        assert_eq!(noticed(0), None);
        assert_eq!(noticed(-500 * MS), Some(1000));
        let back = noticed(500 * MS).unwrap();
        assert!((1100..1300).contains(&back), "{back} ms");
    }

    #[test]
    fn a_few_messages_that_are_delayed_are_no_other_clock() {
        let (begin, mut agreement) = (Instant::now(), Agreement::new(20 * MS, Instant::now()));
        // Slow messages: a window has five of them.
        for (i, difference) in [1, 1, 1, 1, 1, 300, 300, 300, 1].into_iter().enumerate() {
            agreement.hear(begin + Duration::from_millis(100 * i as u64), 0, -difference * MS);
            assert_eq!(agreement.why_not("/joint_states"), None, "message {i}");
        }
    }

    #[test]
    fn a_message_from_the_future_is_forgotten() {
        let (begin, mut agreement) = (Instant::now(), Agreement::new(20 * MS, Instant::now()));
        agreement.hear(begin, 0, 80 * MS);
        assert!(agreement.why_not("/joint_states").is_some());
        agreement.hear(begin + Duration::from_millis(600), 0, -MS);
        assert_eq!(agreement.why_not("/joint_states"), None);
    }
}
