//! `pair`: one input of each sort; says what it saw.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

params! {}

inputs! {
    /// Required, and a trigger.
    required: Scalar["_"],
    /// Required, but only its loss wakes.
    sampled: Sampled<Scalar["_"]>,
    /// Optional, and a trigger.
    trigger: Trigger<Scalar["_"]>,
    /// Optional; only its loss wakes.
    optional: Option<Scalar["_"]>,
}

outputs! {
    /// Steps so far.
    steps: Scalar["1"],
    /// The sum of what is there.
    sum: Scalar["m"],
    /// How many of the optional ones are there.
    there: Scalar["1"],
}

state! {
    /// Steps so far.
    steps: f64,
}

/// Nothing to configure.
pub struct Pair;

impl Node for Pair {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const NAME: &'static str = "pair";
    const SUMMARY: &'static str = "adds what is there";

    fn new(_: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn state(&self) -> State {
        State { steps: 0.0 }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.steps += 1.0;
        let there = [inputs.trigger, inputs.optional];
        let sum: f64 = there.iter().flatten().map(|input| **input).sum();
        out.steps.set(state.steps);
        out.sum.set(*inputs.required + *inputs.sampled + sum);
        out.there.set(there.iter().flatten().count() as f64);
    }
}
