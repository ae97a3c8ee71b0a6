//! `breaks`: passes a value on until it breaks, in one of the ways a node can.

use tactflow_runtime::node::{Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// How: `nan` or `panic`.
    how: String,
    /// In which tick.
    tick: u64,
}

inputs! {
    /// What it passes on.
    value: Scalar["U"],
}

outputs! {
    /// What it passed on.
    value: Scalar["U"],
}

/// When and how it breaks.
pub struct Breaks {
    tick: u64,
    panics: bool,
}

impl tactflow_runtime::node::Describe for Breaks {
    const NAME: &'static str = "breaks";
    const SUMMARY: &'static str = "breaks in some tick";
}

impl Node for Breaks {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        match params.how.as_str() {
            "nan" => Ok(Self { tick: params.tick, panics: false }),
            "panic" => Ok(Self { tick: params.tick, panics: true }),
            other => Err(Mistake::param("how", format!("`{other}` is neither `nan` nor `panic`")).into()),
        }
    }

    fn state(&self) {}

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_due = tick.index == self.tick;
        assert!(!(is_due && self.panics), "as told");
        out.value.set(if is_due { f64::NAN } else { *inputs.value });
    }
}
