//! `breaks`: passes a value on until it breaks, in one of the ways a node can.

use std::time::Duration;

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::Scalar;

/// Breaks in some tick.
#[derive(Describe)]
pub struct Breaks {
    tick: u64,
    how: How,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum How {
    Nan,
    Panic,
    Slow,
}

/// Parameters of `breaks`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// How: `nan`, `panic`, or `slow`: 20 ms in each multiple of the tick.
    how: String,
    /// In which tick.
    tick: u64,
}

/// What `breaks` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// What it passes on.
    #[port(unit = "U", frame = "_")]
    value: In<'a, Scalar>,
}

/// What `breaks` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// What it passed on.
    #[port(unit = "U", frame = "_")]
    value: Out<Scalar>,
}

impl Node for Breaks {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        match params.how.as_str() {
            "nan" => Ok(Self { tick: params.tick, how: How::Nan }),
            "panic" => Ok(Self { tick: params.tick, how: How::Panic }),
            "slow" => Ok(Self { tick: params.tick, how: How::Slow }),
            other => Err(Mistake::param("how", format!("`{other}` is neither `nan` nor `panic` nor `slow`")).into()),
        }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_due = tick.index == self.tick;
        assert!(!(is_due && self.how == How::Panic), "as told");
        if self.how == How::Slow && tick.index.is_multiple_of(self.tick) {
            std::thread::sleep(Duration::from_millis(20));
        }
        out.value.set(if is_due && self.how == How::Nan { f64::NAN } else { *inputs.value });
    }
}
