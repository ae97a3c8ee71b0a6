//! Graphs and nodes in tests, on mock sources and a virtual clock.

mod node_rig;

pub use node_rig::NodeRig;
