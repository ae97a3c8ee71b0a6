//! When the ticks of a run in real time begin, how late they are, and what made them late.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::engine::Engine;
use crate::engine::core::DeviceLink;

/// A tick that is later than this part of a period makes the engine measure every tick from then on [1/period].
const LATE_PART: i64 = 10;

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
    /// The last tick and its lateness.
    last: Option<(Beginning, i64)>,
    /// Number of ticks by their lateness: below each of [`BOUNDS_NS`](Self::BOUNDS_NS), and above the last.
    pub counts: [u64; Self::BOUNDS_NS.len() + 1],
    /// The tick that was latest.
    pub worst: LateTick,
    /// What took longest of all that made a tick late.
    pub culprit: Option<Culprit>,
    /// Number of measured ticks that took too long although no node and no device did.
    pub unexplained: u64,
    /// Time of each device in the last tick.
    devices: Vec<Duration>,
}

impl Punctuality {
    /// Bounds of the histogram of lateness [ns].
    pub const BOUNDS_NS: [i64; 5] = [100_000, 300_000, 1_000_000, 3_000_000, 10_000_000];

    fn count(&mut self, began: Beginning, by: i64) {
        let bin = Self::BOUNDS_NS.iter().position(|bound| by < *bound).unwrap_or(Self::BOUNDS_NS.len());
        self.counts[bin] += 1;
        if by > self.worst.by {
            self.worst = LateTick { time: began.time, by };
        }
        self.last = Some((began, by));
    }

    /// Notes how long a device took in this tick.
    pub(super) fn device_took(&mut self, device: usize, time: Duration) {
        if self.devices.len() <= device {
            self.devices.resize(device + 1, Duration::ZERO);
        }
        self.devices[device] = time;
    }
}

impl Engine {
    /// Notes that the next tick begins at `time` [ns] of a run in real time, and that `due` [ns] was its time. A tick that
    /// a live clock device starts is due a period after the last one.
    pub(super) fn begin_measured(&mut self, time: i64, due: i64) {
        let wall = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |wall| wall.as_nanos() as i64);
        let last = self.punctuality.last;
        let has_live_clock = self.clock().is_some_and(|clock| matches!(clock.link, DeviceLink::Live(_)));
        let due = if has_live_clock { last.map_or(time, |(last, _)| last.time + self.period()) } else { due };
        let by = (time - due).max(0);
        let is_late = by > self.period() / LATE_PART;
        if let Some((last, _)) = last.filter(|(last, _)| is_late && time - last.time > self.period()) {
            self.find_culprit(last, Duration::from_nanos((time - last.time).unsigned_abs()));
        }
        self.timing.is_always_on |= is_late;
        self.punctuality.count(Beginning { time, wall }, by);
    }

    /// Finds what took most of the last tick, which began at `last` and lasted `duration`, if that tick was measured.
    fn find_culprit(&mut self, last: Beginning, duration: Duration) {
        if self.timing.last_tick != self.core.tick.index || !self.timing.is_always_on {
            return;
        }
        let nodes = self.timing.nodes.iter().zip(&self.names);
        let nodes = nodes.map(|(time, (name, _))| (time.last, "node", name));
        let devices = self.punctuality.devices.iter().zip(&self.devices);
        let devices = devices.map(|(time, device)| (*time, "device", &device.name));
        let slowest = nodes.chain(devices).max_by_key(|(took, ..)| *took);
        let Some((took, sort, name)) = slowest.filter(|(took, ..)| 2 * *took >= duration) else {
            self.punctuality.unexplained += 1;
            return;
        };
        if self.punctuality.culprit.as_ref().is_none_or(|known| known.took < took) {
            let name = format!("{sort} `{name}`");
            self.punctuality.culprit = Some(Culprit { name, took, time: last.time });
        }
    }

    /// Returns when the last tick began by the clock, or `None` in virtual time, where no tick has such a time.
    #[must_use]
    pub fn began(&self) -> Option<Beginning> {
        self.punctuality.last.map(|(began, _)| began)
    }

    /// Returns when the ticks began, and how late.
    #[must_use]
    pub const fn punctuality(&self) -> &Punctuality {
        &self.punctuality
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
