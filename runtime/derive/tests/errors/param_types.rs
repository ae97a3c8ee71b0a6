//! `#[derive(Param)]`: what the type, the list of units or the inputs decide.

use tactflow_runtime::node::{In, Inputs, Param};
use tactflow_runtime::signal::Scalar;

/// Inputs.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// A value.
    #[port(unit = "U", frame = "A")]
    pub value: In<'a, Scalar>,
}

/// Parameters.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// A unit that there is not.
    #[param(unit = "seconds")]
    unknown_unit: f64,
    /// A letter that no input binds.
    #[param(unit = "V/s")]
    unbound: f64,
    /// A range of something that is no number.
    #[param(range = 0..=1)]
    name: String,
    /// A range without numbers.
    #[param(unit = "s", range = 1.0..=0.0)]
    empty: f64,
}

fn main() {}
