//! The test signal: sines, one after the other, and how long a run with them takes.

use std::f64::consts::PI;

use tactflow_runtime::graph::Outline;

use super::lift;

/// Frequencies of the test signal [Hz].
const FREQUENCIES_HZ: [f64; 11] = [0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0];
/// Time after the begin of the mode until the test signal begins [s].
const BEGIN_S: f64 = 6.0;
/// Time for the response to a frequency to become periodic [s], and at least one period.
const SETTLING_S: f64 = 1.0;
/// Time in which a frequency is measured [s], and at least three periods.
const MEASURING_S: f64 = 2.0;
/// Time for the approach [s].
const APPROACH_S: f64 = 20.0;

/// Largest speed of the test signal along each component [m/s], [rad/s]. A faster one shows what friction hides of a
/// resonance. Along the object, a faster one lets the contact slip out of its mode.
const FASTEST: [f64; 6] = [0.015, 0.015, 0.03, 0.5, 0.5, 0.5];
/// Part of the limits of a task that the test signal takes: the loop moves the sensor too [1].
const SHARE_OF_LIMITS: f64 = 0.6;

/// How fast the test signal moves along a component at most.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    /// Speed [m/s], [rad/s].
    speed: f64,
    /// Acceleration [m/s²], [rad/s²].
    acceleration: f64,
}

impl Pace {
    /// Returns the largest ones along each component, below the limits that `limit` returns for a key.
    pub(super) fn all(limit: impl Fn(&str) -> Option<f64>) -> [Self; 6] {
        let share = |key: &str| SHARE_OF_LIMITS * limit(key).unwrap_or(f64::INFINITY);
        let linear = [share("linear_m_per_s"), share("linear_m_per_s2")];
        let angular = [share("angular_rad_per_s"), share("angular_rad_per_s2")];
        std::array::from_fn(|i| {
            let [speed, acceleration] = if i < 3 { linear } else { angular };
            Self { speed: FASTEST[i].min(speed), acceleration }
        })
    }

    /// Returns a part of it.
    pub(super) fn times(self, part: f64) -> Self {
        Self { speed: part * self.speed, acceleration: part * self.acceleration }
    }
}

/// One sine of the test signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sine {
    /// Number of ticks in a period.
    pub(super) ticks: usize,
    /// Tick at which it begins, counted from the begin of the mode.
    pub(super) begin: usize,
    /// Number of periods for the response to settle.
    pub(super) settling: usize,
    /// Number of periods that are measured.
    pub(super) measured: usize,
}

impl Sine {
    /// Returns the sines of a test signal, one after the other, for ticks of `period` [s].
    pub(super) fn all(period: f64) -> Vec<Self> {
        let mut begin = (BEGIN_S / period).round() as usize;
        let mut ticks = FREQUENCIES_HZ.map(|hz| (1.0 / (hz * period)).round().max(4.0) as usize).to_vec();
        // A slow graph has no more than four ticks in the fastest sines.
        ticks.dedup();
        let sine = |ticks: usize| {
            let periods = |seconds: f64| (seconds / (ticks as f64 * period)).ceil() as usize;
            let sine =
                Self { ticks, begin, settling: periods(SETTLING_S).max(1), measured: periods(MEASURING_S).max(3) };
            begin = sine.end();
            sine
        };
        ticks.into_iter().map(sine).collect()
    }

    /// Returns the tick after its last one.
    pub(super) const fn end(&self) -> usize {
        self.begin + (self.settling + self.measured) * self.ticks
    }

    /// Returns its amplitude as a speed, for an amplitude of the motion [m] or [rad].
    pub(super) fn speed(&self, amplitude: f64, most: Pace, period: f64) -> f64 {
        let omega = 2.0 * PI / (self.ticks as f64 * period);
        (omega * amplitude).min(most.speed).min(most.acceleration / omega)
    }
}

/// Returns the settings that let the simulated devices of a graph run for so long [s].
pub(super) fn long_enough(outline: &Outline, seconds: f64) -> impl Iterator<Item = String> {
    let limited = outline.devices.iter().filter(|device| device.settings.iter().any(|one| one.path == "for_s"));
    limited.map(move |device| format!("devices.{}.for_s={seconds:?}", device.name))
}

/// Returns the number of ticks of `period` [s] in which a contact settles before it is measured.
pub(super) fn settling(period: f64) -> usize {
    Sine::all(period).first().map_or(0, |sine| sine.begin)
}

/// Returns how long the mode is measured, for ticks of `period` [s].
pub(super) fn measured(period: f64) -> f64 {
    Sine::all(period).last().map_or(0.0, |sine| sine.end() as f64 * period)
}

/// Returns how long a run takes at most, for ticks of `period` [s].
pub(super) fn duration(period: f64) -> f64 {
    APPROACH_S + measured(period) + lift::LASTS_S
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_graph_measures_each_frequency_once() {
        for period in [0.004, 0.04, 0.1] {
            let sines = Sine::all(period);
            assert!(
                sines.len() >= 5 && sines.is_sorted_by(|a, b| a.ticks > b.ticks && a.end() == b.begin),
                "{sines:?}"
            );
        }
    }

    #[test]
    fn a_signal_keeps_below_the_limits_of_the_task() {
        let limit = |key: &str| match key {
            "linear_m_per_s" => Some(0.02),
            "linear_m_per_s2" => Some(0.5),
            _ => None,
        };
        let pace = Pace::all(limit);
        for sine in Sine::all(0.004) {
            let omega = 2.0 * PI / (sine.ticks as f64 * 0.004);
            let speed = sine.speed(0.0048, pace[2], 0.004);
            assert!(
                speed <= 0.6 * 0.02 + 1e-12 && speed * omega <= 0.6 * 0.5 + 1e-12 && speed <= omega * 0.0048 + 1e-12
            );
            assert!(sine.speed(0.0048, pace[2].times(0.2), 0.004) <= 0.2 * 0.6 * 0.02 + 1e-12);
            assert!(sine.speed(0.08, pace[5], 0.004) <= FASTEST[5]);
        }
    }
}
