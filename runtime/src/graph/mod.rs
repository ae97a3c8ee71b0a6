//! Graphs: from text to a plan, or to all diagnostics. The only side effect is reading files.
//!
//! The modules in order; each imports only earlier ones: `syntax` (text to sections), `load` (files, parts and `--set`
//! to one flat graph), `plan` (what the engine needs), `net` (declarations, wires, step order), `bench` (opens
//! devices), `check` (one check per file), `build` (nodes and modes), `outline` (the graph with the origin of each
//! value) and `compile`, which calls them in order.

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

pub use crate::outline::{
    NO_SPAN, Outline, OutlinedBlock, OutlinedMode, OutlinedPort, OutlinedRange, OutlinedRole, OutlinedTask,
    OutlinedWire, OutlinedWord, Setting, ValueOrigin,
};
pub use bench::{BenchDevice, CommissionedDevice, OpenBench, open_bench};
pub use compile::compile;
pub(crate) use compile::compile_in;
pub use compiled::Compiled;
pub(crate) use load::{Loader, wrong_file_type};
pub use load::{RecordedGraph, Request};
#[cfg(all(feature = "cli", unix))]
pub(crate) use plan::matches;
pub use plan::{AllowedWarning, LiveParam, PlannedPort, RecordedPorts};
pub(crate) use plan::{
    Clock, Condition, LivePlan, Plan, PlannedCommand, PlannedDevice, PlannedExit, PlannedModes, PlannedNode,
    PlannedRole, PlannedShow, PlannedTask, PlannedView, PlannedWire, PortRef, Producer, Reach, Test,
};
pub(crate) use syntax::{AgeLimit, ExitKind, PolicyTable, PortState, WORDS, into_diagnostic};
pub use syntax::{DEFAULT_MAX_AGE_PERIODS, Policy};
