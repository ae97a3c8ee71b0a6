//! `twist_limit`: the greatest speed of the sensor's origin and of its rotation.
//!
//! out = s in with one factor s for all six components, so that the direction of the motion stays. A twist in the base
//! would not do: a pure roll of a sensor that is far away looks fast there.

use tactflow_runtime::node::{Limits, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::signal::{ScalarShape, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params};

use crate::motion::bounds::scale_twist;

params! {
    /// Greatest speed of the sensor's origin [m/s].
    linear_m_per_s: Positive,
    /// Greatest speed of its rotation [rad/s].
    angular_rad_per_s: Positive,
}

inputs! {
    /// Twist of the sensor's origin, in the sensor's frame [m/s, rad/s].
    twist: Twist["A"],
}

outputs! {
    /// The same motion, slowed down [m/s, rad/s].
    twist: Twist["A"],
    /// Share of the motion that passes [1].
    speed: Scalar["1"],
}

/// The speeds.
pub struct TwistLimit {
    linear: f64,
    angular: f64,
}

impl tactflow_runtime::node::Describe for TwistLimit {
    const NAME: &'static str = "twist_limit";
    const SUMMARY: &'static str = "limits the speed of the sensor and keeps the direction of its motion";
    const DOC: &'static str = "The whole twist is scaled by one factor until its linear and its angular part are within \
        their bounds. It limits the motion of the sensor's origin along the sensor's axes, so it stands before the \
        change of frame: at the base's origin the same numbers would mean something else.";
    const EXAMPLE: &'static str = r#"
[nodes.twist_limit]
type = "twist_limit"
in.twist = "workspace_limit.twist"
linear_m_per_s = 0.05
angular_rad_per_s = 0.8
"#;
}

impl Node for TwistLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const LIMITS: Limits = Limits { through: Some("twist"), holds: &["speed"], breaks: &["acceleration"] };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.speed = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        Ok(Self { linear: *params.linear_m_per_s, angular: *params.angular_rad_per_s })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let share = scale_twist(&inputs.twist, self.linear, self.angular);
        out.twist.set(Twist(inputs.twist.0 * share));
        out.speed.set(share);
    }
}
