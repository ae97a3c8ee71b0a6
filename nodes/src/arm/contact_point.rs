//! `contact_point`: the contact in the base. The pose is sampled: a pose that changes while the contact is held makes
//! no point.

use nalgebra::{IsometryMatrix3, Translation3};
use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Pose, Scalar};

/// Measures the position of the contact in the base, from the pose of the sensor.
///
/// p = T_gs (x, y, height), where T_gs is the pose of the sensor from `arm_state`. The surface of the pad is the plane
/// z = 0 of the sensor. Section IV of the paper measures objects by touch in this way. Use `x`, `y` and `z` for
/// recordings and plots, and `pose`, the same point with the axes of the sensor, for nodes that take a pose.
///
/// Each new contact makes a point, which is as old as the contact. Without a contact the outputs are absent. An arm
/// that moves between two images makes no point.
///
/// The accuracy is that of the kinematics, the mount and the time between image and pose: at 0.05 m/s, a pose that is
/// 4 ms too new is 0.2 mm off. Foam under pressure lies below the plane of the pad: set `height`.
///
/// ```toml
/// [nodes.contact_point]
/// type = "contact_point"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// in.pose = "state.sensor_pose"
/// height = -0.001                     # the foam is compressed by about 1 mm [m]
/// ```
#[derive(Describe)]
pub struct ContactPoint {
    /// Above the plane of the pad [m].
    height: f64,
}

/// Parameters of `contact_point`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Height of the contact above the plane of the pad, along the sensor's z; negative if the foam is compressed.
    #[param(unit = "m", default = 0.0)]
    height: f64,
}

/// What `contact_point` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Centre of the contact along the sensor's x, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "x")]
    x: In<'a, Scalar>,
    /// Centre of the contact along the sensor's y, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "y")]
    y: In<'a, Scalar>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", sampled)]
    pose: In<'a, Pose>,
}

/// What `contact_point` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The contact's x in the base.
    #[port(unit = "m", frame = "B", quantity = "x")]
    x: Out<Scalar>,
    /// The contact's y in the base.
    #[port(unit = "m", frame = "B", quantity = "y")]
    y: Out<Scalar>,
    /// The contact's z in the base.
    #[port(unit = "m", frame = "B", quantity = "z")]
    z: Out<Scalar>,
    /// Position of the contact with the orientation of the sensor, in the base.
    #[port(frame = "self", reference = "B")]
    pose: Out<Pose>,
}

impl Node for ContactPoint {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { height: params.height })
    }

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
        let wires = [("x", metre()), ("y", metre()), ("pose", PoseShape::default().into())];
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
        fn the_point_is_the_product_of_4_by_4_matrices(
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
    fn each_new_contact_makes_a_point_that_is_as_old() {
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
        assert_eq!(rig.mark("pose").stamp().nanos, 1_000_000, "as old as the older of x and y, for any pose");
        rig.lose("y");
        rig.step();
        assert_eq!((rig.freshness("x"), rig.freshness("pose")), (Freshness::Lost, Freshness::Lost));
    }
}
