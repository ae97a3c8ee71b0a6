//! Inlets take the samples of devices into the graph. Each sample is new once, and time never goes back.

use crate::device::{PortSample, SampleState, Samples};
use crate::graph::{PlannedRole, Policy};
use crate::node::{Bus, PortId};
use crate::signal::{Kind, Stamp};

/// Time that a device has for its first sample [ns]. Nothing moves before it.
pub(crate) const START_TIME: i64 = 2_000_000_000;

/// Counts of the samples of a role's port.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counters {
    /// Samples that were new.
    pub new: u64,
    /// Samples with the sequence number or the stamp of the one before.
    pub repeated: u64,
    /// Sequence numbers that are missing, and samples of live devices that were too old when they arrived.
    pub gaps: u64,
    /// Samples that were older than one period of their device when they arrived.
    pub late: u64,
    /// Samples dropped because they are older than the last one.
    pub went_back: u64,
    /// Samples dropped because their stamp is more than one period ahead of the graph's clock.
    pub ahead: u64,
    /// Samples dropped because a value is not finite.
    pub not_finite: u64,
}

/// Connects a device's port to a role's port on the bus.
pub(crate) struct Inlet {
    /// Index of its role.
    pub(crate) role: usize,
    pub(crate) device: usize,
    pub(crate) counters: Counters,
    kind: Kind,
    /// Size of a value, from the shape of the port.
    size: [usize; 2],
    port: usize,
    id: PortId,
    /// Write count of the device's port at the last latch.
    writes: u64,
    /// Maximum age of the newest sample [ns].
    max_age: i64,
    /// Period of the device [ns].
    period: i64,
    /// Policy for a sample that is older than `max_age`.
    pub(crate) stale: Policy,
    /// Sequence number of the last sample, taken over or dropped.
    seen: Option<u64>,
    /// Stamp of the last sample that was taken over, and its sequence number unless the port was lost since.
    last: Option<(i64, Option<u64>)>,
    /// Whether the device has reported the port as lost, and how often so far.
    is_lost: bool,
    losses: u64,
    /// Whether the loss of the port is not a trouble, as for the ground truth.
    is_observed: bool,
    /// Whether the device is live, so that a sample can arrive too late.
    is_live: bool,
    /// The runners of the nodes that hear of each loss of the port, because the bench lets the device come back.
    pub(crate) returns: Box<[usize]>,
}

impl Inlet {
    pub(crate) fn new(number: usize, role: &PlannedRole, port: usize, id: PortId, is_live: bool) -> Self {
        let shape = &role.ports[port].shape;
        Self {
            role: number,
            device: role.device,
            counters: Counters::default(),
            kind: shape.kind(),
            size: shape.size(),
            port: role.numbers[port],
            max_age: role.age.max_age,
            period: role.period,
            stale: role.age.stale,
            id,
            writes: 0,
            seen: None,
            last: None,
            is_lost: false,
            losses: 0,
            is_observed: role.is_observed,
            is_live,
            returns: Box::default(),
        }
    }

