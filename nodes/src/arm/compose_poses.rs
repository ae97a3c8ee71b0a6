//! `compose_poses`: a pose over a frame between two others. One product of two rotations is as exact as they are, and
//! nothing is kept, so no error adds up.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::Pose;

/// Joins the pose of A in B and the pose of B in C to the pose of A in C.
///
/// T_CA = T_CB T_BA, the chain of section IV of the paper. `inner` is the pose of A in B and `outer` the pose of B in C:
/// the frame B, in which the one is given, is the frame of the other. The check reports any other order.
///
/// Both inputs must be present. The output is as old as the older of them; a `static_pose` has no age. It is no
/// measured pose of a sensor: limiters refuse it.
///
/// ```toml
/// [nodes.compose_poses]               # the pad in the room
/// type = "compose_poses"
/// in.inner = "state.sensor_pose"      # the pad in the base
/// in.outer = "static_pose.pose"       # the base in the room
/// ```
#[derive(Describe)]
pub struct ComposePoses;

/// What `compose_poses` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Pose of A in B.
    #[port(frame = "A", reference = "B")]
    inner: In<'a, Pose>,
    /// Pose of B in C.
    #[port(frame = "B", reference = "C")]
    outer: In<'a, Pose>,
}

/// What `compose_poses` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Pose of A in C.
    #[port(frame = "A", reference = "C")]
    pose: Out<Pose>,
}

impl Node for ComposePoses {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.pose.set(Pose(inputs.outer.0 * inputs.inner.0));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix4, Point3, UnitQuaternion};
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, PoseShape, Stamp};

    use super::*;
    use crate::arm::inverse_pose::InversePose;
    use crate::motion::pose::testing::any_pose;

    fn rig() -> NodeRig {
        let wires = ["inner", "outer"].map(|name| (name, PoseShape::default().into()));
        NodeRig::new::<ComposePoses>("", &wires).unwrap()
    }

    fn compose(inner: Pose, outer: Pose) -> Pose {
        let mut rig = rig();
        rig.set("inner", inner);
        rig.set("outer", outer);
        rig.step();
        *rig.get::<Pose>("pose").unwrap()
    }

    fn inverse(pose: Pose) -> Pose {
        let mut rig = NodeRig::new::<InversePose>("", &[("pose", PoseShape::default().into())]).unwrap();
        rig.set("pose", pose);
        rig.step();
        *rig.get::<Pose>("pose").unwrap()
    }

    /// The same pose with a unit quaternion in place of the rotation matrix.
    fn with_quaternion(pose: &Pose) -> Isometry3<f64> {
        Isometry3::from_parts(pose.0.translation, UnitQuaternion::from_rotation_matrix(&pose.0.rotation))
    }

    proptest! {
        #[test]
        fn it_is_the_product_with_quaternions(inner in any_pose(), outer in any_pose()) {
            let found = compose(inner, outer).0.to_homogeneous();
            let expected = with_quaternion(&outer) * with_quaternion(&inner);
            prop_assert!((found - expected.to_homogeneous()).amax() < 1e-13);
        }

        #[test]
        fn a_pose_and_its_inverse_are_the_frame_itself(pose in any_pose()) {
            for (inner, outer) in [(pose, inverse(pose)), (inverse(pose), pose)] {
                prop_assert!((compose(inner, outer).0.to_homogeneous() - Matrix4::identity()).amax() < 1e-14);
            }
        }

        #[test]
        fn a_point_goes_through_both_frames(inner in any_pose(), outer in any_pose(), x in -1.0..1.0, y in -1.0..1.0) {
            let point = Point3::new(x, y, 0.3);
            let found = compose(inner, outer).0 * point;
            prop_assert!((found - outer.0 * (inner.0 * point)).amax() < 1e-14);
        }
    }

    #[test]
    fn it_follows_both_inputs_and_is_as_old_as_the_older() {
        let at = |x: f64| Pose(nalgebra::IsometryMatrix3::translation(x, 0.0, 0.0));
        let mut rig = rig();
        rig.edit("outer", Stamp::TIMELESS, |pose| *pose = at(1.0));
        rig.step();
        assert_eq!(rig.get::<Pose>("pose"), None, "the inner pose is missing");
        rig.edit("inner", Stamp { nanos: 5, device: 1 }, |pose| *pose = at(0.25));
        rig.step();
        assert_eq!((rig.get::<Pose>("pose"), rig.mark("pose").stamp().nanos), (Some(&at(1.25)), 5));
        rig.step();
        assert_eq!(rig.freshness("pose"), Freshness::Held);
        rig.lose("outer");
        rig.step();
        assert_eq!(rig.freshness("pose"), Freshness::Lost);
    }
}
