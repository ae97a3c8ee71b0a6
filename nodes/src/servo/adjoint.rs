//! `adjoint`: a twist in another frame.
//!
//! The twist of a body depends on the point at which it is taken: in the base it is the spatial twist, which matches
//! the spatial Jacobian and not the Jacobian whose rows are taken at the tip.

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::{Pose, Twist};

use crate::motion::adjoint::adjoint;

/// Expresses a motion in another frame, such as the sensor's motion in the base.
///
/// V_B = Ad_T V_A (eq. 4 of the paper), where T = (R, p) is the pose of A in B, Ad_T = [R, p^ R; 0, R] and
/// V = [v; omega]. Put it between nodes that compute in the frame of the sensor and an arm that moves in the base.
///
/// A twist in the base is spatial: its linear part is the velocity of the point of the body that passes through the
/// origin of the base, not the velocity of the sensor. A slow roll of a sensor that is 0.7 m away looks fast there.
/// Limit and plot motions in the frame of the sensor, and wire the result only to nodes that take a spatial twist, such
/// as `ik_sink`.
///
/// Both inputs must be present. The output is as old as the older of them.
///
/// ```toml
/// [nodes.to_base]
/// type = "adjoint"
/// in.twist = "acceleration_limit.twist"
/// in.pose = "state.sensor_pose"
/// ```
#[derive(Describe)]
pub struct Adjoint;

/// What `adjoint` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist in A: at the origin of A, along the axes of A.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// Pose of A in B.
    #[port(frame = "A", reference = "B")]
    pose: In<'a, Pose>,
}

/// What `adjoint` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion in B: at the origin of B, along the axes of B.
    #[port(frame = "B")]
    twist: Out<Twist>,
}

impl Node for Adjoint {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const LIMITS: Limits = Limits::passed("twist");

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.twist.set(adjoint(&inputs.pose, &inputs.twist));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{IsometryMatrix3, Rotation3, Translation3, Vector3};
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{PoseShape, Stamp, TwistShape};

    use super::*;

    #[test]
    fn the_result_follows_both_inputs_and_is_as_old_as_the_older() {
        let wires = [("twist", TwistShape.into()), ("pose", PoseShape::default().into())];
        let mut rig = NodeRig::new::<Adjoint>("", &wires).unwrap();
        rig.set("twist", Twist::new(Vector3::x(), Vector3::zeros()));
        rig.step();
        assert_eq!(rig.get::<Twist>("twist"), None);
        for (turn, expected) in [(0.0, Vector3::x()), (std::f64::consts::FRAC_PI_2, Vector3::y())] {
            let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), turn);
            rig.set("pose", Pose(IsometryMatrix3::from_parts(Translation3::identity(), turned)));
            rig.step();
            assert!((rig.get::<Twist>("twist").unwrap().linear() - expected).amax() < 1e-15);
            assert_eq!(rig.mark("twist").stamp(), Stamp { nanos: 0, device: 0 });
        }
    }
}
