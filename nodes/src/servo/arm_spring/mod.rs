//! `arm_spring`: how far the force on its pad bends the spring of a compliant arm, and how the arm swings.

mod learned;

use tactflow_runtime::node::{Describe, In, Inputs, Interval, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Jacobian, Joints, Pose, Scalar, ScalarShape, Unit};

use crate::motion::normal::{give, lead};

use learned::Spring;

/// Ratio of two stiffnesses from which on the stated one is called wrong: what is learned is within 15 % of the truth where
/// that was measured (decision 056) [1].
const WRONG: f64 = 1.5;

/// Measures how far the force on its pad bends the spring of a compliant arm, and how the arm swings.
///
/// An arm with springs in its joints leads: its commanded equilibrium z_eq is ahead of its position z. With its mass m,
/// its stiffness K and its damping d along the sensor's z, and with the force F on the pad, m z'' = K (z_eq - z) - d z' - F.
/// So the lead has two parts:
///
/// ```text
/// deflection = F / K                                  how far the spring is bent at rest
/// swing      = (z_eq - z) - F / K = (m z'' + d z') / K
/// ```
///
/// The lead is n · J (equilibrium - position) with the normal n of the pad. Friction of the joints and their weight bend the
/// spring too. So the lead counts from where the contact began, and what stays in the swing for longer than 0.3 s is
/// removed. A low-pass filter of 20 ms removes noise.
///
/// **The compliance 1/K is learned.** It begins with that of the joints, J k⁻¹ Jᵀ along the normal in the posture of the
/// arm. Then a factor on it is fitted to lead and force, by least squares over the last 2 s of contact. The factor is
/// between 1/20 and 3. What is stated counts as much as 0.1 s with 1 N at first, and less with each second of contact. So a
/// wrong stiffness matters while the first press grows, and with 0.3 N for some seconds. The factor stays when the contact
/// ends. If it is below 2/3 or above 3/2 after a second of contact with enough force, the summary of the run says so, and
/// which stiffness the joints have, unless the factor is at its bound.
///
/// Both outputs are absent while an input is absent. So they are absent while nothing touches the pad. They are also absent
/// while the force misses the lead by more than 10 mm, as in a frame of garbage, while all commands are held, for an arm
/// without `joint_n_m_per_rad`, which is stiff, and for a force that is not in N. If forces miss the lead for 0.1 s, the
/// lead at the begin of the contact was wrong, and it counts afresh.
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
    #[port(unit = "_", frame = "A")]
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
    /// How far the force bends the spring of the arm, along the sensor's z.
    #[port(unit = "m", frame = "A", quantity = "deflection")]
    deflection: Out<Scalar>,
    /// How far the arm swings along the sensor's z: its lead beyond what the force explains.
    #[port(unit = "m", frame = "A", quantity = "swing")]
    swing: Out<Scalar>,
}

/// What `arm_spring` remembers.
#[derive(State)]
pub struct State {
    spring: Spring,
    /// Since the last force.
    interval: Interval,
}

impl Node for ArmSpring {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let is_in_newtons = setup.inputs.force.as_ref().is_some_and(|force: &ScalarShape| force.unit == Unit::NEWTON);
        let compliance = params.joint_n_m_per_rad.filter(|_| is_in_newtons).map(f64::recip);
        (setup.outputs.deflection, setup.outputs.swing) = (ScalarShape::of(Unit::METRE), ScalarShape::of(Unit::METRE));
        Ok(Self { compliance })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let compliance = self.compliance.filter(|_| !tick.is_halted);
        let pressed = compliance.and_then(|compliance| Some((compliance, pressed(&inputs)?)));
        let Some((compliance, [give, lead, force])) = pressed else {
            state.spring.release();
            return;
        };
        let dt = inputs.force.and_then(|force| state.interval.step(&force, tick)).unwrap_or(0.0);
        let Some(bent) = state.spring.next(compliance * give, lead, force, dt.min(tick.max_gap)) else { return };
        if !bent.is_finite() {
            // A sample that is not a number would stay in the sums.
            *state = self.state();
            return;
        }
        out.deflection.set(bent.deflection);
        out.swing.set(bent.swing);
    }

    fn found(&self, state: &State) -> Option<String> {
        let (stated, (gives, is_end)) = (self.compliance?.recip(), state.spring.learned()?);
        let (ratio, how) = if gives < 1.0 { (gives.recip(), "stiff") } else { (gives, "soft") };
        let joints = match is_end {
            true => String::new(),
            false => format!(", as if its joints had {:.0} N m/rad", stated / gives),
        };
        let least = if is_end { "at least " } else { "" };
        (ratio > WRONG).then(|| {
            format!(
                "the arm is {least}{ratio:.1} times as {how} as stated{joints}: correct `stiffness` in its robot file, or the \
                 controller if the device sends it this number"
            )
        })
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
