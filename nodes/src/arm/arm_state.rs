//! `arm_state`: the pose of the sensor and the Jacobian, in one pass over the chain, see [`Chain`].

use tactflow_runtime::node::{Describe, FilePath, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Jacobian, JacobianShape, Joints, JointsShape, Pose, PoseShape, Twist, Unit};

use super::chain::Chain;
use super::joint_names::check_joints;
use super::model::load;
use super::mount::Mount;

/// Computes where the sensor is and how the joints move it: forward kinematics and Jacobian.
///
/// The pose is T_gs = T_ge T_es (section IV of the paper): the chain from the root of the model to `tip`, then the
/// `mount` of the sensor on it. `adjoint` and `contact_point` take the pose, and `ik_sink` takes all three outputs, so
/// the kinematics are computed once.
///
/// The Jacobian is spatial: its columns are twists at the origin of the base, as the output of `adjoint` is. It is not
/// the "geometric" Jacobian of textbooks, which is taken at the tip.
///
/// Model and tip are facts of the arm, and the mount is a fact of the sensor on it. A graph that takes them from there
/// fits any arm. The pose is that of the frame of the role `sensor`, in the frame `base` of the arm's role. The wire
/// must have the joints of the model, in its order.
///
/// ```toml
/// [nodes.state]
/// type = "arm_state"
/// in.position = "arm.position"
/// sensor = "pad"
/// urdf = { from = "arm.urdf" }
/// tip = { from = "arm.tip" }
/// mount = { from = "pad.mount" }
/// ```
#[derive(Describe)]
pub struct ArmState {
    chain: Chain,
}

/// Parameters of `arm_state`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Model of the arm.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Pose of the sensor on that link.
    #[param(default = Mount::NONE, from_bench)]
    mount: Mount,
    /// Role of the sensor; names the frame of the pose.
    sensor: String,
}

/// What `arm_state` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Measured joint positions; those of prismatic joints are in m.
    #[port(unit = "rad", robot = "R", quantity = "position", known)]
    position: In<'a, Joints>,
}

/// What `arm_state` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same positions, with the names and limits of the model's joints, and the accelerations of the arm's.
    #[port(unit = "rad", robot = "R", quantity = "position")]
    joints: Out<Joints>,
    /// Pose of the sensor in the base.
    #[port(frame = "$sensor", reference = "R.base", quantity = "sensor_pose")]
    sensor_pose: Out<Pose>,
    /// Spatial Jacobian of the sensor in the base.
    #[port(frame = "R.base", robot = "R")]
    jacobian: Out<Jacobian>,
}

impl Node for ArmState {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let chain = load(&params.urdf, &params.tip, &params.mount)?;
        let mut joints = JointsShape { joints: chain.joints().to_vec(), unit: Unit::RADIAN };
        check_joints(&setup.inputs.position, &joints)?;
        // A model states no accelerations, so they are those of the arm.
        for (joint, of_arm) in joints.joints.iter_mut().zip(&setup.inputs.position.joints) {
            joint.acceleration = of_arm.acceleration;
        }
        setup.outputs.sensor_pose = PoseShape { start: start(&chain, &setup.inputs.position) };
        setup.outputs.jacobian = JacobianShape(joints.clone());
        setup.outputs.joints = joints;
        Ok(Self { chain })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let q = &inputs.position.0;
        let pose = self.chain.forward(q, &mut out.jacobian.write().0);
        out.sensor_pose.set(pose);
        out.joints.write().0.copy_from_slice(q);
    }
}

