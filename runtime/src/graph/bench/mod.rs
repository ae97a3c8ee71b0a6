//! The bench: opens devices and inserts their facts into parameters.

mod facts;
mod open;
mod robots;
mod sides;

pub(crate) use facts::fill_facts;
pub(crate) use open::{BoundRole, OpenedBench, open, place_mistakes};
pub(crate) use robots::add_robots;
