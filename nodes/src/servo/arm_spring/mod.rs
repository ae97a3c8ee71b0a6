//! `arm_spring`: how far a compliant arm gives way to what it presses on, and how it swings.

mod learned;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Jacobian, Joints, Pose, Scalar, ScalarShape, Unit};

use crate::motion::normal::{give, lead};

use learned::Spring;

/// Measures how far the spring of a compliant arm gives way to the force on its pad, and how it swings.
///
/// An arm with springs in its joints leads: its commanded equilibrium z_eq is ahead of its position z. With its mass m,
/// its stiffness K and its damping d along the sensor's z, and with the force F on the pad, m z'' = K (z_eq - z) - d z' - F.
/// So the lead has two parts:
///
/// ```text
/// given_way = F / K                                  how far the arm would lean at rest
/// swing     = (z_eq - z) - F / K = (m z'' + d z') / K
/// ```
///
/// The lead is n · J (equilibrium - position) with the normal n of the pad. `swing` is filtered: what stays for longer than
/// 0.3 s is friction of the joints or their weight, and a low-pass filter of 20 ms removes noise.
///
/// **The compliance 1/K is learned.** It begins with that of the joints, J k⁻¹ Jᵀ along the normal. Then it is the slope of
/// the lead over the force, by least squares over the last 2 s of contact. What is stated counts as much as a second with
/// 1 N, and at most a factor of three is learned. So a pad that measures half of the force, or an arm that is stiffer than
/// stated, is wrong in the first press only. What is learned stays when the contact ends.
///
/// Both outputs are absent while an input is, so while nothing touches the pad. They are absent too for an arm without
/// `joint_n_m_per_rad`, which is stiff, and for a force that is not in N.
///
/// ```toml
/// [nodes.arm_spring]
/// type = "arm_spring"
/// in.force = "moments.force"
/// in.pose = "state.sensor_pose"
/// in.jacobian = "state.jacobian"
/// in.position = "arm.position"
/// in.equilibrium = "arm.equilibrium"
/// joint_n_m_per_rad = 200.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct ArmSpring {
    /// Compliance of the joints [rad/(N m)]; `None` for a stiff arm, or a force that is not in N.
    compliance: Option<f64>,
}

/// Parameters of `arm_spring`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Stiffness of the joints of a compliant arm, the largest one; in N/m for prismatic joints. The arm is stiff if not
    /// given.
    #[param(unit = "N m/rad", above = 0.0)]
    joint_n_m_per_rad: Option<f64>,
}

/// What `arm_spring` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Force on the pad.
    #[port(unit = "_", frame = "A", sampled)]
    force: Option<In<'a, Scalar>>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", known, sampled)]
    pose: Option<In<'a, Pose>>,
    /// Spatial Jacobian of the sensor in the base.
    #[port(frame = "B", robot = "R", sampled)]
    jacobian: Option<In<'a, Jacobian>>,
    /// Measured joint positions; those of prismatic joints are in m.
    #[port(unit = "rad", robot = "R", quantity = "position", known, sampled)]
    position: Option<In<'a, Joints>>,
    /// Posture that the commands have moved the arm to.
    #[port(unit = "rad", robot = "R", quantity = "equilibrium", known, sampled)]
    equilibrium: Option<In<'a, Joints>>,
}

/// What `arm_spring` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// How far the arm gives way to the force along the sensor's z.
    #[port(unit = "m", frame = "A", quantity = "given_way")]
    given_way: Out<Scalar>,
    /// How far the arm swings along the sensor's z: its lead beyond what the force explains.
    #[port(unit = "m", frame = "A", quantity = "swing")]
    swing: Out<Scalar>,
}

impl Node for ArmSpring {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = Spring;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let is_in_newtons = setup.inputs.force.as_ref().is_some_and(|force: &ScalarShape| force.unit == Unit::NEWTON);
        let compliance = params.joint_n_m_per_rad.filter(|_| is_in_newtons).map(f64::recip);
        (setup.outputs.given_way, setup.outputs.swing) = (ScalarShape::of(Unit::METRE), ScalarShape::of(Unit::METRE));
        Ok(Self { compliance })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut Spring) {
        let pressed = self.compliance.zip(pressed(&inputs));
        let Some((compliance, [give, lead, force])) = pressed else {
            state.release();
            return;
        };
        let bent = state.next(compliance * give, lead, force, tick.dt.min(tick.max_gap));
        if !state.is_finite() {
            *state = self.state();
            return;
        }
        out.given_way.set(bent.given_way);
        out.swing.set(bent.swing);
    }
}

/// Returns the way along z of an arm whose joints have a compliance of 1, for each newton [m²], its lead [m], and the force
/// [N]; `None` if an input is absent.
fn pressed(inputs: &Inputs<'_>) -> Option<[f64; 3]> {
    let (force, pose, jacobian) = (inputs.force.as_ref()?, inputs.pose.as_ref()?, inputs.jacobian.as_ref()?);
    let lead = lead(pose, jacobian, inputs.position.as_ref()?, inputs.equilibrium.as_ref()?);
    Some([give(pose, jacobian), lead, **force])
}

#[cfg(test)]
mod tests;
