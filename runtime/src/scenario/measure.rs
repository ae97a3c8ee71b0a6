//! What is measured of one value over one run. docs/scenarios.md says in words what each figure is.

/// A value as a tick has left it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Time since time 0 [s].
    pub time: f64,
    /// The value; NaN if it is absent.
    pub value: f64,
    /// Whether it was made in this tick.
    pub is_new: bool,
}

/// Samples of the running mean that tells the response.
const FRAMES: usize = 10;
/// How long the running mean has to stay within the band [s].
const STAYS: f64 = 0.5;
/// Share of the ticks of a window in which a value must be there.
const PRESENT: f64 = 0.9;
/// Times are sums of periods: a nanosecond is nothing.
const NOTHING: f64 = 1e-9;

/// The readings from `from` on [s].
#[must_use]
pub fn since(readings: &[Reading], from: f64) -> &[Reading] {
    &readings[readings.partition_point(|reading| reading.time < from - NOTHING)..]
}

/// Response time: when the mean of the last ten new samples comes within `within` of `target`, to stay for half a second
/// [s]. None if it never does. An absent value is not there, and the mean begins anew.
#[must_use]
pub fn response(readings: &[Reading], target: f64, within: f64) -> Option<f64> {
    let mut last: Vec<f64> = Vec::with_capacity(FRAMES + 1);
    let mut entered = None;
    for reading in since(readings, 0.0) {
        if reading.value.is_nan() {
            last.clear();
        } else if reading.is_new {
            last.push(reading.value);
            last.drain(..last.len().saturating_sub(FRAMES));
        }
        let is_within = last.len() == FRAMES && (last.iter().sum::<f64>() / FRAMES as f64 - target).abs() <= within;
        entered = entered.filter(|_| is_within).or(is_within.then_some(reading.time));
        if entered.is_some_and(|entered| reading.time - entered >= STAYS - NOTHING) {
            return entered;
        }
    }
    None
}

/// Mean of the new samples; none if the value is absent in more than a tenth of the ticks.
#[must_use]
pub fn mean(readings: &[Reading]) -> Option<f64> {
    let samples = samples(readings)?;
    Some(samples.iter().sum::<f64>() / samples.len() as f64)
}

/// Standard deviation of the new samples about their mean; none if the value is absent in more than a tenth of the ticks.
#[must_use]
pub fn std(readings: &[Reading]) -> Option<f64> {
    let (samples, mean) = (samples(readings)?, mean(readings)?);
    let squares: f64 = samples.iter().map(|sample| (sample - mean) * (sample - mean)).sum();
    (samples.len() > 1).then(|| (squares / (samples.len() - 1) as f64).sqrt())
}

/// Greatest value that is there in any tick.
#[must_use]
pub fn greatest(readings: &[Reading]) -> Option<f64> {
    readings.iter().map(|reading| reading.value).filter(|value| !value.is_nan()).reduce(f64::max)
}

/// Least value that is there in any tick.
#[must_use]
pub fn least(readings: &[Reading]) -> Option<f64> {
    readings.iter().map(|reading| reading.value).filter(|value| !value.is_nan()).reduce(f64::min)
}

