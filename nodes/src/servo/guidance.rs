//! `guidance`: the velocity that somebody wants, scaled down as a whole: v = s w, with the largest s up to 1 for which the
//! linear part of v is within `linear_m_per_s` and its angular part within `angular_rad_per_s`.

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Features, Flag, Scalar, ScalarShape, Twist, Unit};

use crate::motion::COMPONENTS;
use crate::motion::bounds::{countable, scale_twist};
use crate::usual::{USUAL_M_PER_S, USUAL_RAD_PER_S};

/// Lets a person or a planner guide the sensor, within a speed.
///
/// It makes a twist of the velocity of a `motion_guide`: the external motion V_ext of Fig. 6 of the paper. A velocity that
/// is too fast is scaled down as a whole, so its direction stays. Choose the components that may be guided with a
/// `projector` behind it: those that the controller does not need.
///
/// When the velocity is older than `max_age_ms`, because the guide is silent, or when a component is missing, the output is
/// absent, and `bumpless` brings the motion to zero smoothly. Let the policy of the role count, so that the task goes on
/// without a guide: `roles.joystick = { stale = "count" }`.
///
/// With `in.gate`, the sensor is guided only while that flag is present and set. Without it, only the `blind_limit` bounds
/// the motion through the air.
///
/// ```toml
/// [nodes.guidance]
/// type = "guidance"
/// in.velocity = "joystick.velocity"
/// in.gate = "label.present"
/// linear_m_per_s = 0.02
/// angular_rad_per_s = 0.2
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct Guidance {
    /// Greatest linear and angular speed [m/s, rad/s].
    speeds: [f64; 2],
    /// Greatest age of the velocity [ns].
    max_age: i64,
    is_gated: bool,
}

/// Parameters of `guidance`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Greatest linear speed.
    #[param(unit = "m/s", range = 0.0.., usual = ..=USUAL_M_PER_S)]
    linear_m_per_s: f64,
    /// Greatest angular speed.
    #[param(unit = "rad/s", range = 0.0.., usual = ..=USUAL_RAD_PER_S)]
    angular_rad_per_s: f64,
    /// Greatest age of the velocity.
    #[param(unit = "ms", range = 1.0..=10_000.0, default = 200.0)]
    max_age_ms: f64,
    /// Frame of the velocity. Without it, the frame follows from the wires.
    frame: Option<String>,
}

/// What `guidance` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The wanted velocity.
    #[port(unit = "_", frame = "_", quantity = "guidance")]
    velocity: In<'a, Features>,
    /// The sensor is guided while this is present and set. Without this wire it always is.
    #[port(optional)]
    gate: Option<In<'a, Flag>>,
}

/// What `guidance` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion.
    #[port(frame = "$frame")]
    twist: Out<Twist>,
    /// Fraction of the wanted velocity in it.
    #[port(unit = "1", frame = "_")]
    share: Out<Scalar>,
}

impl Node for Guidance {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if !setup.inputs.velocity.names().eq(COMPONENTS) {
            let message = format!("a velocity has the features `{}`", COMPONENTS.join("`, `"));
            return Err(Mistake::input("velocity", message)
                .help("wire the port `velocity` of a `motion_guide`")
                .into());
        }
        setup.outputs.share = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        let speeds = [params.linear_m_per_s, params.angular_rad_per_s];
        let max_age = (params.max_age_ms * 1e6) as i64;
        Ok(Self { speeds, max_age, is_gated: setup.inputs.gate.is_some() })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_open = !self.is_gated || inputs.gate.is_some_and(|gate| *gate);
        let is_old = tick.now.saturating_sub(inputs.velocity.stamp().nanos) > self.max_age;
        let Some(wanted) = whole(&inputs.velocity).filter(|_| is_open && !is_old) else { return };
        let wanted = countable(&wanted);
        let share = scale_twist(&wanted, self.speeds[0], self.speeds[1]);
        out.twist.set(Twist(wanted.0 * share));
        out.share.set(share);
    }
}

