//! The bench: opens devices and inserts their facts into parameters.

mod facts;
mod models;
mod open;
mod sides;

pub(crate) use facts::fill_facts;
pub(crate) use models::add_models;
pub(crate) use open::{BoundRole, OpenedBench, open, place_mistakes};
