//! `bumpless`: out = in + offset.
//!
//! A change of the input from one tick to the next passes as far as half of the accelerations allows. The rest goes
//! into the offset with the opposite sign, and the offset goes to zero on a straight line with the other half. So the
//! output never changes by more than the accelerations allow, whatever the input does. Once the offset is zero, the
//! output is the input, to the last bit and without lag. One factor scales all six components of each change.

use tactflow_runtime::node::{Describe, Limits, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Scalar, Twist};

use super::{Inputs, fraction};
use crate::motion::bounds::{countable, scale_twist, twist_ratio};
use crate::usual::{USUAL_M_PER_S, USUAL_M_PER_S2, USUAL_RAD_PER_S, USUAL_RAD_PER_S2};

/// Removes the jumps of a motion, as when the mode changes or a contact begins or ends (bumpless transfer).
///
/// The wanted motion jumps when a mode begins and when a contact is found or lost. The part of a change that exceeds
/// half of the accelerations becomes an offset, which goes to zero with the other half. So the output is smooth before
/// it reaches a limiter, and it is exactly the input, without lag, as soon as the offset is zero.
///
/// A wanted motion that is faster than `linear_m_per_s` or `angular_rad_per_s` is scaled down to these speeds first. A
/// controller can output a hundred times the speed of the arm, and when its contact is lost the output would have to
/// come down from there. Use the speeds of the `twist_limit` behind it.
///
/// When the motion becomes absent, the output decreases to zero and is then absent. The node comes after the sum of all
/// motions and before the limiters.
///
/// ```toml
/// [nodes.bumpless]
/// type = "bumpless"
/// in.twist = "sum.twist"
/// linear_m_per_s2 = 1.0
/// angular_rad_per_s2 = 10.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct Bumpless {
    params: Params,
    /// Maximum linear and angular speed of the input [m/s, rad/s].
    speeds: [f64; 2],
}

/// Parameters of `bumpless`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Maximum linear acceleration.
    #[param(unit = "m/s2", above = 0.0, usual = ..=USUAL_M_PER_S2)]
    linear_m_per_s2: f64,
    /// Maximum angular acceleration.
    #[param(unit = "rad/s2", above = 0.0, usual = ..=USUAL_RAD_PER_S2)]
    angular_rad_per_s2: f64,
    /// Linear speed to which the wanted motion is scaled down; unlimited if not given.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S)]
    linear_m_per_s: Option<f64>,
    /// Angular speed to which the wanted motion is scaled down; unlimited if not given.
    #[param(unit = "rad/s", above = 0.0, usual = ..=USUAL_RAD_PER_S)]
    angular_rad_per_s: Option<f64>,
}

/// What `bumpless` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion without jumps.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the wanted motion in the output; the rest is the offset that remains of a jump.
    #[port(unit = "1", frame = "_")]
    bumpless: Out<Scalar>,
}

/// What `bumpless` remembers.
#[derive(State)]
pub struct State {
    /// The input of the last tick [m/s, rad/s].
    last: Twist,
    /// Offset that remains of the jumps [m/s, rad/s].
    offset: Twist,
}

impl Node for Bumpless {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits {
        through: Some("twist"),
        holds: &["bumpless"],
        breaks: &["force", "peak", "wrench", "workspace", "blind", "speed", "acceleration"],
        ..Limits::NONE
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.bumpless = fraction();
        let speeds = [params.linear_m_per_s, params.angular_rad_per_s].map(|speed| speed.unwrap_or(f64::INFINITY));
        Ok(Self { params, speeds })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let Params { linear_m_per_s2: linear, angular_rad_per_s2: angular, .. } = self.params;
        let dt = tick.dt.min(tick.max_gap);
        // While the runtime holds all commands the motion counts as absent, so it starts from zero afterwards.
        let twist = inputs.twist.filter(|_| !tick.is_halted);
        let mut wanted = twist.map_or_else(Twist::default, |twist| countable(&twist));
        let pace = scale_twist(&wanted, self.speeds[0], self.speeds[1]);
        wanted.0 *= pace;
        let smooth = smooth(&wanted, &mut state.last, &mut state.offset, [0.5 * linear * dt, 0.5 * angular * dt]);
        if twist.is_none() && state.offset == Twist::default() {
            return;
        }
        out.twist.set(smooth);
        let [own, rest] = [&wanted, &state.offset].map(|twist| twist_ratio(twist, linear, angular));
        out.bumpless.set(pace * if rest > 0.0 { own / (own + rest) } else { 1.0 });
    }
}

