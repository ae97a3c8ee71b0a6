//! What can be wrong with a net: one check per file.

pub(crate) mod frames;
pub(crate) mod limits;
pub(crate) mod motion;
pub(crate) mod overlap;
pub(crate) mod policy;
pub(crate) mod reachability;
pub(crate) mod shown;
pub(crate) mod units;
pub(crate) mod unused;
