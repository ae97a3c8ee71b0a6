//! The sections of a graph file, a part and a bench, before names are resolved.

mod allow;
mod modes;
mod policy;
mod read;
mod sections;

pub(crate) use allow::Allowance;
pub(crate) use modes::{ExitKind, ExitTable, ModeBlock, ModeExit, PortState};
pub use policy::Policy;
pub(crate) use policy::{AgeLimit, PolicyTable, default_max_age_ns, default_max_age_s};
pub(crate) use sections::{
    ALLOW_UNCALIBRATED, BenchDocument, Block, GraphDocument, GraphTable, LIMITS, PartBlock, Sections, WireEntry,
    into_diagnostic,
};
