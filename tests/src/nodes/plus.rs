//! `plus`: adds a constant: the smallest node there is, to measure what a node costs.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// What is added [m].
    live by: f64 = 1.0,
}

inputs! {
    /// A length.
    value: Scalar["m"],
}

outputs! {
    /// The sum.
    value: Scalar["m"],
}

/// What is added.
pub struct Plus {
    by: f64,
}

impl tactflow_runtime::node::Describe for Plus {
    const NAME: &'static str = "plus";
    const SUMMARY: &'static str = "adds a constant";
    const DOC: &'static str = "y = x + `by`. It is there to measure what a node costs.";
    const EXAMPLE: &'static str = r#"
[nodes.plus]
type = "plus"
in.value = "length.value"
by = 0.5                            # [m]
"#;
}

impl Node for Plus {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { by: params.by })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.value.set(*inputs.value + self.by);
    }
}
