//! The bench: devices are opened, and their facts are put where parameters ask for them.

mod facts;
mod open;

pub(crate) use facts::fill_facts;
pub(crate) use open::{BoundRole, Opened, open, place};
