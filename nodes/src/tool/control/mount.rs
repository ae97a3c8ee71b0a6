//! An `adjoint` that says how the pad is mounted.

use nalgebra::{Matrix6, Vector6};
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

/// What the mounts between a column and the arm make of it.
#[derive(Debug, Clone)]
pub(crate) struct Turn {
    /// The `adjoint` that is nearest to the column.
    pub(crate) node: String,
    /// The adjoints of all poses.
    pub(crate) matrix: Matrix6<f64>,
}

impl Turn {
    /// Returns the column that has to be written so that this one reaches the arm, if no projector keeps it away.
    pub(crate) fn written(&self, column: [f64; 6]) -> Option<[f64; 6]> {
        Some(without_rest(column, (self.matrix.try_inverse()? * Vector6::from(column)).into()))
    }
}

/// Largest share of a motion, beside its largest component of the same unit, that counts as 0 [1].
pub(super) const REST: f64 = 1e-4;

/// Leaves out what a turn that is written with a few digits leaves in the other components of a twist, of what it was.
pub(super) fn without_rest(before: [f64; 6], twist: [f64; 6]) -> [f64; 6] {
    let parts = |first: usize| before[first..first + 3].iter().chain(&twist[first..first + 3]);
    let most = [0, 3].map(|first| parts(first).fold(0.0_f64, |most, part| most.max(part.abs())));
    std::array::from_fn(|i| if twist[i].abs() < REST * most[i / 3] { 0.0 } else { twist[i] })
}

/// Returns an `adjoint` whose pose does not change, and that leaves the frame what it is: the pad is mounted otherwise than
/// the columns say. Into another frame, the columns stay those of the frame in which they are written.
pub(crate) fn mount(nodes: &Nodes<'_>, node: &OutlinedBlock) -> Option<Mount> {
    let adjoint = Some(node).filter(|node| node.kind.text == "adjoint")?;
    let twist = source(adjoint, "twist")?;
    if nodes.output(twist)?.frames != adjoint.outputs.first()?.frames {
        return None;
    }
    let pose = constant(nodes, source(adjoint, "pose")?)?;
    Some(Mount { node: node.name.clone(), pose })
}

/// Returns the pose of a port, if static poses alone make it.
fn constant(nodes: &Nodes<'_>, port: &str) -> Option<Pose> {
    let node = nodes.writer(port)?;
    let of = |input: &str| constant(nodes, source(node, input)?);
    match node.kind.text.as_str() {
        "static_pose" => {
            let read = |key: &str| nodes.value(node, key).map_or(Some([0.0; 3]), |value| value.value.read());
            Some(Pose(pose_of(read("xyz")?, read("rpy")?)))
        }
        "inverse_pose" => Some(Pose(of("pose")?.0.inverse())),
        "compose_poses" => Some(Pose(of("outer")?.0 * of("inner")?.0)),
        _ => None,
    }
}
