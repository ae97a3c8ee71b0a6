//! When the next tick is.

use crate::graph::Clock;

/// As many periods without a sample of the clock device, and a timer takes its place.
const PATIENCE: i64 = 3;

/// The times of the ticks, in virtual time or real.
#[derive(Debug, Clone)]
pub(crate) struct Timeline {
    clock: Clock,
    period: i64,
    last: Option<i64>,
    /// Whether a timer stands in for the clock device.
    is_on_timer: bool,
}

impl Timeline {
    pub(crate) const fn new(clock: Clock, period: i64) -> Self {
        Self { clock, period, last: None, is_on_timer: false }
    }

    pub(crate) const fn period(&self) -> i64 {
        self.period
    }

    pub(crate) fn is_clock(&self, device: usize) -> bool {
        self.clock == Clock::Device(device)
    }

    /// Whether a timer stands in for the clock device.
    pub(crate) const fn is_on_timer(&self) -> bool {
        self.is_on_timer
    }

    /// Latest time of the next tick: when a sample of the clock device is given up [ns].
    pub(crate) fn deadline(&self) -> i64 {
        let patience = if self.is_on_timer || self.clock == Clock::Rate { 1 } else { PATIENCE };
        match (self.last, self.clock) {
            (Some(last), _) => last + patience * self.period,
            (None, Clock::Rate) => 0,
            (None, Clock::Device(_)) => patience * self.period,
        }
    }

    /// Time of the next tick, given that of the clock device's next sample [ns].
    pub(crate) fn next(&self, sample: Option<i64>) -> i64 {
        let next = sample.map_or(self.deadline(), |sample| sample.min(self.deadline()));
        self.last.map_or(next, |last| next.max(last + 1))
    }

    /// There was a tick at `now`; whether the clock device sampled since the last.
    pub(crate) fn ticked(&mut self, now: i64, has_sampled: bool) {
        self.is_on_timer = self.clock != Clock::Rate && !has_sampled;
        self.last = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_device_that_misses_three_periods_is_replaced_by_a_timer_until_it_is_back() {
        let mut timeline = Timeline::new(Clock::Device(0), 10);
        let mut samples = [0, 10, 20, 100, 110].into_iter().peekable();
        let mut ticks = Vec::new();
        while let Some(&sample) = samples.peek() {
            let now = timeline.next(Some(sample));
            ticks.push(now);
            timeline.ticked(now, sample <= now);
            samples.next_if(|sample| *sample <= now);
        }
        assert_eq!(ticks, [0, 10, 20, 50, 60, 70, 80, 90, 100, 110]);
    }

    #[test]
    fn a_rate_ticks_from_zero() {
        let mut timeline = Timeline::new(Clock::Rate, 4);
        for expected in [0, 4, 8] {
            let now = timeline.next(None);
            assert_eq!(now, expected);
            timeline.ticked(now, false);
        }
    }
}
