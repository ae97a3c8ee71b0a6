//! `twist_source`: a constant twist. Without a gate it has no time, so the `max_age_ms` of a sink never stops it.

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Mistake, Mistakes, Motion, Node, Out, Outputs, Param, Setup, Tick,
};
use tactflow_runtime::signal::{Flag, Twist, Unit};
use tactflow_runtime::source::Code;

use crate::usual::{USUAL_M_PER_S, USUAL_RAD_PER_S, from_smaller_unit};

/// A constant motion, to approach an object or to guide along it.
///
/// It writes the same twist in every tick: the external motion V_ext of Fig. 6 of the paper, which a `twist_adder` adds
/// to the servoing. Use it to approach along +z, to slide along an edge, or to roll.
///
/// Wire `in.gate`: the motion then continues only while that flag is present and set, and is as old as the flag. It
/// ends with the contact, and when the pad stops sending images. Without a gate the motion never ends by itself, so a
/// mode in which it moves the arm must have a condition that ends it. Set the twist to zeros in modes that do not need
/// it.
///
/// The twist is in the frame of the input that it is wired to, usually the frame of the sensor. Guidance along a
/// component that the projector controls works against the controller: set that entry of P to 0.
///
/// ```toml
/// [nodes.guide]                       # about the pad's z, while there is a contact
/// type = "twist_source"
/// in.gate = "label.present"
/// twist = [0, 0, 0, 0, 0, 0.1]        # [m/s, rad/s]
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct TwistSource {
    twist: Twist,
    is_still: bool,
    is_gated: bool,
}

/// Parameters of `twist_source`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The twist, `[vx, vy, vz, wx, wy, wz]`. With zeros alone the output is absent.
    #[param(unit = "m/s, rad/s", live)]
    twist: [f64; 6],
    /// Frame of the twist. Without it, the frame follows from the wires.
    frame: Option<String>,
}

/// What `twist_source` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The motion continues while this is present and set. Without this wire it always continues.
    #[port(optional)]
    gate: Option<In<'a, Flag>>,
}

/// What `twist_source` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The twist.
    #[port(frame = "$frame")]
    twist: Out<Twist>,
}

impl Node for TwistSource {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (twist, is_gated) = (Twist(params.twist.into()), setup.inputs.gate.is_some());
        setup.motion = motion(&twist, params.frame.as_deref());
        setup.warnings.extend(unusual(&twist));
        Ok(Self { twist, is_still: setup.motion == Motion::Still, is_gated })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        if !self.is_still && (!self.is_gated || inputs.gate.is_some_and(|gate| *gate)) {
            out.twist.set(self.twist);
        }
    }
}

/// Returns the motion of a twist. In the frame of a sensor, z points out of it toward the object.
fn motion(twist: &Twist, frame: Option<&str>) -> Motion {
    let linear = twist.linear();
    let is_of_base = frame.is_some_and(|frame| frame.rsplit('.').next() == Some("base"));
    match twist.0 == Twist::default().0 {
        true => Motion::Still,
        false if !is_of_base && -linear.z > 0.5 * linear.norm() => Motion::Retreat,
        false => Motion::Any,
    }
}