/// Returns the motion without its jump, and updates the motion `last` and the `offset` of the last tick.
///
/// The passing part of the change and the change of the offset are at most `linear` [m/s] and `angular` [rad/s] each.
pub fn smooth(wanted: &Twist, last: &mut Twist, offset: &mut Twist, [linear, angular]: [f64; 2]) -> Twist {
    let change = Twist(wanted.0 - last.0);
    let passes = scale_twist(&change, linear, angular);
    *last = *wanted;
    offset.0 -= change.0 * (1.0 - passes);
    let fades = scale_twist(offset, linear, angular);
    if fades < 1.0 {
        offset.0 -= offset.0 * fades;
    } else {
        *offset = Twist::default();
    }
    Twist(wanted.0 + offset.0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, Scalar, TwistShape};

    use super::*;

    const ACCELERATIONS: &str = "linear_m_per_s2 = 1.0\nangular_rad_per_s2 = 10.0";

    fn rig() -> NodeRig {
        NodeRig::new::<Bumpless>(ACCELERATIONS, &[("twist", TwistShape.into())]).unwrap()
    }

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 0.0].into())
    }

    #[test]
    fn after_a_jump_the_output_converges_to_the_input() {
        let mut rig = rig();
        let mut steps = 0;
        // Half of 1 m/s² passes, and the offset goes to zero with the other half: 0.02 m/s take 20 ticks of 1 ms.
        while rig.get::<Twist>("twist") != Some(&along_x(0.02)) {
            rig.set("twist", along_x(0.02));
            rig.step();
            steps += 1;
            assert!(steps < 50);
        }
        assert!((20..=41).contains(&steps), "{steps}");
        assert_eq!(rig.get::<Scalar>("bumpless"), Some(&1.0));
        rig.lose("twist");
        rig.step();
        let left = rig.get::<Twist>("twist").unwrap().0[0];
        assert!((0.019..0.02).contains(&left), "{left}");
        assert_eq!(rig.get::<Scalar>("bumpless"), Some(&0.0), "the whole output is offset");
        for _ in 0..50 {
            rig.step();
        }
        assert_eq!(rig.freshness("twist"), Freshness::Absent);
    }

    #[test]
    fn a_motion_that_ends_slows_down_from_the_limited_speed() {
        let params = format!("{ACCELERATIONS}\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8");
        let mut rig = NodeRig::new::<Bumpless>(&params, &[("twist", TwistShape.into())]).unwrap();
        for _ in 0..200 {
            rig.set("twist", along_x(9.0));
            rig.step();
        }
        assert!((rig.get::<Twist>("twist").unwrap().0[0] - 0.05).abs() < 1e-12);
        rig.lose("twist");
        // 0.05 m/s at half of 1 m/s² take 100 ms.
        (0..101).for_each(|_| rig.step());
        assert_eq!(rig.get::<Twist>("twist"), None);
    }

    #[test]
    fn a_smooth_motion_passes_without_lag() {
        let mut rig = rig();
        for i in 0..100 {
            // At most 0.4 m/s².
            let twist = along_x(1e-3 * libm::sin(0.4 * f64::from(i)));
            rig.set("twist", twist);
            rig.step();
            assert!(i == 0 || rig.get::<Twist>("twist") == Some(&twist), "{i}");
        }
    }

    proptest! {
        #[test]
        fn the_output_never_jumps_and_always_reaches_the_input(
            inputs in prop::collection::vec(prop::option::of(prop::array::uniform6(-2.0..2.0f64)), 1..40),
            ms in prop::collection::vec(0.1..30.0f64, 40),
        ) {
            let (mut rig, mut last, mut dt) = (rig(), Twist::default(), 0.0);
            for (input, ms) in inputs.iter().zip(&ms) {
                match input {
                    Some(twist) => rig.set("twist", Twist((*twist).into())),
                    None => rig.lose("twist"),
                }
                rig.step_ms(*ms);
                let now = rig.get::<Twist>("twist").copied().unwrap_or_default();
                let change = Twist(now.0 - last.0);
                prop_assert!(change.linear().norm() <= dt + 1e-12 && change.angular().norm() <= 10.0 * dt + 1e-12);
                (last, dt) = (now, ms * 1e-3);
            }
            let end = along_x(0.3);
            for _ in 0..20_000 {
                rig.set("twist", end);
                rig.step();
            }
            prop_assert_eq!(rig.get::<Twist>("twist"), Some(&end));
        }
    }
}
