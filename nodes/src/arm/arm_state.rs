//! `arm_state`: forward kinematics (paper section IV, T_gs = T_ge T_es) and the spatial Jacobian, once for everybody.
//!
//! The paper's ruler and eq. 4 take the pose, `ik_sink` takes all three outputs. The Jacobian's columns are twists at
//! the base's origin, which is what eq. 4's Ad(T_gs) gives; the textbook's "geometric" Jacobian at the tip is another.

use tactflow_runtime::node::{FilePath, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{JacobianShape, JointsShape, PoseShape, Unit};
use tactflow_runtime::{inputs, outputs, params};

use super::chain::Chain;
use super::model::load;
use super::mount::Mount;

params! {
    /// The arm's model.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Pose of the sensor on that link.
    mount: Mount = Mount::NONE,
    /// Role whose frame is the sensor's.
    sensor: String,
    /// Name of the frame of the model's root.
    base: String = "base".into(),
}

inputs! {
    /// Measured joint positions [rad; m for a prismatic joint].
    position: Joints["rad", "R"],
}

outputs! {
    /// The same positions, with the names and limits of the model [rad; m for a prismatic joint].
    joints: Joints["rad", "R"],
    /// Pose of the sensor in the base.
    sensor_pose: Pose["$sensor", "$base"],
    /// Spatial Jacobian of the sensor in the base [m/s, rad/s per rad/s].
    jacobian: Jacobian["$base", "R"],
}

/// The arm's kinematics.
pub struct ArmState {
    chain: Chain,
}

impl tactflow_runtime::node::Describe for ArmState {
    const NAME: &'static str = "arm_state";
    const SUMMARY: &'static str = "where the sensor is and how the joints move it: forward kinematics and Jacobian";
    const DOC: &'static str = "T_gs = T_ge T_es, the paper's section IV: the chain from the model's root to `tip`, \
        and the `mount` of the sensor on it. It is worked out once here for everybody: `adjoint` and \
        `contact_point` take the pose, `ik_sink` takes all three outputs.\n\n\
        The Jacobian is spatial: its columns are twists at the base's origin, and meet what `adjoint` gives. The \
        textbook's \"geometric\" Jacobian at the tip is another.\n\n\
        Model, tip and mount are facts of the arm's device, so a graph takes them from there and fits any arm. \
        `sensor` is the role whose frame the pose is of. The joints of the wire have to be the model's, in its \
        order.";
    const EXAMPLE: &'static str = r#"
[nodes.state]
type = "arm_state"
in.position = "arm.position"
sensor = "pad"
urdf = { from = "arm.urdf" }
tip = { from = "arm.tip" }
mount = { from = "arm.mount" }
"#;
}

impl Node for ArmState {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let chain = load(&params.urdf, &params.tip, &params.mount)?;
        let joints = JointsShape { joints: chain.joints().to_vec(), unit: Unit::RADIAN };
        same_joints(&names(&setup.inputs.position), &names(&joints))?;
        setup.outputs.sensor_pose = PoseShape;
        setup.outputs.jacobian = JacobianShape(joints.clone());
        setup.outputs.joints = joints;
        Ok(Self { chain })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let q = &inputs.position.0;
        let pose = self.chain.forward(q, &mut out.jacobian.write().0);
        out.sensor_pose.set(pose);
        out.joints.write().0.copy_from_slice(q);
    }
}

fn names(shape: &JointsShape) -> Vec<&str> {
    shape.joints.iter().map(|joint| joint.name.as_str()).collect()
}

/// It is a mistake at `position` if the wire's joints are not the model's.
fn same_joints(wire: &[&str], model: &[&str]) -> Result<(), Mistakes> {
    let message = match wire.iter().zip(model).find(|(wire, model)| wire != model) {
        _ if wire.len() != model.len() => {
            format!("the wire has {} joints, but the model has {} up to the tip", wire.len(), model.len())
        }
        Some((wire, model)) => format!("the wire has joint `{wire}` where the model has `{model}`"),
        None => return Ok(()),
    };
    let help = format!("the model's joints are `{}`", model.join("`, `"));
    Err(Mistake::input("position", message).help(help).into())
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
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
    fn the_pose_is_the_mounted_sensors_and_the_joints_carry_the_models_limits() {
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
    fn wires_that_are_not_the_models() {
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
        assert!(rig("tip = 'hand'", &NAMES).is_err());
    }
}
