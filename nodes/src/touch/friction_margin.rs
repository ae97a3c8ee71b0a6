//! `friction_margin`: how near a contact is to slip.

use tactflow_runtime::node::{At, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::Scalar;
use tactflow_runtime::source::Code;

/// Measures how near a contact is to slip: 1 if nothing drags it, 0 at the limit of friction.
///
/// A contact of the normal force n slips when the object drags it with mu n, where mu is the coefficient of `friction`
/// (Coulomb). The load on the friction is l = sqrt(t² + (q / lever)²), with the tangential force t and, if `in.torque` and
/// `in.lever` of `shear` are wired, the torque q about the normal. This ellipsoid is exact for a push without a torque, and
/// for a torque without a push if the pressure is symmetric about its centre. Otherwise friction bears less of a torque than
/// mu n lever, and at least half of it (Howe and Cutkosky 1996, *Practical force-motion models for sliding manipulation*). Without both inputs, an object that turns on the pad is not seen.
///
/// - `margin` is 1 - l / (mu n). Below 0, the object drags with more than the stated friction can bear. It is absent if n is
///   below `margin_from`: noise would decide.
/// - `spare` is the normal force beyond the one that keeps the margin at `keep_margin`: n - max(l / (mu (1 - keep_margin)),
///   `least_force`). It is negative if the contact must be pressed harder. A force controller with `spare = 0` as its
///   setpoint holds an object without slip, and presses no harder than that. It is linear in n, and the margin is not.
///
/// **A slip is not detected.** While a contact slips, the friction that is really there bounds the drag. If `friction` is
/// stated too high, the margin then stays above 0, and the contact slips on: state the lowest friction that you have
/// measured. To measure it, pull with a constant normal force until the object slips, and divide the drag by that force.
///
/// All outputs are absent while an input is.
///
/// ```toml
/// [nodes.friction_margin]
/// type = "friction_margin"
/// in.fx = "shear.fx"
/// in.fy = "shear.fy"
/// in.force = "shear.force"
/// in.torque = "shear.torque"
/// in.lever = "shear.lever"
/// friction = 0.4                      # of the pad on the object
/// keep_margin = 0.3
/// least_force = 1.0                   # if nothing drags [N]
/// ```
#[derive(Describe)]
pub struct FrictionMargin {
    params: Params,
}

/// Parameters of `friction_margin`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Coefficient of friction of the pad on the object.
    #[param(unit = "1", above = 0.0, live)]
    friction: f64,
    /// Margin that `spare` keeps, from 0 to below 1.
    #[param(unit = "1", range = 0.0..=0.95, default = 0.3, live)]
    keep_margin: f64,
    /// Smallest normal force that `spare` keeps.
    #[param(unit = "N", range = 0.0.., default = 0.5, live)]
    least_force: f64,
    /// Normal force from which on there is a margin.
    #[param(unit = "N", above = 0.0, default = 0.1)]
    margin_from: f64,
}

/// What `friction_margin` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Tangential force along the sensor's x.
    #[port(unit = "N", frame = "A", quantity = "fx")]
    fx: In<'a, Scalar>,
    /// Tangential force along the sensor's y.
    #[port(unit = "N", frame = "A", quantity = "fy")]
    fy: In<'a, Scalar>,
    /// Normal force, positive when the object presses the pad.
    #[port(unit = "N", frame = "A", quantity = "force")]
    force: In<'a, Scalar>,
    /// Torque about the normal through the centre of pressure.
    #[port(unit = "N m", frame = "A", quantity = "torque", present_if_wired)]
    torque: Option<In<'a, Scalar>>,
    /// Mean distance of the normal force from the centre of pressure.
    #[port(unit = "m", frame = "A", quantity = "lever", present_if_wired)]
    lever: Option<In<'a, Scalar>>,
}

/// What `friction_margin` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// 1 if nothing drags the contact, 0 at the limit of friction; absent below `margin_from`.
    #[port(unit = "1", frame = "A", quantity = "margin")]
    margin: Out<Scalar>,
    /// Normal force beyond the one that keeps the margin.
    #[port(unit = "N", frame = "A", quantity = "spare")]
    spare: Out<Scalar>,
}

