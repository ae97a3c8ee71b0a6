//! Measures when the ticks of a run in real time begin, and finds what made one late.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use super::engine::Engine;
use super::punctuality::{Beginning, Punctuality, TickUse};

/// A tick that is later than this part of a period makes the engine measure every tick from then on [1/period].
const LATE_PART: i64 = 10;

impl Engine {
    /// Notes that the next tick begins at `time` [ns] of a run in real time, and that `due` [ns] was its time. A tick that
    /// a live clock device starts is due a period after the last one.
    pub(super) fn begin_measured(&mut self, time: i64, due: i64) {
        let wall = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |wall| wall.as_nanos() as i64);
        let last = self.punctuality.last;
        let has_live_clock = self.clock().is_some_and(|clock| clock.link.live().is_some());
        let due = if has_live_clock { last.map_or(time, |last| last.time + self.period()) } else { due };
        let by = (time - due).max(0);
        let is_late = by > self.period() / LATE_PART;
        let last = last.filter(|last| is_late && time - last.time > self.period());
        let cause =
            last.and_then(|last| self.use_of_tick(last, Duration::from_nanos((time - last.time).unsigned_abs())));
        self.timing.is_always_on |= is_late;
        self.punctuality.count(Beginning { time, wall, by }, cause);
    }

    /// Calls `observe` with this engine after a tick, and notes how long that took if every tick is timed.
    pub(super) fn observe_measured(&mut self, observe: &mut dyn FnMut(&Self)) {
        let before = self.timing.is_always_on.then(Instant::now);
        observe(self);
        self.punctuality.output = before.map_or(Duration::ZERO, |before| before.elapsed());
    }

    /// Returns what took the time of the last tick, which began at `last` and lasted `lasted`, if it was measured.
    fn use_of_tick(&self, last: Beginning, lasted: Duration) -> Option<TickUse> {
        if self.timing.last_tick != self.core.tick.index || !self.timing.is_always_on {
            return None;
        }
        let nodes = self.timing.nodes.iter().zip(&self.names).map(|(time, (name, _))| (time.last, "node", name));
        let devices = self.punctuality.devices.iter().zip(&self.devices);
        let all = || nodes.clone().chain(devices.clone().map(|(time, device)| (*time, "device", &device.name)));
        let together = all().map(|(took, ..)| took).sum();
        let (took, sort, name) = all().max_by_key(|(took, ..)| *took)?;
        let (slowest, output) = (format!("{sort} `{name}`"), self.punctuality.output);
        Some(TickUse { time: last.time, lasted, slowest, took, together, output })
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
