//! Two nodes in one file: each set of outputs and parameters names the inputs whose letters it uses.

use tactflow_runtime::node::{In, InputSet, Inputs, Out, OutputSet, Outputs, Param};
use tactflow_runtime::signal::{Scalar, Signal};

/// Inputs of the first.
#[derive(Inputs)]
pub struct First<'a, T: Signal> {
    /// A value.
    #[port(unit = "U", frame = "A")]
    value: In<'a, T>,
}

/// Inputs of the second.
#[derive(Inputs)]
pub struct Second<'a> {
    /// Another value.
    #[port(unit = "V", frame = "B")]
    value: In<'a, Scalar>,
}

/// Outputs of the first.
#[derive(Outputs)]
#[port(inputs = "First")]
pub struct Rate {
    /// Its rate.
    #[port(unit = "U/s", frame = "A")]
    rate: Out<Scalar>,
}

/// Outputs of the second.
#[derive(Outputs)]
#[port(inputs = "Second")]
pub struct Sum {
    /// Its sum.
    #[port(unit = "V", frame = "B")]
    sum: Out<Scalar>,
}

/// Parameters of the second.
#[derive(Debug, Clone, Param)]
#[param(inputs = "Second")]
pub struct Offset {
    /// What is added.
    #[param(unit = "V")]
    offset: f64,
}

fn main() {
    assert_eq!(First::<Scalar>::specs().len() + Second::specs().len(), 2);
    assert_eq!(Rate::specs().len() + Sum::specs().len(), 2);
    assert_eq!(Offset::fields().len(), 1);
}
