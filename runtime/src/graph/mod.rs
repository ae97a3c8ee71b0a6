//! A graph: text in, plan or all mistakes out. Pure, but for the files it reads.
//!
//! In the order of the work: `document` (what the sections hold), `load` (files, parts and `--set` become one flat
//! graph), `wires` (where each comes from), `devices` (the bench is opened), `order`, `frames`, `units`, and `check`,
//! which builds the nodes on the way to a `plan`. `unread` looks for loose ends, `shown` for what a run shows, and `outline` says where all came from.

mod build;
mod check;
mod devices;
mod document;
mod frames;
mod limits;
mod load;
mod modes;
mod order;
mod outline;
mod plan;
mod policy;
mod shown;
mod sources;
mod units;
mod unread;
mod value;
mod wanted;
mod wires;

pub use check::plan;
pub(crate) use check::plan_in;
pub(crate) use document::spanned;
#[cfg(feature = "cli")]
pub(crate) use frames::frame_args;
pub use load::Request;
pub(crate) use load::{Loader, other_file};
pub(crate) use modes::{Condition, PlannedExit, PlannedModes, Sort, Test};
pub use outline::{NOWHERE, Origin, Outline, OutlinedBlock, OutlinedMode, OutlinedRole, OutlinedWire, Setting};
pub(crate) use plan::{
    Clock, PlannedCommand, PlannedDevice, PlannedNode, PlannedReport, PlannedRole, PlannedWire, Producer, Source,
};
pub use plan::{Plan, PlannedPort};
pub use policy::Policy;
pub(crate) use policy::{Age, PolicyTable};
pub(crate) use shown::{PlannedShow, PlannedView};
pub use sources::{BuiltinFile, SourceFile, Sources};
pub(crate) use units::declares_a_unit;
#[cfg(feature = "cli")]
pub(crate) use units::may_fit;
pub use value::{Item, Key, Table, Value, parse_table};
