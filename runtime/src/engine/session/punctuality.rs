//! When the ticks of a run in real time began, as data: a histogram of their lateness, the latest, and what made it late.

use std::time::Duration;

/// When a tick began.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Beginning {
    /// Time since the start of the run [ns].
    pub time: i64,
    /// Wall clock: time since 1970 in UTC [ns].
    pub wall: i64,
}

/// A tick that began late.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LateTick {
    /// When it began [ns].
    pub time: i64,
    /// How late that was [ns].
    pub by: i64,
}

/// A node or a device that took so long in a tick that the next one was late.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Culprit {
    /// The node or the device, for a message: "node `filter`".
    pub name: String,
    /// How long it took.
    pub took: Duration,
    /// When the tick began in which it took so long [ns].
    pub time: i64,
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
    /// What took longest of all that made a tick late.
    pub culprit: Option<Culprit>,
    /// Number of measured ticks that took too long although no node and no device did.
    pub unexplained: u64,
    /// Time of each device in the last tick.
    pub(super) devices: Vec<Duration>,
}

impl Punctuality {
    /// Bounds of the histogram of lateness [ns].
    pub const BOUNDS_NS: [i64; 5] = [100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];

    /// Counts a tick that began `by` [ns] late.
    pub(super) fn count(&mut self, began: Beginning, by: i64) {
        let bin = Self::BOUNDS_NS.iter().position(|bound| by < *bound).unwrap_or(Self::BOUNDS_NS.len());
        self.counts[bin] += 1;
        if by > self.worst.by {
            self.worst = LateTick { time: began.time, by };
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
            punctuality.count(Beginning { time, wall: 0 }, by);
        }
        assert_eq!(punctuality.counts, [2, 1, 1, 0, 0, 2]);
        assert_eq!(punctuality.worst, LateTick { time: 20, by: 12_000_000 });
    }
}
