//! `static_pose`: a pose that does not change. It is written once, so that it wakes what reads it once.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::node::{Describe, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::Pose;

use crate::motion::pose::pose_of;
use crate::usual::{USUAL_RAD, USUAL_REACH_M};

/// A pose that the file gives and that never changes, such as that of a second pad beside the first.
///
/// Use it for what is mounted: a pad on a table, the base of one arm in that of another one, two pads on one tip.
/// `compose_poses` continues from it to other frames, and `adjoint` expresses a motion in them.
///
/// The pose is present from the first tick on, and new only then. It has no age, so what is computed from it and from a
/// measured pose is as old as the measured one.
///
/// `frame` and `reference` are roles (`"pad"`) or bases (`"arm.base"`). Leave out one that a wire defines, or that has
/// no role, such as a room.
///
/// It is no measured pose of a sensor, whatever its frames are: limiters and `ik_sink` refuse it, and so does an
/// `adjoint` between them and the arm. They take `arm_state.sensor_pose`.
///
/// ```toml
/// [nodes.static_pose]                 # the base of the arm in the room: on a table, a quarter turn to the left
/// type = "static_pose"
/// frame = "arm.base"
/// xyz = [1.2, 0.4, 0.75]              # [m]
/// rpy = [0, 0, "90 deg"]              # [rad]
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct StaticPose {
    pose: IsometryMatrix3<f64>,
}

/// Parameters of `static_pose`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Frame whose pose this is. Without it, the frame follows from the wires.
    frame: Option<String>,
    /// Frame in which the pose is given. Without it, the frame follows from the wires.
    reference: Option<String>,
    /// Origin of `frame` in `reference`.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M, default = [0.0; 3])]
    xyz: [f64; 3],
    /// Roll, pitch and yaw of `frame` in `reference`: Rz(yaw) Ry(pitch) Rx(roll), as in a URDF.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = [0.0; 3])]
    rpy: [f64; 3],
}

/// What `static_pose` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Pose of `frame` in `reference`.
    #[port(frame = "$frame", reference = "$reference")]
    pose: Out<Pose>,
}

/// What `static_pose` remembers.
#[derive(State)]
pub struct State {
    /// Whether the pose is written.
    is_written: bool,
}

impl Node for StaticPose {
    type Params = Params;
    type Inputs<'a> = ();
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { pose: pose_of(params.xyz, params.rpy) })
    }

    fn step(&self, _: &Tick, (): (), out: &mut Outputs, state: &mut State) {
        if state.is_written {
            out.pose.keep();
        } else {
            out.pose.set(Pose(self.pose));
            state.is_written = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
    use proptest::prelude::*;
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::Freshness;

    use super::*;

    fn rig(params: &str) -> NodeRig {
        NodeRig::new::<StaticPose>(params, &[]).unwrap()
    }

    proptest! {
        #[test]
        fn it_is_roll_then_pitch_then_yaw_about_fixed_axes(
            xyz in prop::array::uniform3(-1.0..1.0_f64), rpy in prop::array::uniform3(-3.1..3.1_f64),
        ) {
            let mut rig = rig(&format!("xyz = {xyz:?}\nrpy = {rpy:?}"));
            rig.step();
            let rotation = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
            let expected = Isometry3::from_parts(Vector3::from(xyz).into(), rotation);
            let found = rig.get::<Pose>("pose").unwrap().0;
            prop_assert!((found.to_homogeneous() - expected.to_homogeneous()).amax() < 1e-14);
        }
    }

    #[test]
    fn a_quarter_turn_about_z_turns_x_to_y() {
        let mut rig = rig("xyz = [1, 2, 3]\nrpy = [0, 0, '90 deg']");
        rig.step();
        let pose = rig.get::<Pose>("pose").unwrap().0;
        assert!((pose * Point3::new(1.0, 0.0, 0.0) - Point3::new(1.0, 3.0, 3.0)).amax() < 1e-15);
    }

    #[test]
    fn it_is_new_once_and_has_no_age() {
        let mut rig = rig("");
        rig.step();
        assert_eq!((rig.get::<Pose>("pose"), rig.freshness("pose")), (Some(&Pose::default()), Freshness::New));
        assert!(rig.mark("pose").stamp().is_timeless());
        for _ in 0..3 {
            rig.step();
            assert_eq!(rig.freshness("pose"), Freshness::Held);
        }
    }

    #[test]
    fn numbers_in_another_unit_are_reported() {
        let of = |params: &str| places(params, &NodeRig::new::<StaticPose>(params, &[]));
        assert_eq!(of("xyz = [1, 2]"), ["bad-value: `[1, 2]`"]);
        assert_eq!(of("orientation = [0, 0, 1]"), ["unknown-key: `orientation`"]);
    }
}
