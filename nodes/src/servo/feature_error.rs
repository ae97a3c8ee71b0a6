//! `feature_error`: setpoint minus measurement, for every feature.
//!
//! Each component keeps the stamp of its own input, so that `pid` measures the time between the samples of a feature.

use tactflow_runtime::node::{
    At, Describe, Inputs, Many, Map, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Spanned, Tick, collect_both,
    refuse_any,
};
use tactflow_runtime::signal::{Feature, Features, FeaturesShape, Scalar, ScalarShape, Unit};
use tactflow_runtime::source::Code;

use crate::motion::axis::wrap_axial;
use crate::usual::{USUAL_FORCE_N, USUAL_PRESSURE_N, USUAL_RAD, unusual};

/// Computes the error of every feature: setpoint minus measurement.
///
/// The vector Δf of eq. 3 of the paper: e = setpoint - measured for every wired feature, under the name of its wire.
/// `pid` and `inverse_jacobian` use the same names in the same order; a name that is missing there is an error.
///
/// The sign is the same for every feature: only the columns of `inverse_jacobian` define in which direction the sensor
/// moves. A setpoint has the unit of its feature. The error of an axis is wrapped into (-pi/2, pi/2], because a line
/// looks the same after half a turn.
///
/// Each component is as fresh and as old as its own input. A feature that is absent, such as the direction of a round
/// contact, does not affect the others. List it in `requires` if the whole error must be absent without it.
///
/// ```toml
/// [nodes.error]
/// type = "feature_error"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// in.pressure = "moving_average.value"
/// setpoint = { x = 0.0, y = 0.0, pressure = 0.1 }   # [m, m, N per tactel]
/// ```
#[derive(Describe)]
pub struct FeatureError {
    /// One for each wire.
    setpoints: Box<[Setpoint]>,
    /// Indices of the wires without which the error is absent.
    required: Box<[usize]>,
}

/// Parameters of `feature_error`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Target of each feature.
    #[param(unit = "_", live, tunable)]
    setpoint: Map<f64>,
    /// Features without which the whole error is absent. Without any other feature, only its own component is absent.
    #[param(default = Vec::new())]
    requires: Vec<Spanned<String>>,
}

/// What `feature_error` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The measured features, each under its name.
    #[port(unit = "_", frame = "A", quantity = "$wire")]
    feature: Many<'a, Scalar>,
}

/// What `feature_error` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Error of each feature, in the order of the wires.
    #[port(unit = "_", frame = "A")]
    error: Out<Features>,
}

/// What one feature is compared with.
struct Setpoint {
    value: f64,
    is_axial: bool,
}

impl Node for FeatureError {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let wires = &setup.inputs.feature;
        if wires.is_empty() {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no feature is wired");
            return Err(mistake.help("wire each under its name: `in.x = \"touch.x\"`").into());
        }
        let names = || wires.iter().map(|(name, _)| name.as_str());
        let values = params.setpoint.in_order("setpoint", names());
        let (values, required) = collect_both(values, indices(&params.requires, names()))?;
        let setpoint = |(value, (_, shape)): (&f64, &(String, ScalarShape))| Setpoint {
            value: *value,
            is_axial: shape.unit.is_axial(),
        };
        let warnings = values.iter().zip(wires).filter_map(|(value, (name, shape))| {
            unusual(&format!("setpoint.{name}"), **value, usual(shape), shape.unit)
        });
        setup.warnings.extend(warnings);
        let setpoints = values.into_iter().zip(wires).map(setpoint).collect();
        let feature = |(name, shape): &(String, ScalarShape)| Feature { name: name.clone(), unit: shape.unit };
        setup.outputs.error = FeaturesShape { features: wires.iter().map(feature).collect() };
        Ok(Self { setpoints, required })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_complete = self.required.iter().all(|i| inputs.feature.get(*i).is_some());
        for (i, (setpoint, measured)) in self.setpoints.iter().zip(inputs.feature.iter()).enumerate() {
            match measured.filter(|_| is_complete) {
                // When a required feature returns, a held input sets its component again, with the stamp that it had.
                // That is no second sample: no time passes between equal stamps.
                Some(measured) if measured.is_new() || out.error.write().components()[i].get().is_none() => {
                    out.error.set_from(i, setpoint.error(*measured), &measured);
                }
                Some(_) => {}
                None => out.error.lose(i),
            }
        }
    }
}

impl Setpoint {
    /// Returns the setpoint minus the measurement; for an axis, wrapped into (-pi/2, pi/2].
    fn error(&self, measured: f64) -> f64 {
        let error = self.value - measured;
        if self.is_axial { wrap_axial(error) } else { error }
    }
}

/// Returns the range of the setpoints that a feature can have; infinite if it is unknown.
fn usual(shape: &ScalarShape) -> [f64; 2] {
    match shape.range {
        _ if shape.unit.is_axial() => [-USUAL_RAD, USUAL_RAD],
        range if range.iter().all(|end| end.is_finite()) => range,
        _ if shape.unit == Unit::NEWTON.per_tactel() => [0.0, USUAL_PRESSURE_N],
        // The components of a force have a sign, and a node that measures a normal force says that it has none.
        [min, _] if shape.unit == Unit::NEWTON => [min.max(-USUAL_FORCE_N), USUAL_FORCE_N],
        range => range,
    }
}

/// Returns the index in `names` of each name in `required`.
fn indices<'n>(
    required: &[Spanned<String>],
    names: impl Iterator<Item = &'n str> + Clone,
) -> Result<Box<[usize]>, Mistakes> {
    let unknown = |name: &Spanned<String>| {
        let message = format!("no feature is called `{}`", name.value);
        let mistake = Mistake::new(Code::BadValue, At::Span(name.span.clone()), message);
        mistake.suggest(&name.value, names.clone(), "features")
    };
    refuse_any(required.iter().filter(|name| !names.clone().any(|n| n == name.value)).map(unknown))?;
    Ok(required.iter().filter_map(|name| names.clone().position(|n| n == name.value)).collect())
}

#[cfg(test)]
mod tests;
