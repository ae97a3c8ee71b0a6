//! `count`: how often it stepped since its state was fresh, and the time between its samples.

use tactflow_runtime::node::{Interval, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

params! {}

inputs! {
    /// What it counts.
    value: Scalar["U"],
}

outputs! {
    /// Steps since the state was fresh.
    steps: Scalar["1"],
    /// Sum of the times between the samples [s].
    time: Scalar["1"],
}

state! {
    /// Steps so far.
    steps: f64,
    /// Time so far [s].
    time: f64,
    /// Since the last sample.
    interval: Interval,
}

/// Nothing to configure.
pub struct Count;

impl tactflow_runtime::node::Describe for Count {
    const NAME: &'static str = "count";
    const SUMMARY: &'static str = "counts its steps";
}

impl Node for Count {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(_: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn state(&self) -> State {
        State { steps: 0.0, time: 0.0, interval: Interval::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.steps += 1.0;
        state.time += state.interval.step(&inputs.value, tick).unwrap_or(0.0);
        out.steps.set(state.steps);
        out.time.set(state.time);
    }
}
