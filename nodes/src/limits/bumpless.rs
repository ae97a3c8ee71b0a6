//! `bumpless`: takes up the jumps of a motion before any limiter: bumpless transfer.
//!
//! out = in + offset. What the input changes from one tick to the next is passed on as far as half of the accelerations
//! allows; the rest goes into the offset with the opposite sign, and the offset fades along a straight line at the other
//! half. So the output never changes by more than the accelerations allow, whatever the input does, and it is the input,
//! to the last bit and without lag, as soon as the offset is gone. Each change keeps its direction: one factor for all
//! six components.

use tactflow_runtime::node::{Limits, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::signal::{ScalarShape, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::bounds::{countable, scale_twist, twist_ratio};

params! {
    /// Greatest change of the linear velocity [m/s²].
    linear_m_per_s2: Positive,
    /// Greatest change of the angular velocity [rad/s²].
    angular_rad_per_s2: Positive,
    /// What is wanted faster than this counts as so fast: otherwise a motion that ends has to come down from a speed that
    /// nobody ever went; none unless given [m/s].
    linear_m_per_s: Option<Positive>,
    /// The same for the rotation [rad/s].
    angular_rad_per_s: Option<Positive>,
}

inputs! {
    /// The motion that is wanted; absent is none [m/s, rad/s].
    twist: Trigger<Twist["A"]>,
}

outputs! {
    /// The same without jumps [m/s, rad/s].
    twist: Twist["A"],
    /// How much of what is wanted is in the output, beside what is left of a jump [1].
    bumpless: Scalar["1"],
}

state! {
    /// The input of the last tick [m/s, rad/s].
    last: Twist,
    /// What is left of the jumps [m/s, rad/s].
    offset: Twist,
}

/// The accelerations and the speeds.
pub struct Bumpless {
    linear: f64,
    angular: f64,
    speeds: [f64; 2],
}

impl tactflow_runtime::node::Describe for Bumpless {
    const NAME: &'static str = "bumpless";
    const SUMMARY: &'static str = "takes up every jump of a motion: a switch of mode, a contact found or lost";
    const DOC: &'static str = "Bumpless transfer. A mode that begins, a contact that is found and one that is lost make \
        the wanted motion jump. What a change exceeds half of the accelerations by becomes an offset, which fades at \
        the other half; so the output is smooth before any limiter sees it, and it is exactly the input, without lag, \
        as soon as the offset is gone.\n\n\
        What is wanted faster than `linear_m_per_s` and `angular_rad_per_s` counts as so fast, in the same direction: a \
        controller may want a hundred times what the arm may do, and when its contact is lost the motion would have \
        to come down from there. Give it the speeds of the `twist_limit` behind it.\n\n\
        An absent motion is none: the output goes on until it has come to rest, and is absent then. It stands behind \
        the sum of all motions and before the limiters, which it knows nothing of.";
    const EXAMPLE: &'static str = r#"
[nodes.bumpless]
type = "bumpless"
in.twist = "sum.twist"
linear_m_per_s2 = 1.0
angular_rad_per_s2 = 10.0
"#;
    const EVERY_TICK: bool = true;
}

impl Node for Bumpless {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits {
        through: Some("twist"),
        holds: &["bumpless"],
        breaks: &["force", "peak", "workspace", "speed", "acceleration"],
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if setup.inputs.twist.is_none() {
            return Err(crate::unwired(
                <Self as tactflow_runtime::node::Describe>::NAME,
                "twist",
                "a twist",
                "sum.twist",
            )
            .into());
        }
        setup.outputs.bumpless = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        let speeds = [params.linear_m_per_s, params.angular_rad_per_s].map(|speed| speed.map_or(f64::INFINITY, |s| *s));
        Ok(Self { linear: *params.linear_m_per_s2, angular: *params.angular_rad_per_s2, speeds })
    }

    fn state(&self) -> State {
        State { last: Twist::default(), offset: Twist::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let dt = tick.dt.min(tick.max_gap);
        let (linear, angular) = (0.5 * self.linear * dt, 0.5 * self.angular * dt);
        // What the runtime holds at zero starts from zero when it may go on.
        let twist = inputs.twist.filter(|_| !tick.is_halted);
        let mut wanted = twist.map_or_else(Twist::default, |twist| countable(&twist));
        let pace = scale_twist(&wanted, self.speeds[0], self.speeds[1]);
        wanted.0 *= pace;
        let smooth = smooth(&wanted, &mut state.last, &mut state.offset, [linear, angular]);
        if twist.is_none() && state.offset == Twist::default() {
            return;
        }
        out.twist.set(smooth);
        let (own, left) =
            (twist_ratio(&wanted, self.linear, self.angular), twist_ratio(&state.offset, self.linear, self.angular));
        out.bumpless.set(pace * if left > 0.0 { own / (own + left) } else { 1.0 });
    }
}

/// The motion without its jump, given the motion and the offset of the last tick, which change by at most `half` [m/s,
/// rad/s] each.
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
    fn a_jump_fades_and_then_the_output_is_the_input() {
        let mut rig = rig();
        let mut steps = 0;
        // Half of 1 m/s² passes at once, the other half fades: 0.02 m/s take 20 ticks of 1 ms.
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
        assert_eq!(rig.get::<Scalar>("bumpless"), Some(&0.0), "nothing of that is wanted any more");
        for _ in 0..50 {
            rig.step();
        }
        assert_eq!(rig.freshness("twist"), Freshness::Absent);
    }

    #[test]
    fn a_motion_that_ends_comes_down_from_the_speed_that_was_gone() {
        let params = format!("{ACCELERATIONS}\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8");
        let mut rig = NodeRig::new::<Bumpless>(&params, &[("twist", TwistShape.into())]).unwrap();
        for _ in 0..200 {
            rig.set("twist", along_x(9.0));
            rig.step();
        }
        assert!((rig.get::<Twist>("twist").unwrap().0[0] - 0.05).abs() < 1e-12);
        rig.lose("twist");
        // 0.05 m/s at half of 1 m/s² are 100 ms.
        (0..101).for_each(|_| rig.step());
        assert_eq!(rig.get::<Twist>("twist"), None);
    }

    #[test]
    fn what_is_smooth_passes_without_lag() {
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
        fn it_never_jumps_and_always_arrives(
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
