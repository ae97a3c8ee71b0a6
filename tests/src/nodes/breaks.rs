//! `breaks`: passes a value on until it breaks, in one of the ways a node can.

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
}

/// Parameters of `breaks`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// How: `nan`, `panic` or `hang`.
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
            other => return Err(Mistake::param("how", format!("`{other}` is no way to break")).into()),
        };
        Ok(Self { tick: params.tick, how })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let value = if tick.index == self.tick { self.break_down() } else { *inputs.value };
        out.value.set(value);
    }
}

impl Breaks {
    fn break_down(&self) -> f64 {
        match self.how {
            How::Nan => f64::NAN,
            How::Panic => panic!("as told"),
            How::Hang => loop {
                std::thread::park();
            },
        }
    }
}
