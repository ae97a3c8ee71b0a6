//! `#[derive(Inputs)]`: a type that is no signal.

use tactflow_runtime::node::{In, Inputs};

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Not a signal.
    #[port(unit = "N", frame = "A")]
    value: In<'a, f32>,
}

fn main() {}
