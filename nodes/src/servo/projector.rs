//! `projector`: selects the components of a twist (paper eq. 3, the matrix P).
//!
//! P is diagonal with ones and zeros, so a component either passes unchanged or is exactly zero: P P = P.

use tactflow_runtime::node::{Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// Diagonal of P, `[vx, vy, vz, wx, wy, wz]`: 1 passes a component, 0 deletes it.
    select: [u64; 6],
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

impl Node for Projector {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const NAME: &'static str = "projector";
    const SUMMARY: &'static str = "selects the components of a twist";

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if params.select.iter().any(|entry| *entry > 1) {
            return Err(Mistake::param("select", "`select` is made of ones and zeros").into());
        }
        Ok(Self { passes: params.select.map(|entry| entry == 1) })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let twist = out.twist.write();
        for (i, passes) in self.passes.iter().enumerate() {
            twist.0[i] = if *passes { inputs.twist.0[i] } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Twist, TwistShape};

    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<Projector>(params, &[("twist", TwistShape.into())])
    }

    #[test]
    fn a_component_passes_or_is_zero() {
        let mut rig = rig("select = [1, 0, 1, 0, 0, 1]").unwrap();
        rig.set("twist", Twist([1.0, 2.0, 3.0, 4.0, 5.0, 6.0].into()));
        rig.step();
        assert_eq!(rig.get::<Twist>("twist"), Some(&Twist([1.0, 0.0, 3.0, 0.0, 0.0, 6.0].into())));
    }

    #[test]
    fn bad_diagonals() {
        for bad in ["select = [1, 0, 2, 0, 0, 1]", "select = [1, 1]", "select = 1", "", "select = [1, 1, 1, 1, 1, -1]"]
        {
            assert!(rig(bad).is_err(), "{bad}");
        }
    }
}
