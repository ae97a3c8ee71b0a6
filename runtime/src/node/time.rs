//! The time since the last sample, and the duration of an absence.

use super::{In, Tick};
use crate::signal::Stamp;

/// Measures the time between two samples. It is part of the state of a node that integrates or differentiates.
///
/// The sum of the steps is the time between the first and the last sample, independent of the ticks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Interval {
    last: Option<Stamp>,
}

impl Interval {
    /// Returns the time since the last sample [s]. It returns `None` if the node must start afresh: at the first
    /// sample, when the sample is from another device, and after a gap longer than the graph's `max_gap_ms`.
    ///
    /// A sample that is older than the last one gives 0. A generated value has the time of the tick.
    pub fn step<T>(&mut self, input: &In<'_, T>, tick: &Tick) -> Option<f64> {
        let stamp = input.stamp();
        let stamp = if stamp.is_timeless() { Stamp { nanos: tick.now, ..stamp } } else { stamp };
        let last = self.last.replace(stamp).filter(|last| last.device == stamp.device)?;
        let seconds = (stamp.nanos - last.nanos).max(0) as f64 * 1e-9;
        (seconds <= tick.max_gap).then_some(seconds)
    }
}

/// Measures how long something is absent. It is part of the state of a node that resets after a while.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Absence {
    /// Time of the first tick without it [ns].
    since: Option<i64>,
}

impl Absence {
    /// Records whether it is present in this tick. Returns whether it has been absent for the graph's `reset_after_ms`.
    /// The result is `false` again in the tick in which it returns.
    pub fn is_long(&mut self, is_present: bool, tick: &Tick) -> bool {
        self.is_longer(tick.reset_after, is_present, tick)
    }

    /// Does the same for a time of its own [ns].
    pub fn is_longer(&mut self, time: i64, is_present: bool, tick: &Tick) -> bool {
        if is_present {
            self.since = None;
            return false;
        }
        tick.now - *self.since.get_or_insert(tick.now) >= time
    }

    /// Records that it is absent from the time `since` [ns] on. An absence that has begun earlier continues.
    pub fn begin(&mut self, since: i64) {
        self.since.get_or_insert(since);
    }

    /// Records that it is present. Returns whether it was absent for the graph's `reset_after_ms`.
    pub fn end(&mut self, tick: &Tick) -> bool {
        self.since.take().is_some_and(|since| tick.now - since >= tick.reset_after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::Mark;

    fn step(interval: &mut Interval, stamp: Stamp, tick: &Tick) -> Option<f64> {
        let mut mark = Mark::default();
        mark.renew(tick.index, stamp);
        interval.step(&In::new(&0.0, &mark, tick.index), tick)
    }

    #[test]
    fn an_interval_is_between_two_samples_of_one_device() {
        let tick = Tick { now: 50_000_000, ..Tick::first() };
        let stamp = |ms: i64, device| Stamp { nanos: ms * 1_000_000, device };
        let mut interval = Interval::default();
        let cases = [
            (stamp(0, 1), None, "the first"),
            (stamp(4, 1), Some(0.004), "the next"),
            (stamp(4, 1), Some(0.0), "the same sample again"),
            (stamp(2, 1), Some(0.0), "an older sample"),
            (stamp(102, 1), Some(0.1), "the longest gap that is a step"),
            (stamp(900, 1), None, "a longer gap"),
            (stamp(904, 1), Some(0.004), "after the gap"),
            (stamp(904, 2), None, "another device"),
            (Stamp::TIMELESS, None, "generated, the first"),
            (Stamp::TIMELESS, Some(0.0), "generated, in the same tick"),
        ];
        for (stamp, expected, what) in cases {
            assert_eq!(step(&mut interval, stamp, &tick), expected, "{what}");
        }
        let later = Tick { now: 60_000_000, ..tick };
        assert_eq!(step(&mut interval, Stamp::TIMELESS, &later), Some(0.01));
    }

    #[test]
    fn an_absence_is_long_after_the_time_of_the_graph() {
        let at = |ms: i64| Tick { now: ms * 1_000_000, ..Tick::first() };
        let mut absence = Absence::default();
        let cases = [(5, true, false), (6, false, false), (25, false, false), (26, false, true), (27, true, false)];
        for (ms, is_present, expected) in cases {
            assert_eq!(absence.is_long(is_present, &at(ms)), expected, "{ms} ms");
        }
        absence.begin(30_000_000);
        absence.begin(40_000_000);
        assert!(absence.end(&at(50)) && !absence.end(&at(90)), "it begins once, and it ends once");
    }
}
