//! `twist_source`: a constant twist, for guidance: the external motion that is superimposed on the servoing (paper Fig. 6).
//!
//! Generated motion does not vanish with the contact by itself. It is timeless, so no sink's `max_age_ms` ever stops
//! it, unless a gate is wired: then it is as old as the gate, and absent unless the gate is there and set.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::Twist;
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// The twist, `[vx, vy, vz, wx, wy, wz]`; with zeros alone there is none [m/s, rad/s].
    live twist: [f64; 6],
    /// Frame of the twist; what it is wired to decides when this is not said.
    frame: Option<String>,
}

inputs! {
    /// What must be set for the motion to go on; without this wire it always does.
    gate: Trigger<Flag>,
}

outputs! {
    /// The twist [m/s, rad/s].
    twist: Twist["$frame"],
}

/// The twist, and whether it waits for a gate.
pub struct TwistSource {
    twist: Twist,
    is_still: bool,
    is_gated: bool,
}

impl tactflow_runtime::node::Describe for TwistSource {
    const NAME: &'static str = "twist_source";
    const SUMMARY: &'static str = "a constant motion, to approach an object or to guide along it";
    const DOC: &'static str = "Gives one twist in every tick: the external motion V_ext of the paper's Fig. 6, \
        which a `twist_adder` superimposes on the servoing. Take it to approach along +z, to slide along an edge, \
        or to roll.\n\n\
        Wire `in.gate`: the motion goes on only while that flag is there and set, and is as old as the flag, so it \
        ends with the contact and when the pad falls silent. Without a gate it never ends by itself: a mode in which \
        it moves the arm has to say what ends it. A twist of zeros is no motion, for the modes it has no part in.\n\n\
        The twist is in the frame that it is wired to, mostly the sensor's. Guidance along a component that the \
        projector controls works against the controller: delete that entry of P.";
    const EXAMPLE: &'static str = r#"
[nodes.guide]                       # along the pad's y, while there is a contact
type = "twist_source"
in.gate = "label.present"
twist = [0, 0.01, 0, 0, 0, 0]       # [m/s, rad/s]
"#;
    const EVERY_TICK: bool = true;
}

impl Node for TwistSource {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.is_still = params.twist == [0.0; 6];
        let (is_still, is_gated) = (setup.is_still, setup.inputs.gate.is_some());
        Ok(Self { twist: Twist(params.twist.into()), is_still, is_gated })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        if self.is_still {
            return;
        }
        if !self.is_gated || inputs.gate.is_some_and(|gate| *gate) {
            out.twist.set(self.twist);
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{FlagShape, Freshness, Stamp};

    use super::*;

    const GUIDE: &str = "twist = [0, 0.02, 0, 0, 0, 0.1]\nframe = \"pad\"";

    #[test]
    fn without_a_gate_it_is_new_and_timeless_in_every_tick() {
        let mut rig = NodeRig::new::<TwistSource>(GUIDE, &[]).unwrap();
        for _ in 0..3 {
            rig.step();
            assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([0.0, 0.02, 0.0, 0.0, 0.0, 0.1].into())));
            assert_eq!(rig.freshness("twist"), Freshness::New);
            assert!(rig.mark("twist").stamp().is_timeless());
        }
    }

    #[test]
    fn with_a_gate_it_moves_only_while_that_is_set_and_is_as_old() {
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
    fn a_held_gate_keeps_the_motion_but_lets_it_grow_old() {
        let mut rig = NodeRig::new::<TwistSource>(GUIDE, &[("gate", FlagShape.into())]).unwrap();
        rig.set("gate", true);
        for _ in 0..3 {
            rig.step();
            assert_eq!((rig.freshness("twist"), rig.mark("twist").stamp().nanos), (Freshness::New, 0));
        }
    }

    #[test]
    fn bad_twists() {
        for bad in
            ["", "twist = [0, 0, 0]", "twist = [0, 0, 0, 0, 0, inf]", "twist = 1", "twist = [0,0,0,0,0,0]\nframe = 1"]
        {
            assert!(NodeRig::new::<TwistSource>(bad, &[]).is_err(), "{bad}");
        }
    }
}
