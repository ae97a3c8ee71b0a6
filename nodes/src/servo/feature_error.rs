//! `feature_error`: setpoint minus measurement, for every feature (paper eq. 3, the vector Δf).
//!
//! e = setpoint - measured for every feature alike: signs live only in the columns of `inverse_jacobian`. The error of
//! a line's direction is wrapped into (-pi/2, pi/2]. Each component is as fresh and as old as its own input.

use tactflow_runtime::diagnostic::Code;
use tactflow_runtime::node::{At, Map, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{Feature, FeaturesShape, ScalarShape};
use tactflow_runtime::{inputs, outputs, params};

use super::axial::wrap_axial;

params! {
    /// Target of each feature [the feature's unit].
    setpoint: Map<f64>,
    /// Features without which there is no error at all; without any other, only its own component is absent.
    requires: Vec<String> = Vec::new(),
}

inputs! {
    /// The measured features, each under the name it has from here on [any unit].
    feature: Many<Scalar["_", "A"]>,
}

outputs! {
    /// Error of each feature, in the order of the wires [the feature's unit].
    error: Features["_", "A"],
}

/// Target of each feature, and which features the others need.
pub struct FeatureError {
    targets: Box<[Target]>,
    required: Box<[usize]>,
}

struct Target {
    setpoint: f64,
    is_axial: bool,
}

impl Node for FeatureError {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const NAME: &'static str = "feature_error";
    const SUMMARY: &'static str = "setpoint minus measurement, for every feature";

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let wires = &setup.inputs.feature;
        if wires.is_empty() {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no feature is wired");
            return Err(mistake.help("wire each under its name: `in.x = \"touch.x\"`").into());
        }
        let names = || wires.iter().map(|(name, _)| name.as_str());
        let setpoints = params.setpoint.in_order("setpoint", names());
        let required = indices(&params.requires, names());
        let (setpoints, required) = match (setpoints, required) {
            (Ok(setpoints), Ok(required)) => (setpoints, required),
            (setpoints, required) => {
                return Err([setpoints.err(), required.err()].into_iter().flatten().flatten().collect());
            }
        };
        let target = |(setpoint, (_, shape)): (&f64, &(String, ScalarShape))| Target {
            setpoint: *setpoint,
            is_axial: shape.unit.is_axial(),
        };
        let targets = setpoints.into_iter().zip(wires).map(target).collect();
        let feature = |(name, shape): &(String, ScalarShape)| Feature { name: name.clone(), unit: shape.unit };
        setup.outputs.error = FeaturesShape { features: wires.iter().map(feature).collect() };
        Ok(Self { targets, required })
    }

    fn state(&self) {}

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_complete = self.required.iter().all(|i| inputs.feature.get(*i).is_some());
        let error = out.error.write();
        for (i, target) in self.targets.iter().enumerate() {
            let Some(measured) = inputs.feature.get(i).filter(|_| is_complete) else {
                error.lose(i, tick.index);
                continue;
            };
            // A held input sets its component too when that was away for want of a required feature. It is no second
            // sample: it brings the stamp it had, and from one stamp to the same one no time passes (`Interval`).
            if measured.is_new() || error.components()[i].get().is_none() {
                error.set(i, difference(target, *measured), tick.index, measured.stamp());
            }
        }
    }
}

fn difference(target: &Target, measured: f64) -> f64 {
    let error = target.setpoint - measured;
    if target.is_axial { wrap_axial(error) } else { error }
}

/// Where each of `required` stands among `names`.
fn indices<'n>(required: &[String], names: impl Iterator<Item = &'n str> + Clone) -> Result<Box<[usize]>, Mistakes> {
    let listed = || names.clone().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let unknown = |name: &String| {
        let mistake = Mistake::param("requires", format!("no feature is called `{name}`"));
        mistake.help(format!("the features here are {}", listed()))
    };
    let mistakes: Mistakes = required.iter().filter(|name| !names.clone().any(|n| n == *name)).map(unknown).collect();
    if mistakes.is_empty() {
        Ok(required.iter().filter_map(|name| names.clone().position(|n| n == name)).collect())
    } else {
        Err(mistakes)
    }
}
