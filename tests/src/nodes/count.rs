//! `count`: how often it stepped since its state was fresh, and the time between its samples.

use tactflow_runtime::node::{Describe, In, Inputs, Interval, Mistakes, Node, Out, Outputs, Setup, State, Tick};
use tactflow_runtime::signal::Scalar;

/// Counts its steps.
#[derive(Describe)]
pub struct Count;

/// What `count` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// What it counts.
    #[port(unit = "U", frame = "_")]
    value: In<'a, Scalar>,
}

/// What `count` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Steps since the state was fresh.
    #[port(unit = "1", frame = "_")]
    steps: Out<Scalar>,
    /// Sum of the times between the samples.
    #[port(unit = "1", frame = "_")]
    time: Out<Scalar>,
}

/// What `count` remembers.
#[derive(State)]
pub struct State {
    /// Steps so far.
    steps: f64,
    /// Time so far [s].
    time: f64,
    /// Since the last sample.
    interval: Interval,
}

impl Node for Count {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.steps += 1.0;
        state.time += state.interval.step(&inputs.value, tick).unwrap_or(0.0);
        out.steps.set(state.steps);
        out.time.set(state.time);
    }
}
