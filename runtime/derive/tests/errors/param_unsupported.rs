//! `#[derive(Param)]`: types that a graph file cannot set, and a default of another type.

use std::time::Duration;

use tactflow_runtime::node::Param;

/// Parameters.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// A type that is no parameter.
    time: Duration,
    /// A default of another type.
    #[param(unit = "s", default = "fast")]
    speed: f64,
}

fn main() {}
