//! `unit_delay`: what its input was one tick ago, in metres.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::Scalar;

/// What its input was one tick ago.
///
/// It closes a loop: what reads it may be what it reads.
///
/// ```toml
/// # What was added a tick ago.
/// [nodes.unit_delay]
/// type = "unit_delay"
/// in.value = "plus.value"
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct UnitDelay {
    initial: f64,
}

/// Parameters of `unit_delay`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// What it gives before there was anything.
    #[param(unit = "m", default = 0.0)]
    initial: f64,
}

/// What `unit_delay` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// What is delayed.
    #[port(unit = "m", frame = "_", optional, delayed)]
    value: Option<In<'a, Scalar>>,
}

/// What `unit_delay` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// What it was a tick ago.
    #[port(unit = "m", frame = "_")]
    value: Out<Scalar>,
}

impl Node for UnitDelay {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { initial: params.initial })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.value.set(inputs.value.map_or(self.initial, |value| *value));
    }
}