/// Returns the origin of the sensor at the start of a run, if the arm states its start [m].
fn start(chain: &Chain, arm: &JointsShape) -> Option<[f64; 3]> {
    let joints: Vec<f64> = arm.joints.iter().map(|joint| joint.start).collect::<Option<_>>()?;
    let pose = chain.forward(&joints, &mut vec![Twist::default(); joints.len()]);
    Some(pose.0.translation.vector.into())
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Jacobian, Joint, Joints, Pose, Shape};

    use super::*;

    const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/lwr4p.urdf");
    const NAMES: [&str; 7] = ["a1", "a2", "e1", "a3", "a4", "a5", "a6"];

    fn wire(names: &[&str]) -> JointsShape {
        let joint = |name: &&str| Joint { name: format!("lwr_{name}_joint"), ..Joint::default() };
        JointsShape { joints: names.iter().map(joint).collect(), unit: Unit::RADIAN }
    }

    fn rig(more: &str, names: &[&str]) -> Result<NodeRig, Mistakes> {
        let params = format!("urdf = '{URDF}'\nsensor = 'pad'\n{more}");
        NodeRig::new::<ArmState>(&params, &[("position", wire(names).into())])
    }

    #[test]
    fn the_pose_includes_the_mount_and_the_joints_have_the_limits_of_the_model() {
        let mut rig = rig("tip = 'lwr_7_link'\nmount = { xyz = [0, 0, 0.1215] }", &NAMES).unwrap();
        rig.set("position", Joints::zeros(7));
        rig.step();
        let pose = rig.get::<Pose>("sensor_pose").unwrap();
        assert!((pose.0.translation.vector.z - 1.3).abs() < 1e-12);
        // The second joint's axis is -y through (0, 0, 0.3105): p x w = 0.3105 x.
        let column = rig.get::<Jacobian>("jacobian").unwrap().0[1].0;
        assert!((column - nalgebra::Vector6::new(0.3105, 0.0, 0.0, 0.0, -1.0, 0.0)).norm() < 1e-12);
        assert_eq!(rig.get::<Joints>("joints"), Some(&Joints::zeros(7)));
        let Shape::Joints(shape) = rig.shape("joints") else { panic!("joints") };
        assert!((shape.joints[1].upper - 120f64.to_radians()).abs() < 1e-9);
        assert_eq!(rig.shape("jacobian"), &JacobianShape(shape.clone()).into());
    }

    #[test]
    fn the_joints_have_the_accelerations_that_the_arm_states() {
        let params = format!("urdf = '{URDF}'\nsensor = 'pad'\ntip = 'lwr_7_link'");
        let mut arm = wire(&NAMES);
        arm.joints[2].acceleration = 7.5;
        let rig = NodeRig::new::<ArmState>(&params, &[("position", arm.into())]).unwrap();
        let Shape::Joints(shape) = rig.shape("joints") else { panic!("joints") };
        let accelerations: Vec<f64> = shape.joints.iter().map(|joint| joint.acceleration).collect();
        assert_eq!(accelerations[1..4], [f64::INFINITY, 7.5, f64::INFINITY]);
    }

    #[test]
    fn the_pose_has_the_start_of_the_arm() {
        let params = format!("urdf = '{URDF}'\nsensor = 'pad'\ntip = 'lwr_7_link'\nmount = {{ xyz = [0, 0, 0.1215] }}");
        let start_of = |starts: [Option<f64>; 7]| {
            let mut shape = wire(&NAMES);
            shape.joints.iter_mut().zip(starts).for_each(|(joint, start)| joint.start = start);
            let rig = NodeRig::new::<ArmState>(&params, &[("position", shape.into())]).unwrap();
            let Shape::Pose(pose) = rig.shape("sensor_pose").clone() else { panic!("a pose") };
            pose.start
        };
        let start = start_of([Some(0.0); 7]).expect("every joint has a start");
        assert!((nalgebra::Vector3::from(start) - nalgebra::Vector3::new(0.0, 0.0, 1.3)).norm() < 1e-12, "{start:?}");
        let mut unknown = [Some(0.0); 7];
        unknown[3] = None;
        assert_eq!(start_of(unknown), None);
    }

    #[test]
    fn joints_other_than_those_of_the_model_are_a_mistake() {
        let mut swapped = NAMES;
        swapped.swap(0, 1);
        let cases: [(&[&str], &str); 3] = [
            (&NAMES[..6], "the wire has 6 joints, but the model has 7 up to the tip"),
            (&[], "the wire has 0 joints, but the model has 7 up to the tip"),
            (&swapped, "the wire has joint `lwr_a2_joint` where the model has `lwr_a1_joint`"),
        ];
        for (names, message) in cases {
            let mistakes = rig("tip = 'lwr_7_link'", names).err().unwrap();
            assert_eq!((&mistakes[0].at, mistakes[0].message.as_str()), (&At::Input("position".into()), message));
        }
        assert_eq!(places("tip = 'hand'", &rig("tip = 'hand'", &NAMES)), ["bad-value: `tip`"]);
    }
}