/// The new samples, if the value is there often enough.
fn samples(readings: &[Reading]) -> Option<Vec<f64>> {
    let present = readings.iter().filter(|reading| !reading.value.is_nan());
    let is_often_there = present.clone().count() as f64 >= PRESENT * readings.len() as f64;
    let samples: Vec<f64> = present.filter(|reading| reading.is_new).map(|reading| reading.value).collect();
    (is_often_there && !samples.is_empty()).then_some(samples)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD: f64 = 0.004;

    /// A value for each tick of 4 ms, all new.
    fn course(seconds: f64, value: impl Fn(f64) -> f64) -> Vec<Reading> {
        let ticks = (seconds / PERIOD).round() as usize;
        let time = |tick: usize| tick as f64 * PERIOD;
        (0..=ticks).map(|tick| Reading { time: time(tick), value: value(time(tick)), is_new: true }).collect()
    }

    /// Two tactels that decay with `tau` into 0.3 of one.
    fn decay(tau: f64) -> Vec<Reading> {
        course(5.0, |time| 2.0 * (-time / tau).exp())
    }

    #[test]
    fn the_response_of_a_decay_is_known() {
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
    fn what_leaves_the_band_too_soon_has_not_settled() {
        let spike = |at: f64| move |time: f64| if (time - at).abs() < 0.1 { 1.0 } else { 0.0 };
        // In the band with the tenth sample, out of it at 0.35 s and back when the last of the spike is averaged out.
        let found = response(&course(3.0, spike(0.45)), 0.0, 0.05).unwrap();
        assert!((found - 0.584).abs() < 1.5 * PERIOD, "{found}");
        // Once it has stayed for half a second it has settled, whatever comes later.
        assert_eq!(response(&course(3.0, spike(2.0)), 0.0, 0.05), Some(9.0 * PERIOD));
        // The run ends before it has stayed long enough.
        assert_eq!(response(&course(0.52, |_| 0.0), 0.0, 0.05), None);
        assert!(response(&course(0.54, |_| 0.0), 0.0, 0.05).is_some());
        assert_eq!(response(&course(3.0, |_| 1.0), 0.0, 0.05), None);
        assert_eq!(response(&[], 0.0, 0.05), None);
    }

    #[test]
    fn an_absent_value_has_not_settled_and_a_held_one_is_no_sample() {
        let mut readings = course(3.0, |_| 0.0);
        readings[100].value = f64::NAN;
        // Absent 0.4 s after the start: ten samples later it counts anew.
        assert!((response(&readings, 0.0, 0.1).unwrap() - 110.0 * PERIOD).abs() < 1e-9);
        let slow: Vec<Reading> = course(3.0, |_| 0.0)
            .into_iter()
            .enumerate()
            .map(|(i, reading)| Reading { is_new: i % 5 == 0, ..reading })
            .collect();
        assert!((response(&slow, 0.0, 0.1).unwrap() - 45.0 * PERIOD).abs() < 1e-9);
        // What is repeated weighs nothing: a mean over held values would be 0.2.
        let held = [(1.0, true), (0.0, true), (0.0, false), (0.0, false), (0.0, false)];
        let held = held.map(|(value, is_new)| Reading { time: 0.0, value, is_new });
        assert_eq!((mean(&held), std(&held)), (Some(0.5), Some(0.5f64.sqrt())));
    }

    #[test]
    fn a_mean_needs_nine_tenths_of_the_ticks() {
        let with_absent = |count: usize| {
            let mut readings = course(0.396, |time| time);
            readings[..count].iter_mut().for_each(|reading| reading.value = f64::NAN);
            readings
        };
        assert_eq!(with_absent(0).len(), 100);
        assert!(mean(&with_absent(10)).is_some() && std(&with_absent(10)).is_some());
        assert!(mean(&with_absent(11)).is_none() && std(&with_absent(11)).is_none());
        // What is absent neither exceeds nor falls below anything.
        assert_eq!((least(&with_absent(50)), greatest(&with_absent(50))), (Some(0.2), Some(0.396)));
        assert_eq!((least(&with_absent(100)), greatest(&[]), mean(&[])), (None, None, None));
    }

    #[test]
    fn the_deviation_of_a_sine_and_of_a_uniform_distribution_is_known() {
        // Whole periods of a sine of amplitude a have a standard deviation of a / sqrt(2).
        let sine = course(10.0, |time| 3.0 + 0.5 * (std::f64::consts::TAU * time).sin());
        assert!((std(&sine[1..]).unwrap() - 0.5 / 2f64.sqrt()).abs() < 1e-3);
        assert!((mean(&sine[1..]).unwrap() - 3.0).abs() < 1e-12);
        // Multiples of the golden ratio modulo 1 are uniformly distributed: 1 / sqrt(12).
        let mut uniform = course(40.0, |_| 0.0);
        for (i, reading) in uniform.iter_mut().enumerate() {
            reading.value = (i as f64 * 0.618_033_988_749_895).fract();
        }
        assert!((std(&uniform).unwrap() - (1.0f64 / 12.0).sqrt()).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn figures_move_and_scale_with_the_value(
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
            prop_assert!(near(greatest(&moved), greatest(&plain).map(|v| v * scale + shift)));
            prop_assert!(least(&plain) <= mean(&plain) && mean(&plain) <= greatest(&plain));
        }
    }
}
