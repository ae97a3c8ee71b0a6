//! `median`: the middle one of the newest samples of a feature.

use std::cmp::Ordering;

use tactflow_runtime::node::{Describe, Mistakes, Node, Param, Reading, Setup, State, Tick};

use super::filter::{Inputs, Outputs, Ring};
use crate::motion::axis::wrap_axial;

/// Removes single wrong samples from a feature: the median of the newest samples.
///
/// The middle one of the last `window` samples in order of size; of an even number, the mean of the two in the middle.
/// At the start it is the median of the samples so far. A glitch of fewer than half the window has no influence, while
/// it shifts a mean. Each sample counts once, however long it is held.
///
/// **Axes.** The directions of lines (`rad mod pi`) have no order of size. Their median is the sample with the smallest
/// sum of distances to all others, modulo pi; of two that are equal, the newer. It is always one of the samples, so it
/// exists even for axes that cancel each other.
///
/// A step passes half a window late, and stays a step. Against white noise a `moving_average` with the same window is
/// better: the median leaves 1.25 times its standard deviation. Against both, use a short `median` and a
/// `moving_average` after it. A `moving_average` can also have a longer window.
///
/// If the feature is absent, the output is absent. The window survives flicker and is reset when the feature is absent
/// for the graph's `reset_after_ms`.
///
/// ```toml
/// [nodes.median]
/// type = "median"
/// in.value = "moments.pressure"
/// window = 5                          # two wrong samples have no influence [samples]
/// ```
#[derive(Describe)]
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

/// What `median` remembers.
#[derive(State)]
pub struct State {
    ring: Ring<f64>,
    /// Buffer for the samples in order of size.
    sorted: Vec<f64>,
}

/// Largest window [samples]: a step compares each axis with each other.
const MAX_WINDOW: usize = 255;

impl Node for Median {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.reading = Reading::Same;
        setup.outputs.value.range = setup.inputs.value.range;
        Ok(Self { window: params.window, is_axial: setup.inputs.value.unit.is_axial() })
    }

    fn state(&self) -> State {
        State { ring: Ring::new(self.window), sorted: vec![0.0; self.window] }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.ring.push(*inputs.value);
        out.value.set(if self.is_axial {
            wrap_axial(median_axis(&state.ring))
        } else {
            median(state.ring.unordered(), &mut state.sorted)
        });
    }
}

/// Returns the median of the samples; `sorted` is a buffer for as many.
fn median(samples: &[f64], sorted: &mut [f64]) -> f64 {
    let sorted = &mut sorted[..samples.len()];
    sorted.copy_from_slice(samples);
    let (below, middle, _) = sorted.select_nth_unstable_by(samples.len() / 2, f64::total_cmp);
    if samples.len() % 2 == 1 {
        return *middle;
    }
    let lower = below.iter().copied().max_by(f64::total_cmp);
    lower.map_or(*middle, |lower| lower.midpoint(*middle))
}

/// Returns the axis with the smallest sum of distances to all others, the newest one of equals.
fn median_axis(ring: &Ring<f64>) -> f64 {
    let distance = |axis: f64| ring.unordered().iter().fold(0.0, |sum, other| sum + wrap_axial(axis - other).abs());
    let nearer = |a: (f64, f64), b: (f64, f64)| if a.1.total_cmp(&b.1) == Ordering::Greater { b } else { a };
    ring.newest_first().map(|axis| (axis, distance(axis))).reduce(nearer).map_or(0.0, |(axis, _)| axis)
}

#[cfg(test)]
mod tests;
