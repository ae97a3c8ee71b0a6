//! The checks of a graph, one per file. Each has a function `check` that adds to the diagnostics.

pub(crate) mod absent;
pub(crate) mod calibration;
pub(crate) mod clock;
pub(crate) mod commands;
mod contact;
pub(crate) mod delays;
mod endings;
pub(crate) mod exports;
pub(crate) mod facts;
mod foreign;
mod frame_names;
pub(crate) mod frames;
pub(crate) mod inputs;
pub(crate) mod limit_values;
pub(crate) mod limits;
pub(crate) mod live;
pub(crate) mod motion;
pub(crate) mod overlap;
pub(crate) mod parts;
pub(crate) mod policy;
pub(crate) mod quantities;
pub(crate) mod reachability;
pub(crate) mod units;
pub(crate) mod unused;
pub(crate) mod view;
