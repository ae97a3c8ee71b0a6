//! Where a device's samples come into the graph: each counts as new once, and none goes back in time.

use crate::device::Samples;
use crate::graph::{PlannedRole, Policy};
use crate::node::{Bus, PortId};
use crate::signal::{Kind, Stamp};

/// What came in on a port.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Samples that were new.
    pub new: u64,
    /// Samples that were there already: the same sequence number or the same stamp.
    pub repeated: u64,
    /// Sequence numbers that never came.
    pub gaps: u64,
    /// Samples that were older than a period of their device when they came in.
    pub late: u64,
    /// Samples that were dropped because they are older than the last.
    pub went_back: u64,
    /// Samples that were dropped because their stamp lies more than a period ahead of the graph's clock.
    pub ahead: u64,
    /// Samples that were dropped because they are not finite.
    pub not_finite: u64,
}

/// A role's port and the device's port behind it.
pub(crate) struct Inlet {
    pub(crate) device: usize,
    pub(crate) counters: Counters,
    kind: Kind,
    port: usize,
    id: PortId,
    /// Writes of the device that were seen.
    writes: u64,
    /// How old the newest sample may be, and a period of its device [ns].
    max_age: i64,
    period: i64,
    /// What it does when it is older.
    pub(crate) stale: Policy,
    /// Sequence number of the last sample that came, whatever became of it.
    seen: Option<u64>,
    /// Stamp and sequence number of the last sample that was new.
    last: Option<(i64, u64)>,
}

impl Inlet {
    pub(crate) fn new(role: &PlannedRole, port: usize, id: PortId) -> Self {
        Self {
            device: role.device,
            counters: Counters::default(),
            kind: role.ports[port].shape.kind(),
            port: role.first_port + port,
            max_age: role.age.max_age,
            period: role.period,
            stale: role.age.stale,
            id,
            writes: 0,
            seen: None,
            last: None,
        }
    }

    /// Whether a sample that has not been taken over yet is finite: an image is checked once, here at the edge.
    pub(crate) fn is_finite(&self, samples: &Samples) -> bool {
        let sample = samples.ports[self.port];
        sample.writes == self.writes || sample.is_absent || samples.arenas.is_finite(self.kind, sample.slot)
    }

    /// Takes the newest sample over, if there is one. The buffers are exchanged, not copied.
    pub(crate) fn latch(&mut self, samples: &mut Samples, bus: &mut Bus, tick: u64, now: i64) {
        let sample = samples.ports[self.port];
        if sample.writes == self.writes {
            return;
        }
        self.writes = sample.writes;
        let missing =
            self.seen.replace(sample.sequence).map_or(0, |seen| sample.sequence.saturating_sub(seen.saturating_add(1)));
        match self.last {
            Some((_, sequence)) if sequence == sample.sequence => self.counters.repeated += 1,
            Some((stamp, _)) if sample.stamp == stamp => self.counters.repeated += 1,
            Some((stamp, _)) if sample.stamp < stamp => self.counters.went_back += 1,
            // Taken over, it would look fresh for as long as it lies ahead, and keep all that come after it out.
            _ if sample.stamp - now > self.period => self.counters.ahead += 1,
            _ => {
                self.last = Some((sample.stamp, sample.sequence));
                self.counters.new += 1;
                self.counters.gaps += missing;
                self.counters.late += u64::from(now - sample.stamp > self.period);
                let mark = &mut bus.marks[self.id.mark as usize];
                if sample.is_absent {
                    mark.lose(tick);
                } else {
                    bus.arenas.swap(self.kind, self.id.slot, &mut samples.arenas, sample.slot);
                    mark.renew(tick, Stamp { nanos: sample.stamp, device: self.device as u16 });
                }
            }
        }
    }

    /// Drops a sample that is not finite.
    pub(crate) fn reject(&mut self, samples: &Samples) {
        let sample = samples.ports[self.port];
        (self.writes, self.seen) = (sample.writes, Some(sample.sequence));
        self.counters.not_finite += 1;
    }

    /// Whether there was a sample, and the newest is too old at `now` [ns]; what is only counted is not asked.
    pub(crate) fn is_stale(&self, now: i64) -> bool {
        self.stale != Policy::Count && self.age(now).is_some_and(|age| age > self.max_age)
    }

    /// Age of the newest sample at `now`, if there is one, and how old it may be [ns].
    pub(crate) fn ages(&self, now: i64) -> (i64, i64) {
        (self.age(now).unwrap_or(0), self.max_age)
    }

    fn age(&self, now: i64) -> Option<i64> {
        self.last.map(|(stamp, _)| now - stamp)
    }

    /// Hands the value back as if the device had sampled it again at `now`.
    pub(crate) fn refresh(&mut self, samples: &mut Samples, bus: &mut Bus, now: i64) {
        let sample = &mut samples.ports[self.port];
        bus.arenas.swap(self.kind, self.id.slot, &mut samples.arenas, sample.slot);
        (sample.stamp, sample.sequence) = (now, sample.sequence + 1);
        sample.writes += 1;
    }
}
