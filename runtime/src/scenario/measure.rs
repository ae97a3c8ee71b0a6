//! Computes the figures of one value over one run. docs/scenarios.md defines each figure.

/// A value after one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Time since time 0 [s].
    pub time: f64,
    /// The value; NaN if it is absent.
    pub value: f64,
    /// Whether the value is new in this tick.
    pub is_new: bool,
}

/// Number of samples in the running mean of the response.
const RESPONSE_SAMPLES: usize = 10;
/// Time that the running mean must stay within the band [s].
const MIN_SETTLED_S: f64 = 0.5;
/// Minimum share of ticks in which a value must be present.
const MIN_PRESENT_SHARE: f64 = 0.9;
/// Tolerance of times, which are sums of periods [s].
const TIME_TOLERANCE_S: f64 = 1e-9;

/// Returns the readings from time `from` [s] on.
#[must_use]
pub fn since(readings: &[Reading], from: f64) -> &[Reading] {
    &readings[readings.partition_point(|reading| reading.time < from - TIME_TOLERANCE_S)..]
}

/// Returns the response time [s], or `None` if the value never settles.
///
/// It is the time at which the mean of the last ten new samples enters the band of `within` around `target` and then
/// stays in it for half a second. The mean starts again after an absent value.
#[must_use]
pub fn response(readings: &[Reading], target: f64, within: f64) -> Option<f64> {
    let mut last: Vec<f64> = Vec::with_capacity(RESPONSE_SAMPLES + 1);
    let mut entered = None;
    for reading in since(readings, 0.0) {
        if reading.value.is_nan() {
            last.clear();
        } else if reading.is_new {
            last.push(reading.value);
            last.drain(..last.len().saturating_sub(RESPONSE_SAMPLES));
        }
        let mean = || last.iter().sum::<f64>() / RESPONSE_SAMPLES as f64;
        let is_within = last.len() == RESPONSE_SAMPLES && (mean() - target).abs() <= within;
        entered = entered.filter(|_| is_within).or(is_within.then_some(reading.time));
        if entered.is_some_and(|entered| reading.time - entered >= MIN_SETTLED_S - TIME_TOLERANCE_S) {
            return entered;
        }
    }
    None
}

/// Returns the mean of the new samples, or `None` if the value is absent in more than a tenth of the ticks.
#[must_use]
pub fn mean(readings: &[Reading]) -> Option<f64> {
    let samples = samples(readings)?;
    Some(samples.iter().sum::<f64>() / samples.len() as f64)
}

/// Returns the standard deviation of the new samples, or `None` if the value is absent in more than a tenth of the
/// ticks.
#[must_use]
pub fn std(readings: &[Reading]) -> Option<f64> {
    let (samples, mean) = (samples(readings)?, mean(readings)?);
    let squares: f64 = samples.iter().map(|sample| (sample - mean) * (sample - mean)).sum();
    (samples.len() > 1).then(|| (squares / (samples.len() - 1) as f64).sqrt())
}

/// Returns the maximum over all ticks, or `None` if the value is always absent.
#[must_use]
pub fn max(readings: &[Reading]) -> Option<f64> {
    readings.iter().map(|reading| reading.value).filter(|value| !value.is_nan()).reduce(f64::max)
}

/// Returns the minimum over all ticks, or `None` if the value is always absent.
#[must_use]
pub fn min(readings: &[Reading]) -> Option<f64> {
    readings.iter().map(|reading| reading.value).filter(|value| !value.is_nan()).reduce(f64::min)
}

/// Returns the last present value minus the first, or `None` if the value is present in fewer than two ticks.
#[must_use]
pub fn change(readings: &[Reading]) -> Option<f64> {
    let mut present = readings.iter().map(|reading| reading.value).filter(|value| !value.is_nan());
    let start = present.next()?;
    present.next_back().map(|end| end - start)
}

