//! `gain_schedule`: the control of some features over the stiffness that they meet.

use tactflow_runtime::node::{
    At, Components, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Spanned, Tick,
    refuse_any,
};
use tactflow_runtime::signal::{Features, Scalar};
use tactflow_runtime::source::Code;

/// Divides the control of features by the stiffness of the contact, so that one set of gains fits soft and stiff
/// objects.
///
/// The gain of a loop is that of the controller times that of the object: the same motion changes the pressure of an
/// object that is five times as stiff five times as much. u' = k u with k = 1 / `ratio`, between `min` and `max`, keeps
/// the gain of the loop as it was chosen for a ratio of 1. Wire it between `pid` and `inverse_jacobian`. All three
/// gains of the `pid` then change by the same factor.
///
/// Only the features in `features` are divided; the others pass unchanged. While `ratio` is absent, k is 1: choose
/// gains that are stable with the stiffest object, or a `min` and a `max` that keep the loop stable for a wrong
/// estimate. A ratio that is not a positive number gives `max`, as does an object without stiffness.
///
/// The control is as old as that of the controller. A new ratio alone changes nothing before the next control.
///
/// ```toml
/// [nodes.gain_schedule]
/// type = "gain_schedule"
/// in.control = "pid.control"
/// in.ratio = "stiffness_estimate.ratio"
/// features = ["pressure"]
/// min = 0.3                           # for an object that is three times as stiff, or more
/// max = 1.5
/// ```
#[derive(Describe)]
pub struct GainSchedule {
    /// For each feature, whether it is divided.
    is_divided: Box<[bool]>,
    min: f64,
    max: f64,
}

/// Parameters of `gain_schedule`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Features whose control is divided.
    features: Vec<Spanned<String>>,
    /// Smallest factor.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.2)]
    min: f64,
    /// Largest factor.
    #[param(unit = "1", range = 1.0..=100.0, default = 1.0)]
    max: f64,
}

/// What `gain_schedule` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Control of each feature.
    #[port(unit = "U", frame = "A")]
    control: In<'a, Features>,
    /// Stiffness of the contact over that for which the gains were chosen.
    #[port(unit = "1", frame = "A", quantity = "stiffness", sampled)]
    ratio: Option<In<'a, Scalar>>,
}

/// What `gain_schedule` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The control with the factor.
    #[port(unit = "U", frame = "A")]
    control: Out<Features>,
}

impl Node for GainSchedule {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.control;
        if params.features.is_empty() {
            let mistake = Mistake::param("features", "no feature is divided");
            return Err(mistake.help("list a feature of the control, or leave the node out").into());
        }
        let unknown = params.features.iter().filter(|name| !shape.names().any(|known| known == name.value));
        refuse_any(unknown.map(|name| {
            let message = format!("no feature is called `{}`", name.value);
            let mistake = Mistake::new(Code::BadValue, At::Span(name.span.clone()), message);
            mistake.suggest(&name.value, shape.names(), "features")
        }))?;
        let is_divided =
            shape.names().map(|name| params.features.iter().any(|feature| feature.value == name)).collect();
        setup.outputs.control = shape.clone();
        Ok(Self { is_divided, min: params.min, max: params.max })
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        vec![wanted[0], Components::ALL]
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let factor = inputs.ratio.map_or(1.0, |ratio| factor(*ratio, [self.min, self.max]));
        for (i, is_divided) in self.is_divided.iter().enumerate() {
            match inputs.control.get(i) {
                Some(control) if control.is_new() => {
                    out.control.set_from(i, if *is_divided { factor * *control } else { *control }, &control);
                }
                Some(_) => {}
                None => out.control.lose(i),
            }
        }
    }
}

/// Returns the inverse of a ratio within two bounds; the larger one for a ratio that is not a positive number.
fn factor(ratio: f64, [min, max]: [f64; 2]) -> f64 {
    if ratio > 0.0 { (1.0 / ratio).clamp(min, max) } else { max }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{FeaturesShape, Freshness, ScalarShape, Unit};

    use super::*;

    fn built(params: &str) -> Result<NodeRig, Mistakes> {
        let units = [("x", Unit::METRE.per_second()), ("pressure", Unit::NEWTON.per_tactel().per_second())];
        let ratio = ScalarShape::of(Unit::ONE).into();
        NodeRig::new::<GainSchedule>(params, &[("control", FeaturesShape::new(units).into()), ("ratio", ratio)])
    }

    fn show(rig: &mut NodeRig, control: [Option<f64>; 2]) -> Vec<Option<f64>> {
        rig.set_features("control", &control);
        rig.step();
        rig.get::<Features>("control").unwrap().values().collect()
    }

    #[test]
    fn the_control_is_divided_within_the_bounds() {
        let cases = [
            (1.0, 1.0),
            (2.0, 0.5),
            (0.8, 1.25),
            (5.0, 0.25),
            (0.1, 2.0),
            (f64::INFINITY, 0.25),
            (0.0, 2.0),
            (-3.0, 2.0),
            (f64::NAN, 2.0),
        ];
        for (ratio, factor) in cases {
            let mut rig = built("features = [\"pressure\"]\nmin = 0.25\nmax = 2.0").unwrap();
            rig.set("ratio", ratio);
            assert_eq!(show(&mut rig, [Some(3.0), Some(8.0)]), [Some(3.0), Some(8.0 * factor)], "{ratio}");
        }
    }

    #[test]
    fn the_loop_keeps_its_gain() {
        for stiffness in [0.7, 1.0, 3.0] {
            let mut rig = built("features = [\"pressure\"]\nmax = 2.0").unwrap();
            rig.set("ratio", stiffness);
            let control = show(&mut rig, [None, Some(0.5)])[1].unwrap();
            assert!((stiffness * control - 0.5).abs() < 1e-15, "{stiffness}");
        }
    }

    #[test]
    fn without_a_ratio_the_factor_is_1_and_a_ratio_alone_changes_nothing() {
        let mut rig = built("features = [\"pressure\"]").unwrap();
        assert_eq!(show(&mut rig, [Some(3.0), Some(8.0)]), [Some(3.0), Some(8.0)]);
        rig.set("ratio", 2.0);
        rig.step();
        assert_eq!(rig.freshness("control"), Freshness::Held);
        assert_eq!(show(&mut rig, [None, Some(8.0)]), [None, Some(4.0)]);
        rig.lose("ratio");
        rig.step();
        assert_eq!(show(&mut rig, [None, Some(8.0)]), [None, Some(8.0)]);
        rig.lose("control");
        rig.step();
        assert_eq!(rig.freshness("control"), Freshness::Lost);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        for (bad, place) in [
            ("features = [\"force\"]", "bad-value: `\"force\"`"),
            ("features = []", "bad-value: `features`"),
            ("features = [\"x\"]\nmin = 1.5", "bad-value: `1.5`"),
            ("features = [\"x\"]\nmax = 0.5", "bad-value: `0.5`"),
            ("", "missing-key: `the node`"),
        ] {
            assert_eq!(places(bad, &built(bad)), [place], "{bad}");
        }
    }
}
