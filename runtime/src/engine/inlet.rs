//! Where a device's samples come into the graph: each counts as new once, and none goes back in time.

use crate::device::Samples;
use crate::node::{Bus, PortId};
use crate::signal::{Kind, Shape, Stamp};

/// What came in on a port.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Samples that were new.
    pub new: u64,
    /// Samples that were there already: the same sequence number or the same stamp.
    pub repeated: u64,
    /// Samples that were dropped because they are older than the last.
    pub went_back: u64,
}

/// A role's port and the device's port behind it.
pub(super) struct Inlet {
    pub(super) device: usize,
    pub(super) counters: Counters,
    kind: Kind,
    port: usize,
    id: PortId,
    /// Writes of the device that were seen.
    writes: u64,
    /// Stamp and sequence number of the last sample that was new.
    last: Option<(i64, u64)>,
}

impl Inlet {
    pub(super) const fn new(shape: &Shape, device: usize, port: usize, id: PortId) -> Self {
        Self {
            device,
            counters: Counters { new: 0, repeated: 0, went_back: 0 },
            kind: shape.kind(),
            port,
            id,
            writes: 0,
            last: None,
        }
    }

    /// Whether a sample that has not been taken over yet is finite: an image is checked once, here at the edge.
    pub(super) fn is_finite(&self, samples: &Samples) -> bool {
        let sample = samples.ports[self.port];
        sample.writes == self.writes || samples.arenas.is_finite(self.kind, sample.slot)
    }

    /// Takes the newest sample over, if there is one. The buffers are exchanged, not copied.
    pub(super) fn latch(&mut self, samples: &mut Samples, bus: &mut Bus, tick: u64) {
        let sample = samples.ports[self.port];
        if sample.writes == self.writes {
            return;
        }
        self.writes = sample.writes;
        match self.last {
            Some((_, sequence)) if sequence == sample.sequence => self.counters.repeated += 1,
            Some((stamp, _)) if sample.stamp == stamp => self.counters.repeated += 1,
            Some((stamp, _)) if sample.stamp < stamp => self.counters.went_back += 1,
            _ => {
                self.last = Some((sample.stamp, sample.sequence));
                self.counters.new += 1;
                bus.arenas.swap(self.kind, self.id.slot, &mut samples.arenas, sample.slot);
                bus.marks[self.id.mark as usize].renew(tick, Stamp { nanos: sample.stamp, device: self.device as u16 });
            }
        }
    }

    /// Hands the value back as if the device had sampled it again at `now`.
    pub(super) fn refresh(&mut self, samples: &mut Samples, bus: &mut Bus, now: i64) {
        let sample = &mut samples.ports[self.port];
        bus.arenas.swap(self.kind, self.id.slot, &mut samples.arenas, sample.slot);
        (sample.stamp, sample.sequence) = (now, sample.sequence + 1);
        sample.writes += 1;
    }
}
