//! The response of a loop at the frequencies of the test signal.

use std::f64::consts::PI;

use nalgebra::Complex;

use super::signal::Sine;
use crate::tool::control::shape::turn;

/// The response at one frequency.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// Circular frequency [rad/s].
    pub(super) omega: f64,
    /// The response L around the loop. `Experiment::run` converts it to half of the gains of the graph.
    pub(super) open: Complex<f64>,
    /// Amplitude of the whole motion [m] or [rad].
    pub(super) amplitude: f64,
    /// Standard deviation of the response by noise, as the periods differ, relative to the response [1].
    pub(super) error: f64,
}

/// Largest error of a response that counts [1].
const MAX_ERROR: f64 = 0.3;
/// Motions that are as large, as a fraction of the largest one [1].
const AS_LARGE: f64 = 0.8;

impl Line {
    /// Returns whether noise leaves the response known.
    pub(super) fn counts(&self) -> bool {
        self.error <= MAX_ERROR
    }

    /// Returns the mean of the responses of several runs to each frequency, over the runs that have moved as far as any.
    pub(super) fn mean(runs: &[Vec<Self>]) -> Vec<Self> {
        let of = |i: usize| {
            let all = || runs.iter().filter_map(move |lines| lines.get(i));
            let most = all().map(|line| line.amplitude).fold(0.0, f64::max);
            let far: Vec<&Self> = all().filter(|line| line.amplitude >= AS_LARGE * most).collect();
            let number = far.len() as f64;
            let open = far.iter().map(|line| line.open).sum::<Complex<f64>>() / number;
            let variance = far.iter().map(|line| (line.open.norm() * line.error).powi(2)).sum::<f64>();
            Self { omega: far[0].omega, open, amplitude: most, error: variance.sqrt() / number / open.norm() }
        };
        (0..runs.first().map_or(0, Vec::len)).map(of).collect()
    }
}

/// Returns the response to one sine. Each row is the motion by the controller, and the whole motion.
pub(super) fn line(rows: &[[f64; 2]], sine: &Sine, period: f64) -> Line {
    let measured = &rows[sine.begin + sine.settling * sine.ticks..sine.end()];
    let spectra: Vec<[Complex<f64>; 2]> = measured.chunks_exact(sine.ticks).map(first_harmonic).collect();
    // The noise of the measurement moves the sensor too. The mean over the periods keeps what follows the signal.
    let mean = |i: usize| spectra.iter().map(|pair| pair[i]).sum::<Complex<f64>>() / spectra.len() as f64;
    let [own, all] = [mean(0), mean(1)];
    let omega = 2.0 * PI / (sine.ticks as f64 * period);
    let spread = spectra.iter().map(|pair| (pair[0] - own).norm_sqr()).sum::<f64>();
    let periods = spectra.len() as f64;
    Line {
        omega,
        open: -own / all,
        amplitude: 2.0 * all.norm() / (sine.ticks as f64 * omega),
        error: (spread / (periods * (periods - 1.0))).sqrt() / own.norm(),
    }
}

/// Returns the first harmonic of one period: of the motion by the controller, and of the whole motion.
fn first_harmonic(rows: &[[f64; 2]]) -> [Complex<f64>; 2] {
    let sum = |of: usize| {
        let part = |(i, row): (usize, &[f64; 2])| turn(2.0 * PI * i as f64 / rows.len() as f64) * row[of];
        rows.iter().enumerate().map(part).sum::<Complex<f64>>()
    };
    [sum(0), sum(1)]
}
