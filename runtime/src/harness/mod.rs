//! Runs graphs, nodes and devices in tests, with fed roles and a virtual clock.

mod fed;
mod graph_rig;
mod link_rig;
mod lint;
mod node_rig;
mod params;

pub use fed::FedRole;
pub use graph_rig::GraphRig;
pub use link_rig::LinkRig;
pub use lint::{CountAllocations, Lint, Violation, lint};
pub use node_rig::{NodeRig, places};
