//! Measures when the ticks of a run in real time begin, and finds what made one late.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::engine::Engine;
use super::punctuality::{Beginning, Culprit, Punctuality};
use crate::engine::core::DeviceLink;

/// A tick that is later than this part of a period makes the engine measure every tick from then on [1/period].
const LATE_PART: i64 = 10;

impl Engine {
    /// Notes that the next tick begins at `time` [ns] of a run in real time, and that `due` [ns] was its time. A tick that
    /// a live clock device starts is due a period after the last one.
    pub(super) fn begin_measured(&mut self, time: i64, due: i64) {
        let wall = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |wall| wall.as_nanos() as i64);
        let last = self.punctuality.last;
        let has_live_clock = self.clock().is_some_and(|clock| matches!(clock.link, DeviceLink::Live(_)));
        let due = if has_live_clock { last.map_or(time, |last| last.time + self.period()) } else { due };
        let by = (time - due).max(0);
        let is_late = by > self.period() / LATE_PART;
        if let Some(last) = last.filter(|last| is_late && time - last.time > self.period()) {
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
        self.punctuality.last
    }

    /// Returns when the ticks began, and how late.
    #[must_use]
    pub const fn punctuality(&self) -> &Punctuality {
        &self.punctuality
    }
}
