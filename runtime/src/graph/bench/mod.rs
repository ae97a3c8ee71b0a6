//! The bench: opens devices and inserts their facts into parameters.

mod all;
mod commissioning;
mod facts;
mod models;
mod open;
mod place;
mod reconnect;
mod recorded;
mod sides;

pub use all::{BenchDevice, OpenBench, open_bench};
pub use commissioning::CommissionedDevice;
pub(crate) use commissioning::to_commission;
pub(crate) use facts::fill_facts;
pub(crate) use models::add_models;
pub(crate) use open::{BoundRole, OpenedBench, open};
pub(crate) use place::place_mistakes;
