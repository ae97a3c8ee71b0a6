//! Letters of inputs that are not there.

use tactflow_runtime::node::{Out, Outputs};
use tactflow_runtime::signal::Scalar;

/// Outputs.
#[derive(Outputs)]
#[port(inputs = "Others")]
pub struct Outputs {
    /// The letters of what?
    #[port(unit = "V", frame = "_")]
    value: Out<Scalar>,
}

fn main() {}
