//! Builds what the plan needs: nodes, and the configurations of each mode.

mod conditions;
mod demand;
mod modes;
mod nodes;

pub(crate) use modes::plan as modes;
pub(crate) use nodes::Builder;
