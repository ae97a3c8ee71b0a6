//! `twist_adder`: superimposes twists of one frame (paper section IV: the servoing and the external motion).
//!
//! An absent twist is zero motion; the sum is absent when all are. It is taken in the order of the wires, and is as old
//! as the oldest twist in it.

use tactflow_runtime::node::{At, Components, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params};

params! {}

inputs! {
    /// What is added [m/s, rad/s].
    twist: Many<Twist["A"]>,
}

outputs! {
    /// Sum of the twists that are there [m/s, rad/s].
    twist: Twist["A"],
}

/// A sum has nothing to set.
pub struct TwistAdder;

impl tactflow_runtime::node::Describe for TwistAdder {
    const NAME: &'static str = "twist_adder";
    const SUMMARY: &'static str = "adds motions of one frame, such as servoing and guidance";
    const DOC: &'static str = "The sum of all twists that are wired, each under a name of your choice: the \
        superposition of the paper's section IV. All are in one frame; a wire in another frame does not load, and \
        the message says which `adjoint` to put between.\n\n\
        An absent twist is zero motion, and the sum is absent when all are. It is taken in the order of the wires, \
        so it is the same to the last bit in every run, and it is as old as the oldest twist in it.";
    const EXAMPLE: &'static str = r#"
[nodes.sum]
type = "twist_adder"
in.touch = "projector.twist"
in.guide = "guide.twist"
"#;
}

impl Node for TwistAdder {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if setup.inputs.twist.is_empty() {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no twist is wired");
            return Err(mistake.help("wire each under a name of your choice: `in.servo = \"projector.twist\"`").into());
        }
        Ok(Self)
    }

    fn state(&self) {}

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        wanted.into()
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let mut twists = inputs.twist.iter().flatten();
        if let Some(first) = twists.next() {
            let sum = out.twist.write();
            *sum = *first;
            for twist in twists {
                sum.0 += twist.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, Shape, Stamp, Twist, TwistShape};

    use super::*;

    fn rig(names: &[&str]) -> Result<NodeRig, Mistakes> {
        let wires: Vec<(&str, Shape)> = names.iter().map(|name| (*name, TwistShape.into())).collect();
        NodeRig::new::<TwistAdder>("", &wires)
    }

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 2.0 * speed].into())
    }

    #[test]
    fn the_sum_is_over_what_is_there() {
        let cases: [([Option<f64>; 3], Option<f64>); 6] = [
            ([None, None, None], None),
            ([Some(1.0), None, None], Some(1.0)),
            ([Some(1.0), Some(2.0), Some(4.0)], Some(7.0)),
            ([None, Some(2.0), Some(4.0)], Some(6.0)),
            ([None, None, Some(4.0)], Some(4.0)),
            ([None, None, None], None),
        ];
        let mut rig = rig(&["servo", "guide", "weave"]).unwrap();
        for (speeds, sum) in cases {
            for (name, speed) in ["servo", "guide", "weave"].into_iter().zip(speeds) {
                match speed {
                    Some(speed) => rig.set(name, along_x(speed)),
                    None => rig.lose(name),
                }
            }
            rig.step();
            assert_eq!(rig.get::<Twist>("twist").copied(), sum.map(along_x), "{speeds:?}");
        }
    }

    #[test]
    fn it_adds_in_the_order_of_the_wires() {
        let mut rig = rig(&["z", "m", "a"]).unwrap();
        let (z, m, a) = (1e16, 1.0, -1e16);
        for (name, speed) in [("a", a), ("m", m), ("z", z)] {
            rig.set(name, along_x(speed));
        }
        rig.step();
        assert_eq!(rig.get::<Twist>("twist").unwrap().0[0], (z + m) + a);
        assert_ne!((z + m) + a, (z + a) + m, "the case tells two orders apart");
    }

    #[test]
    fn it_is_as_old_as_the_oldest_and_generated_motion_is_of_no_age() {
        let mut rig = rig(&["servo", "guide"]).unwrap();
        rig.edit("guide", Stamp::TIMELESS, |twist: &mut Twist| *twist = along_x(1.0));
        rig.step();
        assert!(rig.mark("twist").stamp().is_timeless());
        rig.set("servo", along_x(1.0));
        rig.step();
        assert_eq!(rig.mark("twist").stamp().nanos, 1_000_000);
        rig.step();
        assert_eq!(rig.freshness("twist"), Freshness::Held);
    }

    #[test]
    fn nothing_to_add_is_a_mistake() {
        let mistakes = rig(&[]).err().unwrap();
        assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
    }
}
