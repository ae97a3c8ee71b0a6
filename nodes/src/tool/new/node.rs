//! `template_node`: the change of a feature per second, dy = (x - x_last) / dt.
//!
//! dt is the time between two samples, so it means the same at any rate. The first sample has no change.

use tactflow_runtime::node::{Describe, In, Inputs, Interval, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::Scalar;

/// The change of a feature per second.
///
/// It is absent until the second sample, and after the feature was lost.
///
/// ```toml
/// [nodes.template_node]
/// type = "template_node"
/// in.value = "moments.pressure"
/// gain = 1.0
/// ```
#[derive(Describe)]
pub struct TemplateNode {
    gain: f64,
}

/// Parameters of `template_node`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Factor of the change.
    #[param(unit = "1", default = 1.0, live)]
    gain: f64,
}

/// What `template_node` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The feature.
    #[port(unit = "U", frame = "A")]
    value: In<'a, Scalar>,
}

/// What `template_node` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Its change per second.
    #[port(unit = "U/s", frame = "A")]
    change: Out<Scalar>,
}

/// The last sample, and the time since it.
#[derive(State)]
pub struct State {
    last: Option<f64>,
    interval: Interval,
}

impl Node for TemplateNode {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { gain: params.gain })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let last = state.last.replace(*inputs.value);
        if let Some((last, dt)) = last.zip(state.interval.step(&inputs.value, tick)) {
            out.change.set(self.gain * (*inputs.value - last) / dt);
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{ScalarShape, Unit};

    use super::*;

    #[test]
    fn a_ramp_has_a_constant_change() {
        let shape = ScalarShape::of(Unit::NEWTON);
        let mut rig = NodeRig::new::<TemplateNode>("gain = 2.0", &[("value", shape.into())]).unwrap();
        let mut change = |i: i32| {
            rig.set("value", 0.5 * f64::from(i));
            rig.step_ms(4.0);
            rig.get::<Scalar>("change").copied()
        };
        let changes: Vec<Option<f64>> = (0..4).map(&mut change).collect();
        assert_eq!(changes[0], None);
        assert!(changes[1..].iter().all(|change| (change.unwrap() - 250.0).abs() < 1e-9), "{changes:?}");
    }
}
