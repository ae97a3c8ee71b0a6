//! `acceleration_limit`: the greatest acceleration of the sensor's origin and of its rotation.
//!
//! The output goes from where it is toward the input on a straight line, by as much as both accelerations allow, with
//! one factor. What limits before it hold stays held behind it: their sets are convex, and a point between two of a
//! convex set is in it. A bound that moves faster than the accelerations is met as fast as they allow.

use tactflow_runtime::node::{Limits, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::signal::{ScalarShape, Stamp, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::bounds::{approach_twist, countable};

params! {
    /// Greatest change of the linear velocity [m/s²].
    linear_m_per_s2: Positive,
    /// Greatest change of the angular velocity [rad/s²].
    angular_rad_per_s2: Positive,
    /// Greatest age of the motion; five periods of the graph unless given [ms].
    max_age_ms: Option<Positive>,
}

inputs! {
    /// The motion that is wanted; absent is none [m/s, rad/s].
    twist: Trigger<Twist["A"]>,
}

outputs! {
    /// The motion that is reached [m/s, rad/s].
    twist: Twist["A"],
    /// Share of the wanted change that passes in this tick [1].
    acceleration: Scalar["1"],
}

state! {
    /// The motion that was reached in the last tick [m/s, rad/s].
    reached: Twist,
}

/// The accelerations, and how old a motion may be.
pub struct AccelerationLimit {
    linear: f64,
    angular: f64,
    max_age: i64,
}

impl tactflow_runtime::node::Describe for AccelerationLimit {
    const NAME: &'static str = "acceleration_limit";
    const SUMMARY: &'static str = "limits the acceleration of the sensor, and brings it to rest when nothing comes";
    const DOC: &'static str = "The motion follows what is wanted on a straight line, as fast as both accelerations \
        allow. It is the last limiter of a twist: what scales a motion behind it would make it jump again.\n\n\
        When the motion is absent or older than `max_age_ms`, or the runtime holds all commands, it goes to zero by the \
        same rule, is there until it rests, and absent then. A generated motion is of no age. What is left of an absent motion is of no age either \
        and goes all the way down here. What is left of an old one is as old as that: a `joint_limit` behind it drops \
        it too, and brings the joints to rest by its own accelerations.";
    const EXAMPLE: &'static str = r#"
[nodes.acceleration_limit]
type = "acceleration_limit"
in.twist = "twist_limit.twist"
linear_m_per_s2 = 1.0
angular_rad_per_s2 = 10.0
"#;
    const EVERY_TICK: bool = true;
}

impl Node for AccelerationLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits { through: Some("twist"), holds: &["acceleration"], breaks: &[] };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if setup.inputs.twist.is_none() {
            return Err(crate::unwired(
                <Self as tactflow_runtime::node::Describe>::NAME,
                "twist",
                "a twist",
                "twist_limit.twist",
            )
            .into());
        }
        setup.outputs.acceleration = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        let max_age = params.max_age_ms.map_or(5.0 * setup.period, |age| *age * 1e-3);
        let (linear, angular) = (*params.linear_m_per_s2, *params.angular_rad_per_s2);
        Ok(Self { linear, angular, max_age: (max_age * 1e9) as i64 })
    }

    fn state(&self) -> State {
        State { reached: Twist::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_fresh = |stamp: Stamp| stamp.age(tick.now) <= self.max_age && !tick.is_halted;
        let wanted = inputs.twist.filter(|twist| is_fresh(twist.stamp()));
        let target = wanted.map_or_else(Twist::default, |twist| countable(&twist));
        let dt = tick.dt.min(tick.max_gap);
        let share = approach_twist(&mut state.reached, &target, self.linear * dt, self.angular * dt);
        if wanted.is_some() || state.reached != Twist::default() {
            out.twist.set(state.reached);
            out.acceleration.set(share);
        }
    }
}
