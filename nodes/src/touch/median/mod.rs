//! `median`: the middle one of the newest samples of a feature.

use std::cmp::Ordering;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::Scalar;

use crate::motion::axis::wrap_axial;

/// Removes single wrong samples from a feature: the median of the newest samples.
///
/// The middle one of the last `window` samples in order of size; of an even number, the mean of the two in the middle. At
/// the start it is the median of the samples so far. A glitch of fewer than half the window has no influence, while it
/// shifts a mean. Each sample counts once, however long it is held.
///
/// **Axes.** The directions of lines (`rad mod pi`) have no order of size. Their median is the sample with the smallest sum
/// of distances to all others, modulo pi; of two that are equal, the newer. It is always one of the samples, so it exists
/// even for axes that cancel each other.
///
/// A step passes half a window late, and stays a step. Against white noise a `moving_average` with the same window is better: the
/// median leaves 1.25 times its standard deviation. Against both, use a short `median` and a `moving_average` after it. A `moving_average`
/// can also have a longer window.
///
/// If the feature is absent, the output is absent. The window survives flicker and is reset when the feature is absent for
/// the graph's `reset_after_ms`.
///
/// ```toml
/// [nodes.median]
/// type = "median"
/// in.value = "moments.pressure"
/// window = 5                          # two wrong samples have no influence [samples]
/// ```
#[derive(Describe)]
#[describe(name = "median")]
pub struct Median {
    window: usize,
    is_axial: bool,
}

/// Parameters of `median`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Number of samples.
    #[param(unit = "sample", range = 1..=MAX_WINDOW, default = 5)]
    window: usize,
}

/// What `median` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Any feature.
    #[port(unit = "U", frame = "A")]
    value: In<'a, Scalar>,
}

/// What `median` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The median of the window.
    #[port(unit = "U", frame = "A")]
    value: Out<Scalar>,
}

/// What `median` remembers.
#[derive(State)]
pub struct State {
    /// The newest samples in a ring.
    ring: Vec<f64>,
    /// Buffer for the samples in order of size.
    sorted: Vec<f64>,
    /// Index of the next sample.
    next: usize,
    /// Number of samples in the window.
    count: usize,
}

/// Largest window [samples]: a step compares each axis with each other.
const MAX_WINDOW: usize = 255;

impl Node for Median {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.value.range = setup.inputs.value.range;
        Ok(Self { window: params.window, is_axial: setup.inputs.value.unit.is_axial() })
    }

    fn state(&self) -> State {
        State { ring: vec![0.0; self.window], sorted: vec![0.0; self.window], next: 0, count: 0 }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.push(*inputs.value);
        out.value.set(if self.is_axial { wrap_axial(state.median_axis()) } else { state.median() });
    }
}

impl State {
    fn push(&mut self, sample: f64) {
        self.ring[self.next] = sample;
        self.next = if self.next + 1 < self.ring.len() { self.next + 1 } else { 0 };
        self.count = (self.count + 1).min(self.ring.len());
    }

    fn median(&mut self) -> f64 {
        // Until the ring is full, the samples are at its start.
        let sorted = &mut self.sorted[..self.count];
        sorted.copy_from_slice(&self.ring[..self.count]);
        let (below, middle, _) = sorted.select_nth_unstable_by(self.count / 2, f64::total_cmp);
        if self.count % 2 == 1 {
            return *middle;
        }
        let lower = below.iter().copied().max_by(f64::total_cmp);
        lower.map_or(*middle, |lower| lower.midpoint(*middle))
    }

    fn median_axis(&self) -> f64 {
        let samples = &self.ring[..self.count];
        let distance = |axis: f64| samples.iter().fold(0.0, |sum, other| sum + wrap_axial(axis - other).abs());
        let newest_first = (1..=self.count).map(|k| samples[(self.next + self.count - k) % self.count]);
        let nearer = |a: (f64, f64), b: (f64, f64)| if a.1.total_cmp(&b.1) == Ordering::Greater { b } else { a };
        newest_first.map(|axis| (axis, distance(axis))).reduce(nearer).map_or(0.0, |(axis, _)| axis)
    }
}

#[cfg(test)]
mod tests;
