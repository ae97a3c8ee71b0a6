//! `workspace_limit`: keeps the sensor's origin in a box of the base.
//!
//! Toward a face at distance d the origin goes at most as fast as it can stop: v τ + v²/(2a) <= d, with τ twice the
//! longest tick that counts as one, since a command acts a tick after what it was made from. At a face, and past it,
//! only the way back is free. The whole twist is scaled by one factor, so its direction stays.

use nalgebra::Vector3;
use tactflow_runtime::node::{Limits, Mistake, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::signal::{ScalarShape, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params};

use crate::motion::bounds::{countable, scale_within};
use crate::motion::braking::stopping_speed;

params! {
    /// The corner of the box with the least coordinates, `[x, y, z]` in the base [m].
    min_m: [f64; 3],
    /// The corner with the greatest [m].
    max_m: [f64; 3],
    /// Deceleration that a stop before a face counts on [m/s²].
    deceleration_m_per_s2: Positive,
    /// Greatest age of the pose; five periods of the graph unless given [ms].
    max_age_ms: Option<Positive>,
}

inputs! {
    /// Twist of the sensor's origin, in the sensor's frame [m/s, rad/s].
    twist: Twist["A"],
    /// Pose of the sensor in the base [m].
    pose: Sampled<Pose["A", "B"]>,
}

outputs! {
    /// The same motion, slowed down before a face [m/s, rad/s].
    twist: Twist["A"],
    /// Share of the motion that passes [1].
    workspace: Scalar["1"],
}

/// The box.
pub struct WorkspaceLimit {
    min: [f64; 3],
    max: [f64; 3],
    deceleration: f64,
    max_age: i64,
}

impl tactflow_runtime::node::Describe for WorkspaceLimit {
    const NAME: &'static str = "workspace_limit";
    const SUMMARY: &'static str = "keeps the sensor in a box of the workspace, with room to brake";
    const DOC: &'static str = "The sensor's origin stays between the corners `min_m` and `max_m` of a box in the base. \
        It brakes before a face, so that it can stop with `deceleration_m_per_s2`, and at the face only the way back \
        is free. The motion is slowed down as a whole and keeps its direction: along a face it goes on only if the \
        task does not push against it.\n\n\
        It counts on what comes behind it: let `deceleration_m_per_s2` be at most the linear acceleration of the \
        `acceleration_limit`. That keeps the direction of a change, so turning to and fro at full speed holds back the \
        braking. A face is then passed by at most the greatest speed times the time in which the whole motion can be \
        reversed: at most 8 mm with 0.05 m/s, 0.8 rad/s, 1 m/s² and 10 rad/s², and 2.3 mm is the worst that was found \
        at 250 Hz.\n\n\
        It looks at the sensor's origin and at no other point: a large sensor or its holder needs a smaller box. When \
        the pose is older than `max_age_ms` there is no motion.";
    const EXAMPLE: &'static str = r#"
[nodes.workspace_limit]
type = "workspace_limit"
in.twist = "contact_limit.twist"
in.pose = "state.sensor_pose"
min_m = [-0.8, -0.4, 0.1]
max_m = [-0.3, 0.4, 0.7]
deceleration_m_per_s2 = 0.5
"#;
    const EVERY_TICK: bool = true;
}

impl Node for WorkspaceLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    // The pose and its age move on while a motion is held.
    const LIMITS: Limits = Limits { through: Some("twist"), holds: &["workspace"], breaks: &["acceleration"] };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let flat = (0..3).find(|axis| params.min_m[*axis] >= params.max_m[*axis]);
        if let Some(axis) = flat {
            let (min, max) = (params.min_m[axis], params.max_m[axis]);
            let message = format!("the box is empty along {}: from {min} to {max} m", ["x", "y", "z"][axis]);
            return Err(Mistake::param("max_m", message).help("let each entry be greater than that of `min_m`").into());
        }
        setup.outputs.workspace = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        let max_age = params.max_age_ms.map_or(5.0 * setup.period, |age| *age * 1e-3);
        let deceleration = *params.deceleration_m_per_s2;
        Ok(Self { min: params.min_m, max: params.max_m, deceleration, max_age: (max_age * 1e9) as i64 })
    }

    fn state(&self) {}

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        if inputs.pose.stamp().age(tick.now) > self.max_age {
            return;
        }
        let (twist, pose) = (countable(&inputs.twist), inputs.pose.0);
        let (velocity, place) = (pose.rotation * twist.linear(), pose.translation.vector);
        let share = share(&velocity, &place, [self.min, self.max], self.deceleration, 2.0 * tick.max_gap);
        out.twist.set(Twist(twist.0 * share));
        out.workspace.set(share);
    }
}

/// The greatest factor up to 1 with which a velocity at a place can still be stopped within a box, after a `delay` [s].
#[must_use]
pub fn share(
    velocity: &Vector3<f64>,
    place: &Vector3<f64>,
    [min, max]: [[f64; 3]; 2],
    deceleration: f64,
    delay: f64,
) -> f64 {
    let toward = |axis: usize| {
        let v = velocity[axis];
        let distance = if v > 0.0 { max[axis] - place[axis] } else { place[axis] - min[axis] };
        (v.abs(), stopping_speed(distance, deceleration, delay))
    };
    scale_within(velocity.norm(), (0..3).map(toward))
}
