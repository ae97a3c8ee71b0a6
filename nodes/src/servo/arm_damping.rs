//! `arm_damping`: a motion against the swing of a compliant arm.

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Scalar, Twist};

use crate::usual::USUAL_M_PER_S;

/// Damps the swing of a compliant arm that presses on something.
///
/// An arm with springs in its joints swings when a press begins or ends. Its swing changes the pressure, and a pressure
/// controller that answers it makes it worse. This node moves the sensor along its z against the swing that `arm_spring`
/// measures, so that the gain of the controller can be larger:
///
/// ```text
/// vz = wanted vz - rate · (swing beyond within_m)
/// ```
///
/// With the resonance ω of arm and contact, and the damping ratio ζ, a large swing decays as if 2 ζ ω were larger by `rate`,
/// if nothing is late. A swing of less than `within_m` is left alone, because friction of the joints looks like one: it
/// bends the springs while they turn.
///
/// If the stiffness of `arm_spring` is right, a `rate` below 2 ζ ω / √(1 + 4 ζ²) cannot make this loop unstable, however
/// late samples and commands are (small-gain theorem). The default of 6 1/s is more than that for an arm with little damping:
/// it is right for samples and commands that are 12 ms late at most.
///
/// While the swing is absent, the motion passes unchanged. The swing ends with the contact, and then the motion jumps by at
/// most `max_m_per_s`, so a `bumpless` stands behind this node. It damps whenever something touches the pad and a motion is
/// wanted, also in a mode that selects no component. Forces along the pad, which it does not measure, bend the springs
/// as well. So choose 3 1/s for a task that centres a contact, and leave the node out of one that goes on moving along an
/// object.
///
/// Source: feedback of the torque of springs to damp a load (Hori, Sawada and Chun, Slow resonance ratio control, IEEE
/// Transactions on Industrial Electronics 46, 1999), with the force on the pad for the torque of the load.
///
/// ```toml
/// [nodes.arm_damping]
/// type = "arm_damping"
/// in.twist = "sum.twist"
/// in.swing = "arm_spring.swing"
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct ArmDamping {
    params: Params,
}

/// Parameters of `arm_damping`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// By how much 2 ζ ω grows.
    #[param(unit = "1/s", range = 0.0.., usual = ..=10.0, default = 6.0, live)]
    rate: f64,
    /// Swing that is left alone: friction of the joints bends their springs by as much, and noise of the pad looks so.
    #[param(unit = "m", range = 0.0.., default = 0.0003)]
    within_m: f64,
    /// Largest speed that it adds.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S, default = 0.02)]
    max_m_per_s: f64,
}

/// What `arm_damping` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// How far the arm swings along the sensor's z.
    #[port(unit = "m", frame = "A", quantity = "swing")]
    swing: Option<In<'a, Scalar>>,
}

/// What `arm_damping` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion, and along z a motion against the swing.
    #[port(frame = "A")]
    twist: Out<Twist>,
}

impl Node for ArmDamping {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const LIMITS: Limits = Limits {
        through: Some("twist"),
        breaks: &["bumpless", "force", "peak", "wrench", "workspace", "blind", "speed", "acceleration"],
        ..Limits::NONE
    };

    fn new(params: Params, _setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { params })
    }

    fn step(&self, _tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, _state: &mut ()) {
        let Params { rate, within_m: within, max_m_per_s: most } = self.params;
        let beyond = |swing: f64| swing - swing.clamp(-within, within);
        let against = inputs.swing.map_or(0.0, |swing| (rate * beyond(*swing)).clamp(-most, most));
        let mut twist = *inputs.twist;
        twist.0[2] -= against;
        out.twist.set(twist);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{ScalarShape, TwistShape, Unit};

    use super::*;

    fn made(params: &str) -> Result<NodeRig, Mistakes> {
        let swing = ScalarShape::of(Unit::METRE).into();
        NodeRig::new::<ArmDamping>(params, &[("twist", TwistShape.into()), ("swing", swing)])
    }

    fn out(rig: &mut NodeRig, swing: Option<f64>) -> [f64; 6] {
        rig.set("twist", Twist([0.01, 0.02, 0.03, 0.1, 0.2, 0.3].into()));
        match swing {
            Some(swing) => rig.set("swing", swing),
            None => rig.lose("swing"),
        }
        rig.step();
        rig.get::<Twist>("twist").unwrap().0.into()
    }

    #[test]
    fn it_moves_against_the_swing_along_z_alone() {
        let mut rig = made("rate = 5.0\nwithin_m = 0.001").unwrap();
        let [x, y, z, turns @ ..] = out(&mut rig, Some(0.002));
        assert!((z - 0.025).abs() < 1e-12 && [x, y] == [0.01, 0.02] && turns == [0.1, 0.2, 0.3]);
        assert!((out(&mut rig, Some(-0.003))[2] - 0.04).abs() < 1e-12);
        assert_eq!(out(&mut rig, Some(0.001))[2], 0.03, "friction is left alone");
        assert!((out(&mut rig, Some(9.0))[2] - 0.01).abs() < 1e-12, "at most 20 mm/s");
        assert_eq!(out(&mut rig, None)[2], 0.03, "no swing is known");
    }

    #[test]
    fn wrong_parameters_are_refused() {
        for (bad, place) in [("rate = -1.0", "bad-value: `-1.0`"), ("max_m_per_s = 0.0", "bad-value: `0.0`")] {
            assert_eq!(places(bad, &made(bad)), [place], "{bad}");
        }
    }
}
