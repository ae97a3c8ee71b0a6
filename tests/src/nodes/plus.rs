//! `plus`: adds a constant: the smallest node there is, to measure what a node costs.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::Scalar;

/// Adds a constant.
///
/// y = x + `by`. It is there to measure what a node costs.
///
/// ```toml
/// [nodes.plus]
/// type = "plus"
/// in.value = "length.value"
/// by = 0.5                            # [m]
/// ```
#[derive(Describe)]
pub struct Plus {
    by: f64,
}

/// Parameters of `plus`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// What is added.
    #[param(unit = "m", default = 1.0, live)]
    by: f64,
}

/// What `plus` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// A length.
    #[port(unit = "m", frame = "_")]
    value: In<'a, Scalar>,
}

/// What `plus` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The sum.
    #[port(unit = "m", frame = "_")]
    value: Out<Scalar>,
}

impl Node for Plus {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { by: params.by })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.value.set(*inputs.value + self.by);
    }
}
