//! The times of the ticks.

use crate::engine::core::START_TIME;
use crate::graph::Clock;

/// Periods without a sample of the clock device after which a timer takes its place.
const MAX_MISSED_PERIODS: i64 = 3;

/// Periods for which the commands of a tick are valid, and the shortest such time [ns].
const LEASE_PERIODS: i64 = 5;
const MIN_LEASE: i64 = 40_000_000;

/// Computes the time of the next tick, in virtual or real time.
#[derive(Debug, Clone)]
pub(crate) struct TickSchedule {
    clock: Clock,
    /// Nominal time between two ticks [ns].
    period: i64,
    /// Time of the last tick [ns].
    last: Option<i64>,
    is_on_timer: bool,
    /// Whether the clock device has had more time once, after a late tick, since its last sample.
    has_waited: bool,
    /// Whether the clock device has sampled at all.
    has_started: bool,
}

impl TickSchedule {
    pub(crate) const fn new(clock: Clock, period: i64) -> Self {
        Self { clock, period, last: None, is_on_timer: false, has_waited: false, has_started: false }
    }

    /// Returns the time for which the commands of a tick are valid [ns]: longer than a clock device may be silent before
    /// a timer takes its place.
    pub(crate) fn lease(&self) -> i64 {
        MIN_LEASE.max(LEASE_PERIODS * self.period)
    }

    pub(crate) const fn period(&self) -> i64 {
        self.period
    }

    /// Returns the index of the clock device.
    pub(crate) const fn clock_device(&self) -> Option<usize> {
        match self.clock {
            Clock::Device(device) => Some(device),
            Clock::Rate => None,
        }
    }

    /// Whether the device with that index is the clock.
    pub(crate) fn is_clock(&self, device: usize) -> bool {
        self.clock_device() == Some(device)
    }

    /// Whether the clock device should have sampled, and a timer replaces it.
    pub(crate) fn is_silent(&self) -> bool {
        self.is_on_timer && (self.has_started || self.last.is_some_and(|last| last >= START_TIME))
    }

    /// Returns the latest time of the next tick [ns]. After it, the schedule no longer waits for the clock device.
    pub(crate) fn deadline(&self) -> i64 {
        let periods = if self.is_on_timer || self.clock == Clock::Rate { 1 } else { MAX_MISSED_PERIODS };
        match (self.last, self.clock) {
            (Some(last), _) => last + periods * self.period,
            (None, Clock::Rate) => 0,
            (None, Clock::Device(_)) => periods * self.period,
        }
    }

    /// Returns the time of the next tick, given the time of the clock device's next sample [ns].
    pub(crate) fn next(&self, sample: Option<i64>) -> i64 {
        let next = sample.map_or(self.deadline(), |sample| sample.min(self.deadline()));
        self.last.map_or(next, |last| next.max(last + 1))
    }

    /// Records a tick at `now` [ns]. `has_sampled`: whether the clock device has sampled since the last tick.
    pub(crate) fn ticked(&mut self, now: i64, has_sampled: bool) {
        // After a tick that began late, the device has its time again, once, and not if it was silent before.
        let was_late = self.last.is_some() && now > self.deadline() + self.period;
        let waits = was_late && !self.is_on_timer && !self.has_waited;
        self.has_waited = !has_sampled && (self.has_waited || waits);
        self.is_on_timer = self.clock != Clock::Rate && !has_sampled && !waits;
        self.has_started |= has_sampled;
        self.last = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_device_that_misses_three_periods_is_replaced_by_a_timer_until_it_is_back() {
        let mut schedule = TickSchedule::new(Clock::Device(0), 10);
        let mut samples = [0, 10, 20, 100, 110].into_iter().peekable();
        let mut ticks = Vec::new();
        while let Some(&sample) = samples.peek() {
            let now = schedule.next(Some(sample));
            ticks.push(now);
            schedule.ticked(now, sample <= now);
            samples.next_if(|sample| *sample <= now);
        }
        assert_eq!(ticks, [0, 10, 20, 50, 60, 70, 80, 90, 100, 110]);
    }

    #[test]
    fn a_late_tick_gives_the_clock_device_time_but_does_not_break_its_silence() {
        let mut schedule = TickSchedule::new(Clock::Device(0), 10);
        for (now, has_sampled, is_silent, what) in [
            (0, true, false, "it samples"),
            (60, false, false, "a late tick: the device may have been held up as well"),
            (90, false, true, "three periods after it"),
            (150, false, true, "another late tick: it has still not sampled"),
            (160, false, true, "so the timer goes on"),
            (165, true, false, "it is back"),
            (225, false, false, "a late tick again"),
            (285, false, true, "and another one: it gets more time only once"),
        ] {
            schedule.ticked(now, has_sampled);
            assert_eq!(schedule.is_silent(), is_silent, "{what}");
        }
    }

    #[test]
    fn a_rate_ticks_from_zero() {
        let mut schedule = TickSchedule::new(Clock::Rate, 4);
        for expected in [0, 4, 8] {
            let now = schedule.next(None);
            assert_eq!(now, expected);
            schedule.ticked(now, false);
        }
    }
}
