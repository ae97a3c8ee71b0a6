//! A graph: text in, plan or all mistakes out. Pure, but for the files it reads.
//!
//! From the ground up, each importing only what stands before it: `port` (names for ports), `syntax` (text to
//! sections), `flat` and `load` (files, parts and `--set` become one flat graph), `net` (declarations, wires, order),
//! `bench` and `facts` (devices are opened), `plan` (what the engine needs), `check` (one check per file), `build`
//! (nodes, modes), `outline` (a graph as it runs) and `compile`, which calls them in order.

mod bench;
mod build;
mod check;
mod compile;
mod compiled;
mod load;
mod net;
mod outline;
mod plan;
mod syntax;

pub use compile::compile;
pub(crate) use compile::compile_in;
pub use compiled::Compiled;
pub use load::Request;
pub(crate) use load::{Loader, other_file};
pub use outline::{
    NOWHERE, Origin, Outline, OutlinedBlock, OutlinedMode, OutlinedPort, OutlinedRole, OutlinedWire, OutlinedWord,
    Setting,
};
pub use plan::PlannedPort;
pub(crate) use plan::{
    Clock, Condition, PlannedCommand, PlannedDevice, PlannedExit, PlannedModes, PlannedNode, PlannedReport,
    PlannedRole, PlannedShow, PlannedView, PlannedWire, PortRef, Producer, Test,
};
pub use syntax::Policy;
pub(crate) use syntax::{Age, PolicyTable, Sort, spanned};
