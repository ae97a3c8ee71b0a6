//! How a plan runs.

mod station;

pub(crate) use station::{Station, Watch};
