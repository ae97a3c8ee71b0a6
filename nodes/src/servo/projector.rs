//! `projector`: a diagonal of ones and zeros. A component either passes unchanged or is exactly zero: P P = P.

use tactflow_runtime::node::{Components, Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::Twist;

/// Selects the components of a motion that a task controls.
///
/// The matrix P of eq. 3 of the paper: a diagonal of ones and zeros over `[vx, vy, vz, wx, wy, wz]`. A component whose
/// entry is 1 passes unchanged; a component whose entry is 0 becomes exactly zero.
///
/// P mostly defines the task: `[1, 1, 0, 0, 0, 0]` holds the place of the contact and `[0, 0, 1, 0, 0, 0]` its
/// pressure. The fourth and the fifth entry let the pad roll, and the last one follows the direction of an edge.
///
/// A component that is deleted here is free for guidance, which a `twist_adder` adds behind the projector. Along a line
/// that is longer than the pad, the centre of gravity carries no information: set that entry of P to 0.
///
/// If nothing of a feature passes, `pid` freezes that feature: its integral stays at zero, and it starts afresh in a
/// mode that selects it.
///
/// ```toml
/// [nodes.projector]
/// type = "projector"
/// in.twist = "jacobian.twist"
/// select = [1, 1, 1, 0, 0, 0]         # place and pressure, no rolling
/// ```
#[derive(Describe)]
pub struct Projector {
    passes: [bool; 6],
}

/// Parameters of `projector`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Diagonal of P, `[vx, vy, vz, wx, wy, wz]`: 1 passes a component, 0 deletes it.
    #[param(unit = "1", range = 0..=1, live)]
    select: [u64; 6],
}

/// What `projector` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Any twist.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
}

/// What `projector` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The selected components.
    #[port(frame = "A")]
    twist: Out<Twist>,
}

impl Node for Projector {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { passes: params.select.map(|entry| entry == 1) })
    }

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
    fn a_deleted_component_is_not_used() {
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
        fn projecting_twice_equals_projecting_once(select in uniform6(0..=1_u8), twist in uniform6(-9.0..9.0)) {
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
    fn a_deleted_component_is_zero_for_any_input() {
        let mut rig = rig("select = [1, 0, 0, 0, 0, 0]").unwrap();
        rig.set("twist", Twist([1.0, -2.0, f64::MAX, f64::INFINITY, f64::NAN, -0.0].into()));
        rig.step();
        let bits = rig.get::<Twist>("twist").unwrap().0.map(f64::to_bits);
        assert_eq!(bits, Twist([1.0, 0.0, 0.0, 0.0, 0.0, 0.0].into()).0.map(f64::to_bits));
    }

    #[test]
    fn a_bad_diagonal_is_a_mistake() {
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
