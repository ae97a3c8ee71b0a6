//! `pair`: one input of each form; its outputs count what it saw.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Setup, State, Tick};
use tactflow_runtime::signal::Scalar;

/// Adds what is present.
#[derive(Describe)]
pub struct Pair;

/// What `pair` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Required, and a trigger.
    #[port(unit = "_", frame = "_")]
    required: In<'a, Scalar>,
    /// Required, but only its loss wakes the node.
    #[port(unit = "_", frame = "_", sampled)]
    sampled: In<'a, Scalar>,
    /// Optional, and a trigger.
    #[port(unit = "_", frame = "_", optional)]
    trigger: Option<In<'a, Scalar>>,
    /// Optional; only its loss wakes the node.
    #[port(unit = "_", frame = "_", optional, sampled)]
    optional: Option<In<'a, Scalar>>,
}

/// What `pair` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Steps so far.
    #[port(unit = "1", frame = "_")]
    steps: Out<Scalar>,
    /// Sum of the inputs that are present.
    #[port(unit = "m", frame = "_")]
    sum: Out<Scalar>,
    /// Number of optional inputs that are present.
    #[port(unit = "1", frame = "_")]
    there: Out<Scalar>,
}

/// What `pair` remembers.
#[derive(State)]
pub struct State {
    /// Steps so far.
    steps: f64,
}

impl Node for Pair {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
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
