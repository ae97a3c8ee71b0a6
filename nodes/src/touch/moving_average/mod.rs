//! `moving_average`: the mean of the newest samples of a feature (paper section V: of force and orientation, over ten).
//!
//! The window is summed from its oldest sample to its newest in each step: the sum does not drift, and a sample that
//! has left the window has no influence.

mod mean;

use tactflow_runtime::node::{Describe, Interval, Mistake, Mistakes, Node, Param, Reading, Setup, State, Tick};

use super::filter::{Averaging, Inputs, Outputs, Ring};
use mean::{TimedVector, mean};

/// Smooths a feature: the mean over the newest samples, or over a time.
///
/// The mean of the last samples (a moving average); the paper smooths force and orientation over ten samples (section
/// V). At the start the mean is over the samples so far. Each sample counts once, however long it is held.
///
/// **The window** is a number of samples, `window`, or a time, `window_ms`. A time means the same at every rate: the
/// mean is over the samples whose stamps are less than `window_ms` older than the newest, even if they are irregular.
/// At 250 Hz, 40 ms are ten samples. The newest sample always counts, so a window shorter than the time between two
/// samples does not change them. The window holds twice as many samples as the graph's nominal rate gives; at a higher
/// rate the window is shorter. A window of time starts afresh after a gap longer than the graph's `max_gap_ms`, and
/// when another device takes the samples.
///
/// **Axes.** The direction of a line (`rad mod pi`) has no arithmetic mean, as 89° and -89° are neighbours. The mean is
/// over (cos 2a, sin 2a) instead: over ten samples near 90° with 3° of noise its error is 0.65°, that of the arithmetic
/// mean 72°. Axes that cancel each other have no mean: the output is absent.
///
/// **Lag.** The mean lags by half the window, though its stamp is that of the newest sample. A `low_pass` whose time
/// constant is half of `window_ms` has the same lag and leaves the same noise. A `median` removes single wrong samples.
///
/// If the feature is absent, the output is absent. The window survives flicker and is reset when the feature is absent
/// for the graph's `reset_after_ms`.
///
/// ```toml
/// [nodes.moving_average]
/// type = "moving_average"
/// in.value = "moments.pressure"
/// window_ms = 40                      # ten frames at 250 Hz [ms]
/// ```
#[derive(Describe)]
pub struct MovingAverage {
    /// Largest number of samples in the window.
    capacity: usize,
    /// Length of the window [ns], unless it is a number of samples.
    time: Option<i64>,
    averaging: Averaging,
}

/// Parameters of `moving_average`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Length of the window as a number of samples; 10 without `window` and `window_ms`.
    #[param(unit = "sample", range = 1..=1_000_000)]
    window: Option<usize>,
    /// Length of the window as a time.
    #[param(unit = "ms", above = 0.0)]
    window_ms: Option<f64>,
}

/// What `moving_average` remembers.
#[derive(State)]
pub struct State {
    ring: Ring<TimedVector>,
    /// Time of the newest sample [ns], from an arbitrary zero; 0 if the window is a number of samples.
    now: i64,
    interval: Interval,
}

/// Window without parameters, as in the paper [samples].
const DEFAULT_WINDOW: usize = 10;
/// Largest number of samples in a window of time, at the graph's rate.
const MAX_SAMPLES: f64 = 100_000.0;

impl Node for MovingAverage {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.reading = Reading::Same;
        let averaging = Averaging::new(&setup.inputs, &mut setup.outputs);
        let (capacity, time) = match (params.window, params.window_ms) {
            (window, None) => (window.unwrap_or(DEFAULT_WINDOW), None),
            (None, Some(ms)) => {
                let samples = ms * 1e-3 / setup.period;
                if samples > MAX_SAMPLES {
                    let message =
                        format!("a window of {ms} ms has more than {MAX_SAMPLES} samples at the graph's rate");
                    let mistake = Mistake::param("window_ms", message);
                    return Err(mistake.help("use a `low_pass`, which has no window").into());
                }
                (2 * samples.ceil() as usize + 1, Some((ms * 1e6).round() as i64))
            }
            (Some(_), Some(_)) => {
                let mistake = Mistake::key("window_ms", "`window` and `window_ms` exclude each other");
                return Err(mistake.help("leave out one of the two").into());
            }
        };
        Ok(Self { capacity, time, averaging })
    }

    fn state(&self) -> State {
        State { ring: Ring::new(self.capacity), now: 0, interval: Interval::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        if let Some(window) = self.time {
            match state.interval.step(&inputs.value, tick) {
                Some(dt) => state.now += (dt * 1e9).round() as i64,
                None => state.ring.clear(),
            }
            state.ring.forget(|(time, _)| state.now - time >= window);
        }
        state.ring.push((state.now, self.averaging.vector(*inputs.value)));
        if let Some(mean) = self.averaging.value(mean(&state.ring)) {
            out.value.set(mean);
        }
    }
}

#[cfg(test)]
mod tests;
