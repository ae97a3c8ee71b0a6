//! `#[derive(Inputs)]` and `#[derive(Outputs)]`: a type that is no signal.

use tactflow_runtime::node::{In, Inputs, Out, Outputs};

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Not a signal.
    count: In<'a, u32>,
    /// Not a signal either.
    names: Option<In<'a, Vec<String>>>,
}

/// Outputs.
#[derive(Outputs)]
pub struct Outputs {
    /// Not a signal.
    name: Out<String>,
}

fn main() {}
