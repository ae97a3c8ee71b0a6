//! The freshness of a value (absent, lost, held or new) and the stamp of the sample that it was computed from.

/// Freshness of a value in a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[must_use]
pub enum Freshness {
    /// There is no value, and there was none in the previous tick.
    Absent,
    /// The value became absent in this tick. A loss triggers the reading nodes, like a new value.
    Lost,
    /// The value was written in an earlier tick.
    Held,
    /// The value was written in this tick.
    New,
}

/// The time and the device of the sample that a value was computed from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[must_use]
pub struct Stamp {
    /// Time of the sample in the graph's clock [ns].
    pub nanos: i64,
    /// Number of the device. Times of different devices are never subtracted.
    pub device: u16,
}

impl Stamp {
    /// The stamp of a value without a sample, such as a generated motion. Its age is always zero.
    pub const TIMELESS: Self = Self { nanos: i64::MAX, device: u16::MAX };

    /// Whether the value was computed from no sample.
    #[must_use]
    pub const fn is_timeless(self) -> bool {
        self.nanos == i64::MAX
    }

    /// Returns the older of two stamps.
    pub const fn oldest(self, other: Self) -> Self {
        if other.nanos < self.nanos { other } else { self }
    }

    /// Returns the age at `now` [ns]; zero for a timeless stamp.
    #[must_use]
    pub const fn age(self, now: i64) -> i64 {
        if self.is_timeless() { 0 } else { now.saturating_sub(self.nanos) }
    }
}

impl Default for Stamp {
    fn default() -> Self {
        Self::TIMELESS
    }
}

/// The state of a value: the tick of its last change, its stamp, and whether it is present.
///
/// The freshness follows from the tick of the last change, so a mark needs no update in a tick that changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    changed: u64,
    // The two fields of the stamp are stored separately: a mark then takes 24 bytes instead of 32.
    nanos: i64,
    device: u16,
    present: bool,
}

impl Default for Mark {
    fn default() -> Self {
        Self::new(u64::MAX, Stamp::TIMELESS, false)
    }
}

impl Mark {
    pub(super) const fn new(changed: u64, Stamp { nanos, device }: Stamp, present: bool) -> Self {
        Self { changed, nanos, device, present }
    }

    /// Returns the freshness in `tick`.
    pub const fn freshness(&self, tick: u64) -> Freshness {
        match (self.present, self.changed == tick) {
            (true, true) => Freshness::New,
            (true, false) => Freshness::Held,
            (false, true) => Freshness::Lost,
            (false, false) => Freshness::Absent,
        }
    }

    /// Whether the value is new or lost in `tick`.
    #[must_use]
    pub const fn changed_in(&self, tick: u64) -> bool {
        self.changed == tick
    }

    /// Whether the value is present.
    #[must_use]
    pub const fn is_present(&self) -> bool {
        self.present
    }

    /// Returns the stamp of the value, or the last one if the value is absent.
    pub const fn stamp(&self) -> Stamp {
        Stamp { nanos: self.nanos, device: self.device }
    }

    /// Makes the value new in `tick`.
    pub const fn renew(&mut self, tick: u64, stamp: Stamp) {
        *self = Self::new(tick, stamp, true);
    }

    /// Makes the value absent from `tick` on. Does nothing if it is absent already.
    pub const fn lose(&mut self, tick: u64) {
        if self.present {
            self.changed = tick;
            self.present = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn freshness_follows_the_tick_of_the_last_change() {
        let mut mark = Mark::default();
        assert_eq!(mark.freshness(1), Freshness::Absent);
        mark.lose(1);
        assert_eq!(mark.freshness(1), Freshness::Absent, "a value that was never present cannot be lost");
        mark.renew(2, Stamp::TIMELESS);
        assert_eq!((mark.freshness(2), mark.freshness(3)), (Freshness::New, Freshness::Held));
        mark.lose(4);
        assert_eq!((mark.freshness(4), mark.freshness(5)), (Freshness::Lost, Freshness::Absent));
    }

    #[test]
    fn every_stamp_is_older_than_a_timeless_one() {
        let sample = Stamp { nanos: 7, device: 1 };
        assert_eq!(Stamp::TIMELESS.oldest(sample), sample);
        assert_eq!(sample.oldest(Stamp::TIMELESS), sample);
        assert_eq!((sample.age(10), Stamp::TIMELESS.age(10)), (3, 0));
    }
}
