//! `twist_adder`: the sum of twists, in the order of the wires, so every run gives the same bits.

use tactflow_runtime::node::{
    At, Components, Describe, Inputs, Many, Mistake, Mistakes, Node, Out, Outputs, Setup, Tick,
};
use tactflow_runtime::signal::Twist;
use tactflow_runtime::source::Code;

/// Adds motions in the same frame, such as servoing and guidance.
///
/// The output is the sum of all twists that are wired, each under a name of your choice: the superposition of section
/// IV of the paper. All twists must be in the same frame. A wire in another frame is an error, and its message names
/// the `adjoint` to insert between them.
///
/// An absent twist counts as zero motion. The sum is absent when all twists are absent, and it is as old as the oldest
/// twist in it.
///
/// ```toml
/// [nodes.sum]
/// type = "twist_adder"
/// in.touch = "projector.twist"
/// in.guide = "guide.twist"
/// ```
#[derive(Describe)]
pub struct TwistAdder;

/// What `twist_adder` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The twists to add.
    #[port(frame = "A")]
    twist: Many<'a, Twist>,
}

/// What `twist_adder` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Sum of the twists that are present.
    #[port(frame = "A")]
    twist: Out<Twist>,
}

impl Node for TwistAdder {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if setup.inputs.twist.is_empty() {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no twist is wired");
            return Err(mistake.help("wire each under a name of your choice: `in.servo = \"projector.twist\"`").into());
        }
        Ok(Self)
    }

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
    fn the_sum_is_over_the_twists_that_are_present() {
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
    fn the_order_of_summation_is_the_order_of_the_wires() {
        let mut rig = rig(&["z", "m", "a"]).unwrap();
        let (z, m, a) = (1e16, 1.0, -1e16);
        for (name, speed) in [("a", a), ("m", m), ("z", z)] {
            rig.set(name, along_x(speed));
        }
        rig.step();
        assert_eq!(rig.get::<Twist>("twist").unwrap().0[0], (z + m) + a);
        assert_ne!((z + m) + a, (z + a) + m, "the two orders differ in this case");
    }

    #[test]
    fn the_sum_is_as_old_as_the_oldest_twist_and_generated_motion_has_no_age() {
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
    fn no_wired_twist_is_a_mistake() {
        let mistakes = rig(&[]).err().unwrap();
        assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
    }
}
