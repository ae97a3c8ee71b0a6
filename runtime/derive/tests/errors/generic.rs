//! A port whose kind a type parameter decides: what it misses shows for each type that is used.

use tactflow_runtime::node::{In, InputSet, Inputs, Out, OutputSet, Outputs};
use tactflow_runtime::signal::{Scalar, Signal, Twist};

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a, T: Signal> {
    /// A scalar needs a unit.
    #[port(frame = "A")]
    value: In<'a, T>,
}

/// Outputs.
#[derive(Outputs)]
pub struct Outputs<T: Signal> {
    /// A twist needs a frame.
    value: Out<T>,
}

fn main() {
    Inputs::<Scalar>::specs();
    Outputs::<Twist>::specs();
}
