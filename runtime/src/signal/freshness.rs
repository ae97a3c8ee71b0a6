//! Freshness of a value: absent, lost, held or new; and the stamp of the sample it came from.

/// What a value is in the present tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Freshness {
    /// There is no value, and there was none in the tick before.
    Absent,
    /// The value went away in this tick. A loss triggers, like something new.
    Lost,
    /// There is a value, but it was made in an earlier tick.
    Held,
    /// The value was made in this tick.
    New,
}

/// When the sample was taken that a value came from, in the graph's clock, and which device took it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stamp {
    /// Time of the sample [ns].
    pub nanos: i64,
    /// Device that took it; times of different devices are never subtracted.
    pub device: u16,
}

impl Stamp {
    /// The stamp of generated motion: it never grows old.
    pub const TIMELESS: Self = Self { nanos: i64::MAX, device: u16::MAX };

    /// Whether the value came from no sample at all.
    #[must_use]
    pub const fn is_timeless(self) -> bool {
        self.nanos == i64::MAX
    }

    /// The older of two stamps.
    #[must_use]
    pub const fn oldest(self, other: Self) -> Self {
        if other.nanos < self.nanos { other } else { self }
    }

    /// Age at `now` [ns]; zero for what is timeless.
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

/// What the runtime knows about a value beside the value: when it changed, from which sample, and whether it is there.
///
/// Freshness is derived from the tick of the last change, so nothing has to be touched in a tick that changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    changed: u64,
    // The stamp's two halves lie apart, so that a mark is three words and not four.
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

    /// Freshness as seen in `tick`.
    #[must_use]
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

    /// Whether there is a value.
    #[must_use]
    pub const fn is_present(&self) -> bool {
        self.present
    }

    /// Stamp of the value; what it last was when there is none.
    #[must_use]
    pub const fn stamp(&self) -> Stamp {
        Stamp { nanos: self.nanos, device: self.device }
    }

    /// The value is new in `tick`.
    pub const fn renew(&mut self, tick: u64, stamp: Stamp) {
        *self = Self::new(tick, stamp, true);
    }

    /// The value goes away in `tick`; nothing happens if there was none.
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
        assert_eq!(mark.freshness(1), Freshness::Absent, "what never was cannot be lost");
        mark.renew(2, Stamp::TIMELESS);
        assert_eq!((mark.freshness(2), mark.freshness(3)), (Freshness::New, Freshness::Held));
        mark.lose(4);
        assert_eq!((mark.freshness(4), mark.freshness(5)), (Freshness::Lost, Freshness::Absent));
    }

    #[test]
    fn generated_motion_is_timeless_and_takes_any_other_stamp() {
        let sample = Stamp { nanos: 7, device: 1 };
        assert_eq!(Stamp::TIMELESS.oldest(sample), sample);
        assert_eq!(sample.oldest(Stamp::TIMELESS), sample);
        assert_eq!((sample.age(10), Stamp::TIMELESS.age(10)), (3, 0));
    }
}