/// Returns the velocity if none of its components is absent.
fn whole(velocity: &Features) -> Option<Twist> {
    let mut twist = Twist::default();
    let mut values = velocity.values();
    for component in twist.0.iter_mut() {
        *component = values.next()??;
    }
    Some(twist)
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{FeaturesShape, FlagShape, Freshness, Shape};

    use super::*;

    const SPEEDS: &str = "linear_m_per_s = 0.02\nangular_rad_per_s = 0.2";

    fn velocity() -> Shape {
        let [v, w] = [Unit::METRE.per_second(), Unit::RADIAN.per_second()];
        FeaturesShape::new(COMPONENTS.into_iter().zip([v, v, v, w, w, w])).into()
    }

    fn rig(gate: &[(&str, Shape)]) -> NodeRig {
        let wires = [&[("velocity", velocity())], gate].concat();
        NodeRig::new::<Guidance>(SPEEDS, &wires).unwrap()
    }

    fn set(rig: &mut NodeRig, values: &[Option<f64>; 6]) {
        let mut features = Features::absent(6);
        features.fill(values);
        rig.set("velocity", features);
    }

    #[test]
    fn a_velocity_is_scaled_as_a_whole() {
        let mut rig = rig(&[]);
        for (wanted, twist, share) in [
            ([0.01, 0.0, 0.0, 0.0, 0.0, 0.1], [0.01, 0.0, 0.0, 0.0, 0.0, 0.1], 1.0),
            ([0.03, 0.04, 0.0, 0.0, 0.0, 0.0], [0.012, 0.016, 0.0, 0.0, 0.0, 0.0], 0.4),
            ([0.01, 0.0, 0.0, 0.0, 0.4, 0.0], [0.005, 0.0, 0.0, 0.0, 0.2, 0.0], 0.5),
            ([0.0; 6], [0.0; 6], 1.0),
        ] {
            set(&mut rig, &wanted.map(Some));
            rig.step();
            let found = rig.get::<Twist>("twist").unwrap().0;
            assert!(found.iter().zip(twist).all(|(a, b)| (a - b).abs() < 1e-15), "{wanted:?}: {found:?}");
            assert!((rig.get::<f64>("share").unwrap() - share).abs() < 1e-12, "{wanted:?}");
        }
        // A joystick that is broken moves nothing fast.
        set(&mut rig, &[Some(1e308), Some(-1e308), None, None, None, None].map(|value| value.or(Some(0.0))));
        rig.step();
        assert!(rig.get::<Twist>("twist").unwrap().linear().norm() <= 0.02 * (1.0 + 1e-12));
    }

    #[test]
    fn without_a_guide_a_component_or_an_open_gate_there_is_no_motion() {
        let mut rig = rig(&[("gate", FlagShape.into())]);
        let moving = [0.01, 0.0, 0.0, 0.0, 0.0, 0.0].map(Some);
        for (what, wanted, gate, expected) in [
            ("nothing", None, None, Freshness::Absent),
            ("no gate", Some(moving), None, Freshness::Absent),
            ("shut", Some(moving), Some(false), Freshness::Absent),
            ("open", Some(moving), Some(true), Freshness::New),
            ("a component is missing", Some([None; 6].map(|_: Option<f64>| None)), Some(true), Freshness::Lost),
            ("whole again", Some(moving), Some(true), Freshness::New),
            ("shut again", Some(moving), Some(false), Freshness::Lost),
            ("open again", Some(moving), Some(true), Freshness::New),
            ("the guide is silent", None, Some(true), Freshness::Lost),
        ] {
            match &wanted {
                Some(wanted) => set(&mut rig, wanted),
                None => rig.lose("velocity"),
            }
            match gate {
                Some(gate) => rig.set("gate", gate),
                None => rig.lose("gate"),
            }
            rig.step();
            assert_eq!(rig.freshness("twist"), expected, "{what}");
        }
    }

    #[test]
    fn other_features_are_no_velocity() {
        let other: Shape = FeaturesShape::new([("x", Unit::METRE)]).into();
        let made = NodeRig::new::<Guidance>(SPEEDS, &[("velocity", other)]);
        assert_eq!(made.err().map(|mistakes| mistakes.len()), Some(1));
        let bad = "linear_m_per_s = -1\nangular_rad_per_s = 1";
        let made = NodeRig::new::<Guidance>(bad, &[("velocity", velocity())]);
        assert_eq!(places(bad, &made), ["bad-value: `-1`"]);
    }
}
