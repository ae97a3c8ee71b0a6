//! `inverse_pose`: the same two frames, seen from the other one. The inverse of a rotation is its transpose, so nothing
//! is divided.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::Pose;

/// Turns the pose of A in B into the pose of B in A.
///
/// T_AB = T_BA^-1: with T_BA = (R, p) it is (R', -R' p). Use it to look from the other end, such as at the base of the
/// arm from the sensor. With `compose_poses` it closes a chain: two sensors whose poses in one base are known have a
/// pose in each other.
///
/// The output is as old as the input. It is no measured pose of a sensor: limiters refuse it, even where it is the
/// inverse of an inverse.
///
/// ```toml
/// [nodes.inverse_pose]                # the base in the frame of the pad
/// type = "inverse_pose"
/// in.pose = "state.sensor_pose"
/// ```
#[derive(Describe)]
pub struct InversePose;

/// What `inverse_pose` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Pose of A in B.
    #[port(frame = "A", reference = "B")]
    pose: In<'a, Pose>,
}

/// What `inverse_pose` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Pose of B in A.
    #[port(frame = "B", reference = "A")]
    pose: Out<Pose>,
}

impl Node for InversePose {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.pose.set(Pose(inputs.pose.0.inverse()));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, PoseShape, Stamp};

    use super::*;
    use crate::motion::pose::testing::any_pose;

    fn rig() -> NodeRig {
        NodeRig::new::<InversePose>("", &[("pose", PoseShape { start: Some([0.0; 3]) }.into())]).unwrap()
    }

    fn inverse(pose: Pose) -> Pose {
        let mut rig = rig();
        rig.set("pose", pose);
        rig.step();
        *rig.get::<Pose>("pose").unwrap()
    }

    proptest! {
        #[test]
        fn it_is_the_inverse_of_the_4_by_4_matrix(pose in any_pose()) {
            let found = inverse(pose).0;
            let by_elimination = pose.0.to_homogeneous().try_inverse().unwrap();
            prop_assert!((found.to_homogeneous() - by_elimination).amax() < 1e-13);
            prop_assert!((pose.0.to_homogeneous() * found.to_homogeneous() - Matrix4::identity()).amax() < 1e-14);
            prop_assert!((inverse(Pose(found)).0.to_homogeneous() - pose.0.to_homogeneous()).amax() < 1e-14);
        }
    }

    #[test]
    fn it_is_as_old_as_its_input_and_knows_no_start_of_a_sensor() {
        let mut rig = rig();
        assert_eq!(rig.shape("pose"), &PoseShape::default().into());
        rig.edit("pose", Stamp { nanos: 7, device: 2 }, |pose| *pose = Pose::default());
        rig.step();
        assert_eq!(rig.mark("pose").stamp(), Stamp { nanos: 7, device: 2 });
        rig.lose("pose");
        rig.step();
        assert_eq!(rig.freshness("pose"), Freshness::Lost);
    }
}
