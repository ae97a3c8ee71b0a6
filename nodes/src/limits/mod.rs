//! Limiters: every motion passes through them on its way to an arm.
//!
//! Each limiter holds one kind of limit and reports the fraction of the motion that passes. The check of a graph proves
//! that none is missing.

pub mod acceleration_limit;
pub mod blind_limit;
pub mod bumpless;
pub mod contact_limit;
pub mod joint_limit;
pub mod lost_contact;
pub mod second_contact_limit;
pub mod twist_limit;
pub mod workspace_limit;
pub mod wrench_limit;

#[cfg(test)]
mod tests;

use tactflow_runtime::node::{In, Inputs};
use tactflow_runtime::signal::{ScalarShape, Twist, Unit};

/// What a limiter reads that also acts without a motion.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The wanted motion; zero while it is absent.
    #[port(frame = "A")]
    twist: Option<In<'a, Twist>>,
}

/// Maximum age of an input in sample periods, if the parameter `max_age_ms` is not given.
const DEFAULT_MAX_AGE_PERIODS: f64 = 5.0;

/// Returns the maximum age of an input [ns], from the parameter `max_age_ms` and the sample period of the input [s].
fn max_age(max_age_ms: Option<f64>, period: f64) -> i64 {
    let seconds = max_age_ms.map_or(DEFAULT_MAX_AGE_PERIODS * period, |age| age * 1e-3);
    (seconds * 1e9) as i64
}

/// Returns the shape of the fraction of a motion that a limiter lets pass.
fn fraction() -> ScalarShape {
    ScalarShape::of(Unit::ONE).within(0.0, 1.0)
}
