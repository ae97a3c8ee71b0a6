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

enum How {
    Nan,
    Panic,
    Hang,
    Slow,
}

/// Parameters of `breaks`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// How: `nan`, `panic`, `hang`, or `slow`: 20 ms in each multiple of the tick.
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
        let how = match params.how.as_str() {
            "nan" => How::Nan,
            "panic" => How::Panic,
            "hang" => How::Hang,
            "slow" => How::Slow,
            other => return Err(Mistake::param("how", format!("`{other}` is no way to break")).into()),
        };
        Ok(Self { tick: params.tick, how })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_due = match self.how {
            How::Slow => tick.index.is_multiple_of(self.tick),
            _ => tick.index == self.tick,
        };
        out.value.set(if is_due { self.break_down(*inputs.value) } else { *inputs.value });
    }
}

impl Breaks {
    fn break_down(&self, value: f64) -> f64 {
        match self.how {
            How::Nan => f64::NAN,
            How::Panic => panic!("as told"),
            How::Hang => loop {
                std::thread::park();
            },
            How::Slow => {
                std::thread::sleep(Duration::from_millis(20));
                value
            }
        }
    }
}
