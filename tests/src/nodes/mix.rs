//! `mix`: a linear combination of features, y = M x.
//!
//! The sum over a row starts afresh in each step, so there is no state. An output is as old as the vector.

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Feature, Features, FeaturesShape};

/// Combines features of one unit linearly.
///
/// y = M x. Each row of `matrix` is one output, and each column is one feature of the input, in its order. `absent`
/// decides what an absent feature means for the outputs that depend on it.
///
/// ```toml
/// [nodes.axes]
/// type = "feature_error"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// setpoint = { x = 0.0, y = 0.0 }     # [m]
///
/// [nodes.mix]
/// type = "mix"
/// in.features = "axes.error"
/// outputs = ["sum", "difference"]
/// matrix = [[1.0, 1.0], [1.0, -1.0]]
/// absent = "zero"
/// ```
#[derive(Describe)]
pub struct Mix {
    rows: Vec<Vec<f64>>,
    absent: Absent,
}

/// Parameters of `mix`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Names of the outputs, one for each row.
    outputs: Vec<String>,
    /// The matrix M, row by row.
    #[param(unit = "1", range = -100.0..=100.0)]
    matrix: Vec<Vec<f64>>,
    /// What an absent feature means.
    #[param(default = Absent::Lost)]
    absent: Absent,
}

/// What an absent feature means for an output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum Absent {
    /// An output that depends on it is absent too.
    Lost,
    /// It counts as zero.
    Zero,
}

/// What `mix` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Features of one unit.
    #[port(unit = "U", frame = "A")]
    features: In<'a, Features>,
}

/// What `mix` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The combinations.
    #[port(unit = "U", frame = "A")]
    mixed: Out<Features>,
}

impl Node for Mix {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let features = &setup.inputs.features.features;
        let unit = features[0].unit;
        if let Some(other) = features.iter().find(|feature| feature.unit != unit) {
            let message = format!("`{}` is in `{}`, but `{}` is in `{unit}`", other.name, other.unit, features[0].name);
            return Err(Mistake::input("features", message).into());
        }
        if let Some(i) = params.matrix.iter().position(|row| row.len() != features.len()) {
            let message = format!("row {i} has {} numbers for {} features", params.matrix[i].len(), features.len());
            return Err(Mistake::param("matrix", message).into());
        }
        if params.matrix.len() != params.outputs.len() {
            let message = format!("{} names for {} rows", params.outputs.len(), params.matrix.len());
            return Err(Mistake::param("outputs", message).help("give one name for each row of `matrix`").into());
        }
        let mixed = params.outputs.into_iter().map(|name| Feature { name, unit });
        setup.outputs.mixed = FeaturesShape { features: mixed.collect() };
        Ok(Self { rows: params.matrix, absent: params.absent })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        for (i, row) in self.rows.iter().enumerate() {
            let mut terms = row.iter().zip(inputs.features.iter()).filter(|(factor, _)| **factor != 0.0);
            let sum = terms.try_fold(0.0, |sum, (factor, feature)| match feature {
                Some(feature) => Some(sum + factor * *feature),
                None => (self.absent == Absent::Zero).then_some(sum),
            });
            match sum {
                Some(sum) => out.mixed.set(i, sum),
                None => out.mixed.lose(i),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::Unit;

    use super::*;

    fn rig(params: &str, units: [Unit; 2]) -> Result<NodeRig, Mistakes> {
        let shape = FeaturesShape::new([("x", units[0]), ("y", units[1])]);
        NodeRig::new::<Mix>(params, &[("features", shape.into())])
    }

    #[test]
    fn it_mixes_what_is_present() {
        let cases = [("lost", [None, Some(2.0)]), ("zero", [Some(2.0), Some(2.0)])];
        for (absent, expected) in cases {
            let matrix = "outputs = [\"sum\", \"y\"]\nmatrix = [[1, 1], [0, 1]]";
            let mut rig = rig(&format!("{matrix}\nabsent = \"{absent}\""), [Unit::METRE; 2]).unwrap();
            rig.set_features("features", &[Some(1.0), Some(2.0)]);
            rig.step_ms(4.0);
            assert_eq!(rig.get::<Features>("mixed").unwrap().values().collect::<Vec<_>>(), [Some(3.0), Some(2.0)]);
            rig.set_features("features", &[None, Some(2.0)]);
            rig.step_ms(4.0);
            assert_eq!(rig.get::<Features>("mixed").unwrap().values().collect::<Vec<_>>(), expected, "{absent}");
        }
    }

    #[test]
    fn a_bad_matrix_is_a_mistake_at_its_place() {
        let cases = [
            ("outputs = [\"a\"]\nmatrix = [[1]]", "row 0 has 1 numbers for 2 features"),
            ("outputs = []\nmatrix = [[1, 1]]", "0 names for 1 rows"),
            ("outputs = [\"a\"]\nmatrix = [[1, 200]]", "expected a number from -100 to 100, found 200"),
        ];
        for (params, message) in cases {
            assert_eq!(rig(params, [Unit::METRE; 2]).err().unwrap()[0].message, message);
        }
        let mistakes = rig("outputs = [\"a\"]\nmatrix = [[1, 1]]", [Unit::METRE, Unit::NEWTON]).err().unwrap();
        assert_eq!(mistakes[0].message, "`y` is in `N`, but `x` is in `m`");
    }
}
