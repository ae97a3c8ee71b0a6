//! `moving_average`: the mean of the newest samples of a feature (paper section V: of force and orientation, over ten).
//!
//! The window is summed from its oldest sample to its newest in each step: the sum does not drift, and a sample that has
//! left the window has no influence.

use tactflow_runtime::node::{
    Describe, In, Inputs, Interval, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::Scalar;

use crate::motion::axis::{doubled, halved};

/// Smooths a feature: the mean over the newest samples, or over a time.
///
/// The mean of the last samples (a moving average); the paper smooths force and orientation over ten samples (section V).
/// At the start the mean is over the samples so far. Each sample counts once, however long it is held.
///
/// **The window** is a number of samples, `window`, or a time, `window_ms`. A time means the same at every rate: the mean
/// is over the samples whose stamps are less than `window_ms` older than the newest, even if they are irregular. At
/// 250 Hz, 40 ms are ten samples. The newest sample always counts, so a window shorter than the time between two samples
/// does not change them. The window holds twice as many samples as the graph's nominal rate gives; at a higher rate the
/// window is shorter. A window of time starts afresh after a gap longer than the graph's `max_gap_ms`, and when another
/// device takes the samples.
///
/// **Axes.** The direction of a line (`rad mod pi`) has no arithmetic mean, as 89° and -89° are neighbours. The mean is
/// over (cos 2a, sin 2a) instead: over ten samples near 90° with 3° of noise its error is 0.65°, that of the arithmetic
/// mean 72°. Axes that cancel each other have no mean: the output is absent.
///
/// **Lag.** The mean lags by half the window, though its stamp is that of the newest sample. A `low_pass` whose time
/// constant is half of `window_ms` has the same lag and leaves the same noise. A `median` removes single wrong samples.
///
/// If the feature is absent, the output is absent. The window survives flicker and is reset when the feature is absent for
/// the graph's `reset_after_ms`.
///
/// ```toml
/// [nodes.moving_average]
/// type = "moving_average"
/// in.value = "moments.pressure"
/// window_ms = 40                      # ten frames at 250 Hz [ms]
/// ```
#[derive(Describe)]
#[describe(name = "moving_average")]
pub struct MovingAverage {
    /// Largest number of samples in the window.
    capacity: usize,
    /// Length of the window [ns], unless it is a number of samples.
    time: Option<i64>,
    is_axial: bool,
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

/// What `moving_average` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Any feature.
    #[port(unit = "U", frame = "A")]
    value: In<'a, Scalar>,
}

/// What `moving_average` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Its mean over the window; absent for axes that cancel each other.
    #[port(unit = "U", frame = "A")]
    value: Out<Scalar>,
}

/// What `moving_average` remembers.
#[derive(State)]
pub struct State {
    /// The newest samples in a ring: the cosine and the sine of the doubled angle of an axis, else the value and 0.
    ring: Vec<[f64; 2]>,
    /// Time of each of them [ns]; empty if the window is a number of samples.
    times: Vec<i64>,
    /// Time of the newest sample [ns], from an arbitrary zero.
    now: i64,
    interval: Interval,
    /// Index of the next sample.
    next: usize,
    /// Number of samples in the window.
    count: usize,
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
        let is_axial = setup.inputs.value.unit.is_axial();
        setup.outputs.value.range = setup.inputs.value.range;
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
        Ok(Self { capacity, time, is_axial })
    }

    fn state(&self) -> State {
        let times = if self.time.is_some() { vec![0; self.capacity] } else { Vec::new() };
        State { ring: vec![[0.0; 2]; self.capacity], times, now: 0, interval: Interval::default(), next: 0, count: 0 }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let value = *inputs.value;
        if let Some(time) = self.time {
            let dt = state.interval.step(&inputs.value, tick);
            state.advance(dt, time);
        }
        if !self.is_axial {
            state.push([value, 0.0]);
            out.value.set(state.mean()[0]);
            return;
        }
        state.push(doubled(value));
        if let Some(mean) = halved(state.mean()) {
            out.value.set(mean);
        }
    }
}

impl State {
    fn push(&mut self, sample: [f64; 2]) {
        self.ring[self.next] = sample;
        self.next = if self.next + 1 < self.ring.len() { self.next + 1 } else { 0 };
        self.count = (self.count + 1).min(self.ring.len());
    }

    /// Sets the time of the next sample, `dt` [s] after the last one, and removes the samples that are `time` [ns] older or
    /// more. Without a `dt` it removes all.
    fn advance(&mut self, dt: Option<f64>, time: i64) {
        match dt {
            Some(dt) => self.now += (dt * 1e9).round() as i64,
            None => self.count = 0,
        }
        // In a full ring the next sample replaces the oldest.
        self.count = self.count.min(self.ring.len() - 1);
        self.times[self.next] = self.now;
        while self.count > 0 && self.now - self.times[self.oldest()] >= time {
            self.count -= 1;
        }
    }

    /// Returns the index of the oldest sample of the window, or of the next one if the window is empty.
    fn oldest(&self) -> usize {
        if self.next >= self.count { self.next - self.count } else { self.next + self.ring.len() - self.count }
    }

    fn mean(&self) -> [f64; 2] {
        let oldest = self.oldest();
        let end = (oldest + self.count).min(self.ring.len());
        let (older, newer) = (&self.ring[oldest..end], &self.ring[..self.count - (end - oldest)]);
        let count = self.count as f64;
        let sum = add_up(older, newer, |sample| sample);
        if sum[0].is_finite() {
            return sum.map(|sum| sum / count);
        }
        // The sum of very large samples is infinite, their mean is not.
        add_up(older, newer, |sample| sample / count).map(|mean| mean.clamp(f64::MIN, f64::MAX))
    }
}

/// Returns the sums over both parts of the ring.
fn add_up(older: &[[f64; 2]], newer: &[[f64; 2]], scale: impl Fn(f64) -> f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for samples in [older, newer] {
        for [a, b] in samples {
            sum = [sum[0] + scale(*a), sum[1] + scale(*b)];
        }
    }
    sum
}

#[cfg(test)]
mod tests;
