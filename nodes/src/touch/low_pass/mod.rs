//! `low_pass`: a first-order low-pass filter, T dy/dt = x - y.

use std::f64::consts::PI;

use tactflow_runtime::node::{At, Describe, Interval, Mistake, Mistakes, Node, Param, Reading, Setup, State, Tick};
use tactflow_runtime::source::Code;

use super::filter::{Averaging, Inputs, Outputs};

/// Smooths a feature with a first-order low-pass filter.
///
/// T dy/dt = x - y, solved exactly from sample to sample: y += (1 - exp(-dt / T)) (x - y), where dt is the time between
/// the stamps of the samples. So T means the same at 100 Hz and at 1 kHz, and for irregular samples. Set T as
/// `time_constant_ms`, or as `cutoff_hz`, 1 / (2 pi T): 40 ms are 4 Hz.
///
/// The filter is also called a lowpass, a one-pole filter or an exponential moving average. It lags a ramp by T, and
/// leaves dt / (2 T) of the variance of white noise, as much as a `moving_average` with a window of 2 T. Unlike
/// `moving_average` it needs no window, and old samples never lose all influence.
///
/// The first sample passes unchanged. The filter starts afresh after a gap longer than the graph's `max_gap_ms`, and
/// when another device takes the sample: that sample also passes unchanged.
///
/// **Axes.** The direction of a line (`rad mod pi`) is filtered as (cos 2a, sin 2a), since 89° and -89° are neighbours.
/// Small turns between two samples are filtered like any value; a turn by 90° passes through a point without a
/// direction, where the output is absent.
///
/// If the feature is absent, the output is absent. The state survives flicker and is reset when the feature is absent
/// for the graph's `reset_after_ms`.
///
/// ```toml
/// [nodes.low_pass]
/// type = "low_pass"
/// in.value = "moments.orientation"
/// time_constant_ms = 20               # [ms]
/// ```
#[derive(Describe)]
pub struct LowPass {
    /// Time constant T [s].
    time: f64,
    averaging: Averaging,
}

/// Parameters of `low_pass`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Time constant T, after which 63 % of a step has passed. Set this or `cutoff_hz`.
    #[param(unit = "ms", above = 0.0)]
    time_constant_ms: Option<f64>,
    /// Frequency 1 / (2 pi T), above which less than 71 % of an amplitude passes. Set this or `time_constant_ms`.
    #[param(unit = "Hz", above = 0.0)]
    cutoff_hz: Option<f64>,
}

/// What `low_pass` remembers.
#[derive(State)]
pub struct State {
    /// The mean vector of the last output.
    last: Option<[f64; 2]>,
    interval: Interval,
}

/// Smaller magnitudes become 0: far below any measurement, and far above the subnormal numbers, which are slow.
const MIN_VALUE: f64 = 1e-200;

impl Node for LowPass {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.reading = Reading::Same;
        let averaging = Averaging::new(&setup.inputs, &mut setup.outputs);
        match (params.time_constant_ms, params.cutoff_hz) {
            (Some(ms), None) => Ok(Self { time: ms * 1e-3, averaging }),
            (None, Some(hz)) => {
                let time = 0.5 / (PI * hz);
                if time < setup.period {
                    let message = format!(
                        "`cutoff_hz` is {hz} Hz: a time constant of {:.3} ms, shorter than a period",
                        time * 1e3
                    );
                    let help = format!("write less than {:.0} Hz, or remove the filter", 0.5 / (PI * setup.period));
                    setup
                        .warnings
                        .push(Mistake::new(Code::ShortTime, At::Param("cutoff_hz".into()), message).help(help));
                }
                Ok(Self { time, averaging })
            }
            (None, None) => {
                let message = "`low_pass` needs `time_constant_ms` or `cutoff_hz`";
                let mistake = Mistake::new(Code::MissingKey, At::Node, message);
                Err(mistake.help("add one of the two, such as `time_constant_ms = 20`").into())
            }
            (Some(_), Some(_)) => {
                let mistake = Mistake::key("cutoff_hz", "`time_constant_ms` and `cutoff_hz` exclude each other");
                Err(mistake.help("leave out one of the two: a cutoff of 1 Hz is a time constant of 159 ms").into())
            }
        }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let dt = state.interval.step(&inputs.value, tick);
        let next = self.averaging.vector(*inputs.value);
        let value = match state.last.zip(dt) {
            Some(([a, b], dt)) => {
                // A time constant that underflows to 0 would make 0 / 0 of a dt of 0.
                let share = if dt > 0.0 { -libm::expm1(-dt / self.time) } else { 0.0 };
                [toward(a, next[0], share), toward(b, next[1], share)]
            }
            None => next,
        };
        state.last = Some(value);
        if let Some(value) = self.averaging.value(value) {
            out.value.set(value);
        }
    }
}

/// Returns the value at the fraction `share` of the way from `last` to `next`.
fn toward(last: f64, next: f64, share: f64) -> f64 {
    let difference = next - last;
    let value = if difference.is_finite() { last + share * difference } else { last * (1.0 - share) + next * share };
    if value.abs() < MIN_VALUE { 0.0 } else { value }
}

#[cfg(test)]
mod tests;