/// Returns the warning about a motion that is far beyond what an arm can do.
fn unusual(twist: &Twist) -> Option<Mistake> {
    let (linear, angular) = (twist.linear().amax() > USUAL_M_PER_S, twist.angular().amax() > USUAL_RAD_PER_S);
    let (speed, max, unit, other) = match (linear, angular) {
        (false, false) => return None,
        (true, _) => (twist.linear().amax(), USUAL_M_PER_S, "m/s", "mm/s"),
        (false, true) => (twist.angular().amax(), USUAL_RAD_PER_S, "rad/s", "deg/s"),
    };
    let message = format!("`twist` has {speed} {unit}, but usual is at most {max} {unit}");
    let part = |is_small: bool, unit: Unit| {
        move |number: f64| match is_small {
            true => from_smaller_unit(number, unit).map_or(number, |(number, _)| number),
            false => number,
        }
    };
    let (v, w) = (twist.linear().map(part(linear, Unit::METRE)), twist.angular().map(part(angular, Unit::RADIAN)));
    let help = format!("if it is in {other}, write `[{}, {}, {}, {}, {}, {}]`", v.x, v.y, v.z, w.x, w.y, w.z);
    Some(Mistake::new(Code::UnusualValue, At::Param("twist".into()), message).help(help))
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{FlagShape, Freshness, Stamp};

    use super::*;

    const GUIDE: &str = "twist = [0, 0.02, 0, 0, 0, 0.1]\nframe = \"pad\"";

    #[test]
    fn without_a_gate_the_twist_is_new_and_timeless_in_every_tick() {
        let mut rig = NodeRig::new::<TwistSource>(GUIDE, &[]).unwrap();
        for _ in 0..3 {
            rig.step();
            assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([0.0, 0.02, 0.0, 0.0, 0.0, 0.1].into())));
            assert_eq!(rig.freshness("twist"), Freshness::New);
            assert!(rig.mark("twist").stamp().is_timeless());
        }
    }

    #[test]
    fn with_a_gate_the_twist_is_present_only_while_it_is_set_and_is_as_old() {
        let mut rig = NodeRig::new::<TwistSource>(GUIDE, &[("gate", FlagShape.into())]).unwrap();
        let cases: [(&str, Option<bool>, Freshness); 7] = [
            ("never there", None, Freshness::Absent),
            ("shut", Some(false), Freshness::Absent),
            ("set", Some(true), Freshness::New),
            ("still set", Some(true), Freshness::New),
            ("shut again", Some(false), Freshness::Lost),
            ("set again", Some(true), Freshness::New),
            ("gone", None, Freshness::Lost),
        ];
        for (what, gate, expected) in cases {
            let now = Stamp { nanos: rig.tick.now, device: 0 };
            match gate {
                Some(gate) => rig.set("gate", gate),
                None => rig.lose("gate"),
            }
            rig.step();
            assert_eq!(rig.freshness("twist"), expected, "{what}");
            if expected == Freshness::New {
                assert_eq!(rig.mark("twist").stamp(), now, "{what}");
            }
        }
    }

    #[test]
    fn a_held_gate_keeps_the_twist_and_its_age_grows() {
        let mut rig = NodeRig::new::<TwistSource>(GUIDE, &[("gate", FlagShape.into())]).unwrap();
        rig.set("gate", true);
        for _ in 0..3 {
            rig.step();
            assert_eq!((rig.freshness("twist"), rig.mark("twist").stamp().nanos), (Freshness::New, 0));
        }
    }

    #[test]
    fn a_bad_twist_is_a_mistake() {
        for (bad, place) in [
            ("", "missing-key: `the node`"),
            ("twist = [0, 0, 0]", "bad-value: `[0, 0, 0]`"),
            ("twist = [0, 0, 0, 0, 0, inf]", "bad-value: `inf`"),
            ("twist = 1", "bad-value: `1`"),
            ("twist = [0,0,0,0,0,0]\nframe = 1", "bad-value: `1`"),
        ] {
            assert_eq!(places(bad, &NodeRig::new::<TwistSource>(bad, &[])), [place], "{bad}");
        }
    }

    #[test]
    fn a_motion_away_from_the_object_is_told_apart() {
        let cases = [
            ([0.0; 6], None, Motion::Still),
            ([0.0, 0.0, 0.015, 0.0, 0.0, 0.0], None, Motion::Any),
            ([0.0, 0.0, -0.015, 0.0, 0.0, 0.0], None, Motion::Retreat),
            ([0.0, 0.0, -0.015, 0.0, 0.0, 0.0], Some("pad"), Motion::Retreat),
            ([0.0, 0.0, -0.015, 0.0, 0.0, 0.0], Some("base"), Motion::Any),
            ([0.0, 0.0, -0.015, 0.0, 0.0, 0.0], Some("arm2.base"), Motion::Any),
            ([0.01, 0.0, -0.002, 0.0, 0.0, 0.0], None, Motion::Any),
            ([0.0, 0.0, 0.0, 0.0, 0.0, 0.1], None, Motion::Any),
        ];
        for (twist, frame, expected) in cases {
            assert_eq!(motion(&Twist(twist.into()), frame), expected, "{twist:?} in {frame:?}");
        }
    }

    #[test]
    fn a_motion_in_another_unit_is_warned_of() {
        let warnings = |twist: &str| {
            let params = format!("twist = {twist}");
            places(&params, &NodeRig::new::<TwistSource>(&params, &[]))
        };
        for twist in ["[0, 0, 15, 0, 0, 0]", "[0, 0, 0.015, 0, 0, 20]"] {
            assert_eq!(warnings(twist), ["unusual-value: `twist`"], "{twist}");
        }
        assert!(warnings("[0.1, 0, 0.05, 0, 0, -1]").is_empty());
    }
}