/// Returns the new samples, or `None` if the value is absent too often.
fn samples(readings: &[Reading]) -> Option<Vec<f64>> {
    let present = readings.iter().filter(|reading| !reading.value.is_nan());
    let is_mostly_present = present.clone().count() as f64 >= MIN_PRESENT_SHARE * readings.len() as f64;
    let samples: Vec<f64> = present.filter(|reading| reading.is_new).map(|reading| reading.value).collect();
    (is_mostly_present && !samples.is_empty()).then_some(samples)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD: f64 = 0.004;

    /// A value for each tick of 4 ms, all new.
    fn sampled(seconds: f64, value: impl Fn(f64) -> f64) -> Vec<Reading> {
        let ticks = (seconds / PERIOD).round() as usize;
        let time = |tick: usize| tick as f64 * PERIOD;
        (0..=ticks).map(|tick| Reading { time: time(tick), value: value(time(tick)), is_new: true }).collect()
    }

    /// A decay from 2 with the time constant `tau` [s].
    fn decay(tau: f64) -> Vec<Reading> {
        sampled(5.0, |time| 2.0 * (-time / tau).exp())
    }

    #[test]
    fn the_response_of_a_decay_equals_the_closed_form() {
        for tau in [0.1, 0.3, 0.5, 1.0] {
            // The mean of the last ten samples of 2 exp(-t/tau) is 2 exp(-t/tau) times a geometric sum.
            let ratio = (PERIOD / tau).exp();
            let sum = (0..10).map(|k| ratio.powi(k)).sum::<f64>() / 10.0;
            let expected = (tau * (2.0 * sum / 0.3f64).ln()).max(9.0 * PERIOD);
            let found = response(&decay(tau), 0.0, 0.3).unwrap();
            assert!((0.0..PERIOD + 1e-9).contains(&(found - expected)), "tau {tau}: {found}, not {expected}");
        }
    }

    #[test]
    fn a_value_that_leaves_the_band_too_soon_has_not_settled() {
        let spike = |at: f64| move |time: f64| if (time - at).abs() < 0.1 { 1.0 } else { 0.0 };
        // It enters the band with the tenth sample, leaves it at 0.35 s and returns once the mean contains no spike.
        let found = response(&sampled(3.0, spike(0.45)), 0.0, 0.05).unwrap();
        assert!((found - 0.584).abs() < 1.5 * PERIOD, "{found}");
        // A spike after it has settled for half a second changes nothing.
        assert_eq!(response(&sampled(3.0, spike(2.0)), 0.0, 0.05), Some(9.0 * PERIOD));
        // The run ends before it has settled for half a second.
        assert_eq!(response(&sampled(0.52, |_| 0.0), 0.0, 0.05), None);
        assert!(response(&sampled(0.54, |_| 0.0), 0.0, 0.05).is_some());
        assert_eq!(response(&sampled(3.0, |_| 1.0), 0.0, 0.05), None);
        assert_eq!(response(&[], 0.0, 0.05), None);
    }

    #[test]
    fn an_absent_value_has_not_settled_and_a_held_one_is_not_a_sample() {
        let mut readings = sampled(3.0, |_| 0.0);
        readings[100].value = f64::NAN;
        // It is absent 0.4 s after the start, so the running mean starts again and is complete ten samples later.
        assert!((response(&readings, 0.0, 0.1).unwrap() - 110.0 * PERIOD).abs() < 1e-9);
        let slow: Vec<Reading> = sampled(3.0, |_| 0.0)
            .into_iter()
            .enumerate()
            .map(|(i, reading)| Reading { is_new: i % 5 == 0, ..reading })
            .collect();
        assert!((response(&slow, 0.0, 0.1).unwrap() - 45.0 * PERIOD).abs() < 1e-9);
        // Held values do not count: a mean that includes them would be 0.2.
        let held = [(1.0, true), (0.0, true), (0.0, false), (0.0, false), (0.0, false)];
        let held = held.map(|(value, is_new)| Reading { time: 0.0, value, is_new });
        assert_eq!((mean(&held), std(&held)), (Some(0.5), Some(0.5f64.sqrt())));
    }

    #[test]
    fn a_mean_needs_the_value_in_nine_tenths_of_the_ticks() {
        let with_absent = |count: usize| {
            let mut readings = sampled(0.396, |time| time);
            readings[..count].iter_mut().for_each(|reading| reading.value = f64::NAN);
            readings
        };
        assert_eq!(with_absent(0).len(), 100);
        assert!(mean(&with_absent(10)).is_some() && std(&with_absent(10)).is_some());
        assert!(mean(&with_absent(11)).is_none() && std(&with_absent(11)).is_none());
        // Absent values do not count for the extremes.
        assert_eq!((min(&with_absent(50)), max(&with_absent(50))), (Some(0.2), Some(0.396)));
        assert_eq!((min(&with_absent(100)), max(&[]), mean(&[])), (None, None, None));
    }

    #[test]
    fn the_deviations_of_a_sine_and_of_a_uniform_distribution_equal_the_closed_forms() {
        // Whole periods of a sine of amplitude a have a standard deviation of a / sqrt(2).
        let sine = sampled(10.0, |time| 3.0 + 0.5 * (std::f64::consts::TAU * time).sin());
        assert!((std(&sine[1..]).unwrap() - 0.5 / 2f64.sqrt()).abs() < 1e-3);
        assert!((mean(&sine[1..]).unwrap() - 3.0).abs() < 1e-12);
        // Multiples of the golden ratio modulo 1 are uniformly distributed: 1 / sqrt(12).
        let mut uniform = sampled(40.0, |_| 0.0);
        for (i, reading) in uniform.iter_mut().enumerate() {
            reading.value = (i as f64 * 0.618_033_988_749_895).fract();
        }
        assert!((std(&uniform).unwrap() - (1.0f64 / 12.0).sqrt()).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn figures_shift_and_scale_with_the_value(
            values in prop::collection::vec(-5.0..5.0f64, 2..300), shift in -3.0..3.0f64, scale in 0.1..4.0f64,
        ) {
            let at = |value: &dyn Fn(f64) -> f64| -> Vec<Reading> {
                let each = values.iter().enumerate();
                each.map(|(i, v)| Reading { time: i as f64 * PERIOD, value: value(*v), is_new: true }).collect()
            };
            let (plain, moved) = (at(&|v| v), at(&|v| v * scale + shift));
            let near = |a: Option<f64>, b: Option<f64>| (a.unwrap() - b.unwrap()).abs() < 1e-9;
            prop_assert!(near(mean(&moved), mean(&plain).map(|m| m * scale + shift)));
            prop_assert!(near(std(&moved), std(&plain).map(|s| s * scale)));
            prop_assert!(near(max(&moved), max(&plain).map(|v| v * scale + shift)));
            prop_assert!(min(&plain) <= mean(&plain) && mean(&plain) <= max(&plain));
        }
    }
}
