//! One mistake is one message: what follows from it is not reported again.

use tactflow_runtime::node::{Describe, In, Inputs, Out, Outputs, Param};
use tactflow_runtime::signal::Scalar;

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// A missing comma, so that nobody knows what it binds.
    #[port(unit = "U" frame = "A")]
    value: In<'a, Scalar>,
}

/// Outputs.
#[derive(Outputs)]
pub struct Outputs {
    /// Letters that the input binds once it can be read.
    #[port(unit = "U", frame = "A")]
    value: Out<Scalar>,
}

/// A node with a bad name.
///
/// ```toml
/// [nodes.knob]
/// type = "knob"
/// ```
#[derive(Describe)]
#[describe(name = "my knob")]
pub struct Knob;

/// Words.
#[derive(Debug, Clone, Copy, Param)]
pub enum Side {
    /// Left.
    Left,
    /// Left again.
    #[allow(non_camel_case_types)]
    left,
}

/// Parameters.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// A number in quotes.
    #[param(unit = "1", default = "0.1")]
    gain: f64,
    /// A word in quotes.
    #[param(default = "left")]
    side: Side,
}

fn main() {}
