//! The form of a signal over time, with amplitude 1.

use std::f64::consts::TAU;

use tactflow_runtime::node::Param;

/// The form of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum Waveform {
    /// A jump at the start.
    Step,
    /// A straight line.
    Ramp,
    /// A sine of one frequency.
    Sine,
    /// A sine whose frequency changes linearly.
    Chirp,
}

impl Waveform {
    /// Returns the signal `time` [s] after its start, for a `duration` [s] and frequencies at the start and at the end [Hz].
    pub(super) fn at(self, time: f64, duration: f64, frequencies: [f64; 2]) -> f64 {
        let is_over = time >= duration;
        match self {
            _ if time < 0.0 => 0.0,
            Self::Ramp => (time / duration).min(1.0),
            _ if is_over => 0.0,
            Self::Step => 1.0,
            Self::Sine | Self::Chirp => {
                let turns = turns(frequencies, duration, time);
                libm::sin(TAU * (turns - turns.floor()))
            }
        }
    }
}

/// Returns the phase after `time` [s] in turns, for a frequency that goes linearly from `first` to `last` [Hz] in
/// `duration` [s].
pub(super) fn turns([first, last]: [f64; 2], duration: f64, time: f64) -> f64 {
    (first + (last - first) * (0.5 * time / duration)) * time
}
