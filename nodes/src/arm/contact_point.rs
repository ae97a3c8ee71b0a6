//! `contact_point`: where the contact is in the base: the robot as a ruler (paper section IV).
//!
//! p_B = T_gs (x, y, height) with T_gs the pose of the sensor in the base. The pad's surface is the plane z = 0 of the
//! sensor. A point comes with each new contact, at the pose of that moment; a pose that moves on under a contact that is
//! held makes no point.

use nalgebra::{IsometryMatrix3, Translation3};
use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::Pose;
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// Height of the contact over the pad's plane, along the sensor's z; below 0 where the foam gives way [m].
    height: f64 = 0.0,
    /// Name of the frame that has its origin in the contact and the axes of the sensor.
    frame: String = "contact".into(),
}

inputs! {
    /// Centre of the contact along the sensor's x from the pad's middle [m].
    x: Scalar["m", "A"],
    /// Centre of the contact along the sensor's y from the pad's middle [m].
    y: Scalar["m", "A"],
    /// Pose of the sensor in the base [m].
    pose: Sampled<Pose["A", "B"]>,
}

outputs! {
    /// The contact's x in the base [m].
    x: Scalar["m", "B"],
    /// The contact's y in the base [m].
    y: Scalar["m", "B"],
    /// The contact's z in the base [m].
    z: Scalar["m", "B"],
    /// The contact's place with the sensor's orientation, in the base [m].
    pose: Pose["$frame", "B"],
}

/// How high the contact is.
pub struct ContactPoint {
    height: f64,
}

impl tactflow_runtime::node::Describe for ContactPoint {
    const NAME: &'static str = "contact_point";
    const SUMMARY: &'static str = "measures where the contact is in the base: the robot as a ruler";
    const DOC: &'static str = "The point (x, y, `height`) of the sensor in the base, p = T_gs (x, y, height), with \
        the pose T_gs from `arm_state`: the paper's section IV uses it to measure objects by touch. `x`, `y` and \
        `z` are for recording and plots; `pose` is the same point with the sensor's axes, for nodes that take a \
        pose.\n\n\
        A point comes with each new contact and is as old as it; without a contact there is none. An arm that \
        moves between two images makes no point of its own.\n\n\
        The point is as good as the arm's kinematics, the mount and the time between image and pose: at 0.05 m/s a \
        pose that is 4 ms too new is 0.2 mm off. Foam that is pressed in lies below the pad's plane: give \
        `height`.";
    const EXAMPLE: &'static str = r#"
[nodes.contact_point]
type = "contact_point"
in.x = "moments.x"
in.y = "moments.y"
in.pose = "state.sensor_pose"
height = -0.001                     # the foam gives way by about that [m]
"#;
}

impl Node for ContactPoint {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { height: params.height })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let at = Translation3::new(*inputs.x, *inputs.y, self.height);
        let pose: IsometryMatrix3<f64> = inputs.pose.0 * at;
        let point = pose.translation.vector;
        out.x.set(point.x);
        out.y.set(point.y);
        out.z.set(point.z);
        out.pose.set(Pose(pose));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Rotation3, Vector3, Vector4};
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, PoseShape, Scalar, ScalarShape, Shape, Stamp, Unit};

    use super::*;

    fn rig(params: &str) -> NodeRig {
        let metre = || Shape::from(ScalarShape::of(Unit::METRE));
        let wires = [("x", metre()), ("y", metre()), ("pose", PoseShape.into())];
        NodeRig::new::<ContactPoint>(params, &wires).unwrap()
    }

    fn point(rig: &NodeRig) -> Option<[f64; 3]> {
        let [x, y, z] = ["x", "y", "z"].map(|name| rig.get::<Scalar>(name).copied());
        Some([x?, y?, z?])
    }

    fn turn(axis: usize, angle: f64) -> Matrix4<f64> {
        let (sin, cos) = (angle.sin(), angle.cos());
        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut matrix = Matrix4::identity();
        (matrix[(a, a)], matrix[(a, b)], matrix[(b, a)], matrix[(b, b)]) = (cos, -sin, sin, cos);
        matrix
    }

    proptest! {
        #[test]
        fn it_is_the_product_of_4_by_4_matrices(
            at in prop::array::uniform3(-0.1..0.1_f64), angles in prop::array::uniform3(-3.0..3.0_f64),
            place in prop::array::uniform3(-1.0..1.0_f64),
        ) {
            let shift = Matrix4::new_translation(&Vector3::from(place));
            let matrix = shift * turn(2, angles[2]) * turn(1, angles[1]) * turn(0, angles[0]);
            let rotation = Rotation3::from_matrix_unchecked(matrix.fixed_view::<3, 3>(0, 0).into_owned());
            let pose = IsometryMatrix3::from_parts(Translation3::from(Vector3::from(place)), rotation);
            let mut rig = rig(&format!("height = {:?}", at[2]));
            rig.set("x", at[0]);
            rig.set("y", at[1]);
            rig.set("pose", Pose(pose));
            rig.step();
            let expected = matrix * Vector4::new(at[0], at[1], at[2], 1.0);
            let [x, y, z] = point(&rig).unwrap();
            prop_assert!((Vector4::new(x, y, z, 1.0) - expected).amax() < 1e-12);
            let contact = rig.get::<Pose>("pose").unwrap().0.to_homogeneous();
            prop_assert!((contact - matrix * Matrix4::new_translation(&Vector3::from(at))).amax() < 1e-12);
        }
    }

    #[test]
    fn a_point_comes_with_each_new_contact_and_is_as_old() {
        let mut rig = rig("");
        let at = |z: f64| Pose(IsometryMatrix3::translation(0.5, 0.0, z));
        rig.set("pose", at(0.3));
        rig.step();
        assert_eq!(point(&rig), None, "no contact yet");
        rig.set("x", 0.01);
        rig.set("y", -0.02);
        rig.step();
        assert_eq!(point(&rig), Some([0.51, -0.02, 0.3]), "the pose is held");
        rig.set("pose", at(0.4));
        rig.step();
        assert_eq!((rig.freshness("z"), point(&rig)), (Freshness::Held, Some([0.51, -0.02, 0.3])), "no new contact");
        rig.edit("pose", Stamp { nanos: 0, device: 1 }, |pose| *pose = at(0.5));
        rig.set("x", 0.0);
        rig.step();
        assert_eq!(point(&rig), Some([0.5, -0.02, 0.5]));
        assert_eq!(rig.mark("pose").stamp().nanos, 1_000_000, "as old as the older of x and y, whatever the pose is");
        rig.lose("y");
        rig.step();
        assert_eq!((rig.freshness("x"), rig.freshness("pose")), (Freshness::Lost, Freshness::Lost));
    }
}
