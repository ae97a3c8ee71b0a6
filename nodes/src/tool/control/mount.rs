//! An `adjoint` that says how the pad is mounted.

use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::signal::Pose;

use super::nodes::{Nodes, source};
use crate::motion::pose::pose_of;

/// An `adjoint` of a pose that does not change.
pub(crate) struct Mount {
    /// Its name.
    pub(crate) node: String,
    pub(crate) pose: Pose,
}

/// Returns an `adjoint` whose pose does not change, and that leaves the frame what it is: the pad is mounted otherwise than
/// the columns say. Into another frame, the columns stay those of the frame in which they are written.
pub(crate) fn mount(nodes: &Nodes<'_>, node: &OutlinedBlock) -> Option<Mount> {
    let adjoint = Some(node).filter(|node| node.kind.text == "adjoint")?;
    let twist = source(adjoint, "twist")?;
    let before = nodes.writer(twist)?.outputs.iter().find(|port| port.name == twist)?;
    if before.frames != adjoint.outputs.first()?.frames {
        return None;
    }
    let pose = nodes.writer(source(adjoint, "pose")?).filter(|node| node.kind.text == "static_pose")?;
    let read = |key: &str| nodes.value(pose, key).map_or(Some([0.0; 3]), |value| value.value.read());
    Some(Mount { node: node.name.clone(), pose: Pose(pose_of(read("xyz")?, read("rpy")?)) })
}
