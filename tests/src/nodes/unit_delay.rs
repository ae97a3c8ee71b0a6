//! `unit_delay`: what its input was one tick ago, in metres.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// What it gives before there was anything [m].
    initial: f64 = 0.0,
}

inputs! {
    /// What is delayed.
    value: Delayed<Scalar["m"]>,
}

outputs! {
    /// What it was a tick ago.
    value: Scalar["m"],
}

/// The value before there was any.
pub struct UnitDelay {
    initial: f64,
}

impl tactflow_runtime::node::Describe for UnitDelay {
    const NAME: &'static str = "unit_delay";
    const SUMMARY: &'static str = "what its input was one tick ago";
    const DOC: &'static str = "It closes a loop: what reads it may be what it reads.";
    const EXAMPLE: &'static str = r#"
# What was added a tick ago.
[nodes.unit_delay]
type = "unit_delay"
in.value = "plus.value"
"#;
    const EVERY_TICK: bool = true;
}

impl Node for UnitDelay {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { initial: params.initial })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.value.set(inputs.value.map_or(self.initial, |value| *value));
    }
}
