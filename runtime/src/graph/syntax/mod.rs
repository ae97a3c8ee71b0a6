//! The sections of a graph file, a part and a bench, before names are resolved.

mod allow;
mod binding;
mod correct;
mod limits;
mod live;
mod model;
mod modes;
mod names;
mod policy;
mod read;
mod record;
mod reserved;
mod roles;
mod sections;
mod wires;

pub(crate) use allow::Allowance;
pub(crate) use binding::Binding;
pub(crate) use limits::{LimitOwner, LimitSection};
pub(crate) use live::LiveEntry;
pub(crate) use modes::{ExitKind, ExitTable, ModeBlock, ModeExit, PortState};
pub(crate) use names::Use;
pub(crate) use policy::{AgeLimit, OnFail, PolicyTable, default_max_age_ns, default_max_age_s};
pub use policy::{DEFAULT_MAX_AGE_PERIODS, Policy};
pub(crate) use record::RecordTable;
pub(crate) use reserved::{
    ALLOW_UNCALIBRATED, INPUTS, LIMITS, LIVE, MODES, NO_ARM, ROBOT, SENSOR, TASK_SECTIONS, WORDS,
};
pub(crate) use sections::{BenchDocument, Block, GraphDocument, GraphTable, PartBlock, Sections, into_diagnostic};
pub(crate) use wires::{CommandEntry, WireEntry};
