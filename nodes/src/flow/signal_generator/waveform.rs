//! The form of a signal over time.
//!
//! With t the time since `start`, T the duration and A the amplitude:
//!
//! ```text
//! step   offset + A                        for 0 <= t < T
//! ramp   offset + A t / T                  and offset + A from T on
//! sine   offset + A sin(2 pi f t)          for 0 <= t < T
//! chirp  offset + A sin(2 pi (f t + (f_end - f) t^2 / (2 T)))
//! ```
//!
//! Before and after, the value is the offset. The phase of a chirp is the integral of its frequency, which goes
//! linearly from f to f_end; f(t) t would sweep twice as far. Phases are computed in turns and reduced to one turn
//! before the sine, so a long run loses no precision. Time is that of the tick: a late tick has the value of its own
//! time.

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
    /// Returns the signal `time` [s] after its start, for a `duration` [s] and frequencies at the start and at the end
    /// [Hz].
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
