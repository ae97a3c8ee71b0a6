//! One period of a multisine, with a peak of at most 1.
//!
//! Schroeder's phases of a flat spectrum are φ_k = -pi k (k - 1) / N. The peak is searched on a grid of M =
//! [`OVERSAMPLING`] n points, with n the largest harmonic; between the points a trigonometric polynomial of degree n
//! exceeds its largest value there at most by the factor 1 / cos(pi n / M) (Ehlich and Zeller, Math. Zeitschrift 86,
//! 1964). A sum of sines has no mean, so it has a zero, where the period begins. Phases are in turns and reduced to one
//! turn before the sine, so a long run loses no precision.

use std::f64::consts::{PI, TAU};

/// Points of the search for the peak in one period of the highest sine.
const OVERSAMPLING: usize = 32;

/// A sum of sines of equal amplitude.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wave {
    /// Multiple of the inverse of the period that the first sine has.
    first: usize,
    /// Phase of each sine [turns].
    phases: Box<[f64]>,
    /// Amplitude of each sine [1].
    amplitude: f64,
    /// Period [s].
    period: f64,
    /// Part of the period at which the wave begins: a zero.
    start: f64,
}

impl Wave {
    /// Creates the wave of `count` successive multiples of the inverse of a period [s], from the multiple `first` on.
    pub(super) fn new(first: usize, count: usize, period: f64) -> Self {
        let phase = |k: usize| -(k as f64) * (k as f64 - 1.0) / (2.0 * count as f64);
        let phases: Box<[f64]> = (1..=count).map(phase).map(|turns| turns - turns.floor()).collect();
        let mut wave = Self { first, phases, amplitude: 1.0, period, start: 0.0 };
        let points = OVERSAMPLING * (first + count - 1);
        let part = |i: usize| i as f64 / points as f64;
        let peak = (0..points).fold(0.0, |peak: f64, i| peak.max(wave.value(part(i)).abs()));
        let rising = (0..points).find(|i| wave.value(part(*i)) <= 0.0 && wave.value(part(*i + 1)) > 0.0);
        wave.start = rising.map_or(0.0, |i| wave.zero(part(i), part(i + 1)));
        wave.amplitude = libm::cos(PI / OVERSAMPLING as f64) / peak;
        wave
    }

    /// Returns the value `time` [s] after the start.
    pub(super) fn at(&self, time: f64) -> f64 {
        self.value(self.start + time / self.period)
    }

    /// Returns the amplitude of each sine.
    #[cfg(test)]
    pub(super) const fn amplitude(&self) -> f64 {
        self.amplitude
    }

    /// Returns the value at a time in periods.
    fn value(&self, periods: f64) -> f64 {
        let part = periods - periods.floor();
        let sine = |(k, phase): (usize, &f64)| {
            let turns = (self.first + k) as f64 * part + phase;
            libm::sin(TAU * (turns - turns.floor()))
        };
        self.amplitude * self.phases.iter().enumerate().map(sine).sum::<f64>()
    }

    /// Returns the zero between two parts of the period, at the first of which the value is not positive, and at the
    /// second positive.
    fn zero(&self, mut below: f64, mut above: f64) -> f64 {
        for _ in 0..60 {
            let middle = below.midpoint(above);
            if self.value(middle) > 0.0 { above = middle } else { below = middle }
        }
        below
    }
}
