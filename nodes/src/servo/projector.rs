//! `projector`: selects the components of a twist (paper eq. 3, the matrix P).
//!
//! P is diagonal with ones and zeros, so a component either passes unchanged or is exactly zero: P P = P.

use tactflow_runtime::node::{Bit, Components, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// Diagonal of P, `[vx, vy, vz, wx, wy, wz]`: 1 passes a component, 0 deletes it [1].
    live select: [Bit; 6],
}

inputs! {
    /// Any twist [m/s, rad/s].
    twist: Twist["A"],
}

outputs! {
    /// The selected components [m/s, rad/s].
    twist: Twist["A"],
}

/// The projector's diagonal.
pub struct Projector {
    passes: [bool; 6],
}

impl tactflow_runtime::node::Describe for Projector {
    const NAME: &'static str = "projector";
    const SUMMARY: &'static str = "selects which components of a motion are used, and so what a task controls";
    const DOC: &'static str = "The matrix P of the paper's eq. 3: a diagonal of ones and zeros over `[vx, vy, vz, \
        wx, wy, wz]`. What is 1 passes unchanged, what is 0 is exactly zero.\n\n\
        A task is mostly its P: `[1, 1, 0, 0, 0, 0]` holds the contact's place, `[0, 0, 1, 0, 0, 0]` its pressure, \
        fourth and fifth entry let the pad roll, and the last one follows the direction of an edge.\n\n\
        A component that is deleted here is free for guidance, which a `twist_adder` adds behind it. Along a line \
        that is longer than the pad the centre of gravity measures nothing: set that entry of P to 0.\n\n\
        A feature of which nothing passes is frozen in `pid`: it gathers nothing, and starts afresh in a mode that \
        selects it again.";
    const EXAMPLE: &'static str = r#"
[nodes.projector]
type = "projector"
in.twist = "jacobian.twist"
select = [1, 1, 1, 0, 0, 0]         # place and pressure, no rolling
"#;
}

impl Node for Projector {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { passes: params.select.map(|entry| *entry == 1) })
    }

    fn state(&self) {}

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        vec![Components::of(6, |i| self.passes[i] && wanted[0].has(i))]
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let twist = out.twist.write();
        for (i, passes) in self.passes.iter().enumerate() {
            twist.0[i] = if *passes { inputs.twist.0[i] } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::array::uniform6;
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Twist, TwistShape};
    use tactflow_runtime::source::Code;

    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<Projector>(params, &[("twist", TwistShape.into())])
    }

    #[test]
    fn what_it_deletes_it_does_not_use() {
        let passes = [true, false, true, false, false, true];
        let projector = Projector { passes };
        assert_eq!(projector.uses(&[Components::ALL]), [Components::of(6, |i| passes[i])]);
        assert_eq!(projector.uses(&[Components::of(6, |i| i < 2)]), [Components::of(6, |i| i == 0)]);
    }

    #[test]
    fn a_component_passes_or_is_zero() {
        let mut rig = rig("select = [1, 0, 1, 0, 0, 1]").unwrap();
        rig.set("twist", Twist([1.0, 2.0, 3.0, 4.0, 5.0, 6.0].into()));
        rig.step();
        assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([1.0, 0.0, 3.0, 0.0, 0.0, 6.0].into())));
    }

    proptest! {
        #[test]
        fn to_project_twice_is_to_project_once(select in uniform6(0..=1_u8), twist in uniform6(-9.0..9.0)) {
            let select = format!("select = {select:?}");
            let (mut first, mut second) = (rig(&select).unwrap(), rig(&select).unwrap());
            first.set("twist", Twist(twist.into()));
            first.step();
            let once = *first.get::<Twist>("twist").unwrap();
            second.set("twist", once);
            second.step();
            prop_assert_eq!(second.get::<Twist>("twist"), Some(&once));
        }
    }

    #[test]
    fn a_deleted_component_is_zero_whatever_it_was() {
        let mut rig = rig("select = [1, 0, 0, 0, 0, 0]").unwrap();
        rig.set("twist", Twist([1.0, -2.0, f64::MAX, f64::INFINITY, f64::NAN, -0.0].into()));
        rig.step();
        let bits = rig.get::<Twist>("twist").unwrap().0.map(f64::to_bits);
        assert_eq!(bits, Twist([1.0, 0.0, 0.0, 0.0, 0.0, 0.0].into()).0.map(f64::to_bits));
    }

    #[test]
    fn bad_diagonals() {
        let cases = [
            ("select = [1, 0, 2, 0, 0, 1]", Code::BadValue),
            ("select = [1, 1]", Code::BadValue),
            ("select = 1", Code::BadValue),
            ("select = [1, 1, 1, 1, 1, -1]", Code::BadValue),
            ("select = [1, 1, 1, 1, 1, 0.5]", Code::BadValue),
            ("", Code::MissingKey),
        ];
        for (bad, code) in cases {
            let mistakes = rig(bad).err().unwrap();
            assert_eq!((mistakes.len(), mistakes[0].code), (1, code), "{bad}");
        }
    }
}
