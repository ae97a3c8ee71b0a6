//! When the ticks of a run in real time began, as data: a histogram of their lateness, the latest, and what made it late.

use std::time::Duration;

/// When a tick began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beginning {
    /// Time since the start of the run [ns].
    pub time: i64,
    /// Wall clock: time since 1970 in UTC [ns].
    pub wall: i64,
    /// How late it began [ns].
    pub by: i64,
}

/// A tick that began late.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LateTick {
    /// When it began [ns].
    pub time: i64,
    /// How late that was [ns].
    pub by: i64,
    /// What took the time before; `None` if that was not measured.
    pub cause: Option<TickUse>,
}

/// What took the time from the beginning of one tick to that of the next.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TickUse {
    /// When the tick began [ns].
    pub time: i64,
    /// Time to the beginning of the next tick.
    pub lasted: Duration,
    /// The node or the device that took longest, for a message: "node `filter`".
    pub slowest: String,
    /// How long it took.
    pub took: Duration,
    /// How long all nodes and devices took together.
    pub together: Duration,
    /// How long the output took: the summary, the log, the recording and the display.
    pub output: Duration,
}

impl TickUse {
    /// Whether one node or device took at least half of the time.
    #[must_use]
    pub fn has_culprit(&self) -> bool {
        self.took * 2 >= self.lasted
    }
}

/// When the ticks of a run in real time began, how late they were, and what made them late.
#[derive(Debug, Clone, Default)]
pub struct Punctuality {
    /// The last tick.
    pub(super) last: Option<Beginning>,
    /// Number of ticks by their lateness: below each of [`BOUNDS_NS`](Self::BOUNDS_NS), and above the last.
    pub counts: [u64; Self::BOUNDS_NS.len() + 1],
    /// The tick that was latest.
    pub worst: LateTick,
    /// Each node or device that alone made ticks late, with the longest time that it took.
    pub culprits: Vec<(String, Duration)>,
    /// How long the output of the last tick took.
    pub(super) output: Duration,
    /// Time of each device in the last tick.
    pub(super) devices: Vec<Duration>,
}

impl Punctuality {
    /// Bounds of the histogram of lateness [ns].
    pub const BOUNDS_NS: [i64; 5] = [100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];

    /// Counts a tick. `cause` is what made it late.
    pub(super) fn count(&mut self, began: Beginning, cause: Option<TickUse>) {
        let Beginning { time, by, .. } = began;
        if let Some(cause) = cause.as_ref().filter(|cause| cause.has_culprit()) {
            match self.culprits.iter_mut().find(|(name, _)| *name == cause.slowest) {
                Some((_, longest)) => *longest = cause.took.max(*longest),
                None => self.culprits.push((cause.slowest.clone(), cause.took)),
            }
        }
        let bin = Self::BOUNDS_NS.iter().position(|bound| by < *bound).unwrap_or(Self::BOUNDS_NS.len());
        self.counts[bin] += 1;
        if by > self.worst.by {
            self.worst = LateTick { time, by, cause };
        }
        self.last = Some(began);
    }

    /// Notes how long a device took in this tick.
    pub(super) fn device_took(&mut self, device: usize, time: Duration) {
        if self.devices.len() <= device {
            self.devices.resize(device + 1, Duration::ZERO);
        }
        self.devices[device] = time;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tick_is_counted_by_its_lateness() {
        let mut punctuality = Punctuality::default();
        for (time, by) in [(0, 0), (5, 99_999), (7, 100_000), (9, 999_999), (20, 12_000_000), (30, 10_000_000)] {
            punctuality.count(Beginning { time, wall: 0, by }, None);
        }
        assert_eq!(punctuality.counts, [2, 1, 1, 0, 0, 2]);
        assert_eq!(punctuality.worst, LateTick { time: 20, by: 12_000_000, cause: None });
    }

    #[test]
    fn the_latest_tick_keeps_its_own_cause_and_every_culprit_is_listed() {
        let use_of = |slowest: &str, took_ms, lasted_ms| TickUse {
            slowest: slowest.into(),
            took: Duration::from_millis(took_ms),
            lasted: Duration::from_millis(lasted_ms),
            ..TickUse::default()
        };
        let mut punctuality = Punctuality::default();
        for (time, by, cause) in [
            (1, 9, Some(use_of("a", 9, 10))),
            (2, 50, Some(use_of("c", 15, 60))),
            (3, 20, Some(use_of("b", 20, 20))),
            (4, 8, Some(use_of("a", 11, 12))),
            (5, 5, None),
        ] {
            punctuality.count(Beginning { time, wall: 0, by: by * 1_000_000 }, cause);
        }
        let worst = punctuality.worst;
        assert_eq!((worst.time, worst.cause.map(|cause| cause.slowest)), (2, Some("c".into())));
        let ms = Duration::from_millis;
        assert_eq!(punctuality.culprits, [("a".into(), ms(11)), ("b".into(), ms(20))]);
    }
}