    /// Returns the pending sample: one with a value that has not been latched yet.
    fn sample<'s>(&self, samples: &'s Samples) -> Option<&'s PortSample> {
        Some(&samples.ports[self.port])
            .filter(|sample| sample.writes != self.writes && sample.state == SampleState::Value)
    }

    /// Returns the size of the pending sample and the size that the device has stated, if they differ.
    pub(crate) fn misfit(&self, samples: &Samples) -> Option<[[usize; 2]; 2]> {
        let size = samples.arenas.size(self.kind, self.sample(samples)?.slot);
        (size != self.size).then_some([size, self.size])
    }

    /// Whether the pending sample is finite, if there is one. Images are checked only here, once per sample.
    pub(crate) fn is_finite(&self, samples: &Samples) -> bool {
        self.sample(samples).is_none_or(|sample| samples.arenas.is_finite(self.kind, sample.slot))
    }

    /// Returns why the device has lost the port since the last latch, if that is a trouble. It may be back already.
    pub(crate) fn lost<'s>(&self, samples: &'s Samples) -> Option<&'s str> {
        let sample = &samples.ports[self.port];
        let is_lost = matches!(sample.state, SampleState::Lost) || sample.losses != self.losses;
        (is_lost && !self.is_observed).then_some(&*sample.loss)
    }

    /// Latches the pending sample, if there is one. Swaps the buffers instead of copying. Returns whether the device has
    /// lost the port since the last latch.
    pub(crate) fn latch(&mut self, samples: &mut Samples, bus: &mut Bus, tick: u64, now: i64) -> bool {
        let was_lost = self.losses != samples.ports[self.port].losses;
        self.take(samples, bus, tick, now);
        was_lost
    }

    fn take(&mut self, samples: &mut Samples, bus: &mut Bus, tick: u64, now: i64) {
        let Samples { arenas, ports, .. } = samples;
        let sample = &ports[self.port];
        self.is_lost = matches!(sample.state, SampleState::Lost);
        if self.is_lost || self.losses != sample.losses {
            // After a reconnection, the device may number its samples from 1 again.
            self.seen = None;
            self.last = self.last.map(|(stamp, _)| (stamp, None));
            self.losses = sample.losses;
        }
        if self.is_lost {
            self.writes = sample.writes;
            self.lose(bus, tick);
            return;
        }
        if sample.writes == self.writes {
            return;
        }
        self.writes = sample.writes;
        let missing =
            self.seen.replace(sample.sequence).map_or(0, |seen| sample.sequence.saturating_sub(seen.saturating_add(1)));
        match self.last {
            Some((_, Some(sequence))) if sequence == sample.sequence => self.counters.repeated += 1,
            Some((stamp, _)) if sample.stamp == stamp => self.counters.repeated += 1,
            Some((stamp, _)) if sample.stamp < stamp => self.counters.went_back += 1,
            // A stamp in the future would look fresh until its time comes, and later samples would be dropped as older.
            _ if sample.stamp - now > self.period => self.counters.ahead += 1,
            // A sample that is too old when it arrives must not replace the last one.
            _ if self.is_live && now - sample.stamp > self.max_age => self.counters.gaps += missing + 1,
            _ => {
                self.last = Some((sample.stamp, Some(sample.sequence)));
                self.counters.new += 1;
                self.counters.gaps += missing;
                self.counters.late += u64::from(now - sample.stamp > self.period);
                if sample.state == SampleState::Absent {
                    self.lose(bus, tick);
                } else {
                    let stamp = Stamp { nanos: sample.stamp, device: self.device as u16 };
                    let mark = bus.arenas.receive(self.kind, self.id.slot, arenas, sample.slot, tick, stamp);
                    *bus.mark_mut(self.id) = mark;
                }
            }
        }
    }

    fn lose(&self, bus: &mut Bus, tick: u64) {
        bus.arenas.lose(self.kind, self.id.slot, tick);
        bus.mark_mut(self.id).lose(tick);
    }

    /// Drops a pending sample that is not finite.
    pub(crate) fn reject(&mut self, samples: &Samples) {
        let sample = &samples.ports[self.port];
        (self.writes, self.seen) = (sample.writes, Some(sample.sequence));
        self.counters.not_finite += 1;
    }

    /// Whether the newest sample is too old at `now` [ns], or there is none after the time for the first one. Always
    /// `false` while the port is lost, and under the policy `count`.
    pub(crate) fn is_stale(&self, now: i64) -> bool {
        let is_late = match self.last {
            Some((stamp, _)) => now - stamp > self.max_age,
            None => !self.is_observed && now > self.max_age.max(START_TIME),
        };
        is_late && !self.is_lost && self.stale != Policy::Count
    }

    /// Returns the age of the newest sample at `now`, or `None` without a sample, and its maximum age [ns].
    pub(crate) fn ages(&self, now: i64) -> (Option<i64>, i64) {
        (self.last.map(|(stamp, _)| now - stamp), self.max_age)
    }

    /// Makes the current value a pending sample of the device with the stamp `now` [ns].
    pub(crate) fn refresh(&mut self, samples: &mut Samples, bus: &mut Bus, now: i64) {
        let sample = &mut samples.ports[self.port];
        bus.arenas.swap(self.kind, self.id.slot, &mut samples.arenas, sample.slot);
        (sample.stamp, sample.sequence) = (now, sample.sequence + 1);
        sample.writes += 1;
    }
}