impl Node for FrictionMargin {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let alone = match (&setup.inputs.torque, &setup.inputs.lever) {
            (Some(_), None) => Some(["torque", "lever"]),
            (None, Some(_)) => Some(["lever", "torque"]),
            _ => None,
        };
        if let Some([wired, missing]) = alone {
            let message = format!("`in.{wired}` has no effect without `in.{missing}`");
            let mistake = Mistake::new(Code::MissingInput, At::Input(wired.into()), message);
            return Err(mistake.help(format!("wire `in.{missing}` to `{missing}` of the same `shear`")).into());
        }
        setup.outputs.margin.range = [f64::NEG_INFINITY, 1.0];
        Ok(Self { params })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let Params { friction, keep_margin, least_force, margin_from } = self.params;
        let turning = match (inputs.torque, inputs.lever) {
            (Some(torque), Some(lever)) if *lever > 0.0 => *torque / *lever,
            // The force of a single tactel has no lever, and its torque about itself is 0.
            _ => 0.0,
        };
        let load = libm::hypot(libm::hypot(*inputs.fx, *inputs.fy), turning);
        let force = *inputs.force;
        if force >= margin_from {
            out.margin.set(1.0 - load / (friction * force));
        }
        out.spare.set(force - (load / (friction * (1.0 - keep_margin))).max(least_force));
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{ScalarShape, Unit};

    use super::*;

    const PARAMS: &str = "friction = 0.5\nkeep_margin = 0.2\nleast_force = 1.0";

    fn rig(params: &str, inputs: &[&'static str]) -> Result<NodeRig, Mistakes> {
        let unit = |name: &str| match name {
            "torque" => Unit::NEWTON_METRE,
            "lever" => Unit::METRE,
            _ => Unit::NEWTON,
        };
        let inputs: Vec<_> = inputs.iter().map(|name| (*name, ScalarShape::of(unit(name)).into())).collect();
        NodeRig::new::<FrictionMargin>(params, &inputs)
    }

    fn found(values: &[(&'static str, f64)]) -> [Option<f64>; 2] {
        let names: Vec<&'static str> = values.iter().map(|(name, _)| *name).collect();
        let mut rig = rig(PARAMS, &names).unwrap();
        values.iter().for_each(|(name, value)| rig.set(name, *value));
        rig.step();
        ["margin", "spare"].map(|name| rig.get::<Scalar>(name).copied())
    }

    fn is_near(found: [Option<f64>; 2], wanted: [f64; 2]) -> bool {
        found.iter().zip(wanted).all(|(found, wanted)| found.is_some_and(|found| (found - wanted).abs() < 1e-12))
    }

    #[test]
    fn the_margin_and_the_spare_force_in_closed_form() {
        let push = |fx: f64, fy: f64, force: f64| found(&[("fx", fx), ("fy", fy), ("force", force)]);
        assert!(is_near(push(0.0, 0.0, 4.0), [1.0, 3.0]), "nothing drags: {:?}", push(0.0, 0.0, 4.0));
        assert!(is_near(push(0.6, -0.8, 4.0), [0.5, 1.5]), "{:?}", push(0.6, -0.8, 4.0));
        assert!(is_near(push(-1.2, 1.6, 4.0), [0.0, -1.0]), "at the limit");
        assert!(is_near(push(0.0, 3.0, 4.0), [-0.5, -3.5]), "beyond it");
        // At a spare force of 0 the margin is `keep_margin`.
        assert!(is_near(push(0.0, 1.6, 4.0), [0.2, 0.0]));
    }

    #[test]
    fn a_torque_counts_over_the_lever() {
        let all = |fy: f64, torque: f64, lever: f64| {
            found(&[("fx", 0.0), ("fy", fy), ("force", 4.0), ("torque", torque), ("lever", lever)])
        };
        // Friction bears mu n lever = 0.02 N m.
        assert!(is_near(all(0.0, -0.02, 0.01), [0.0, -1.0]));
        assert!(is_near(all(1.2, 0.016, 0.01), [0.0, -1.0]), "3, 4, 5");
        assert!(is_near(all(1.0, 0.0, 0.0), [0.5, 1.5]), "a point bears no torque");
    }

    #[test]
    fn a_light_contact_has_no_margin_and_must_be_pressed() {
        let [margin, spare] = found(&[("fx", 0.01), ("fy", 0.0), ("force", 0.05)]);
        assert!(margin.is_none() && spare.is_some_and(|spare| (spare + 0.95).abs() < 1e-12), "{spare:?}");
    }

    #[test]
    fn a_torque_without_a_lever_is_refused() {
        for (wired, missing) in [("torque", "lever"), ("lever", "torque")] {
            let mistakes = rig(PARAMS, &["fx", "fy", "force", wired]).err().unwrap();
            assert!(mistakes[0].message.contains(&format!("`in.{missing}`")), "{mistakes:?}");
        }
    }
}
