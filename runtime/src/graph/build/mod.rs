//! Builds the nodes, and their configurations in each mode.

mod conditions;
mod demand;
mod live;
mod modes;
mod nodes;
mod params;
mod sample_times;
mod tasks;

pub(crate) use live::plan_live;
pub(crate) use modes::{BuiltModes, build_modes};
pub(crate) use nodes::Builder;
pub(crate) use tasks::{find_reach, max_gaps, plan_tasks};
