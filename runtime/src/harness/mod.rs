//! Graphs and nodes in tests, on mock sources and a virtual clock.

mod graph_rig;
mod node_rig;

pub use graph_rig::{GraphRig, Source};
pub use node_rig::NodeRig;
