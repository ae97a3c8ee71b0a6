//! `workspace_limit`: the sensor's origin stays in a box of the base, and before planes.
//!
//! At the distance d from a face or a plane the origin moves toward it at most at the speed from which it can stop:
//! v τ + v²/(2a) <= d. τ is twice the graph's `max_gap_ms`, because a command acts one tick after its inputs were read.
//! At a face and beyond it only the way back is free. Of a capsule, both ends count, as balls before the planes. One factor scales the whole twist, so its direction stays.

mod planes;

use nalgebra::Vector3;
use tactflow_runtime::node::{
    At, Describe, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick,
};
use tactflow_runtime::signal::{Pose, Scalar, Twist};
use tactflow_runtime::source::Code;

use planes::Rows;

use super::{fraction, max_age};
use crate::arm::capsule::{Capsule, Tool};
use crate::arm::mount::Mount;
use crate::motion::bounds::{countable, scale_within};
use crate::motion::braking::stopping_speed;
use crate::usual::{USUAL_M_PER_S2, USUAL_REACH_M};

pub use planes::Plane;

/// Keeps the sensor in a box of the workspace and before planes, with room to brake.
///
/// The sensor's origin stays between the corners `min_m` and `max_m` of a box in the base. It brakes before a face, so
/// that it can stop with `deceleration_m_per_s2`; at the face only the way back is free. The motion is scaled as a
/// whole and keeps its direction: it goes on along a face only if the task does not push against the face.
///
/// Each row `[nx, ny, nz, d]` of `keep_out` is one more face, in any direction: a table, a wall, a fixture. The sensor's
/// origin p stays where n·p >= d. n is a unit vector in the base that points to the free side, and d is in metres.
///
/// `deceleration_m_per_s2` must not exceed the linear acceleration of the `acceleration_limit` behind it. That node
/// keeps the direction of a change of motion, so rotating back and forth at full speed delays the braking. The sensor
/// then passes a face or a plane by at most its maximum speed times the time in which the whole motion can be
/// reversed: 8 mm with 0.05 m/s, 0.8 rad/s, 1 m/s² and 10 rad/s². The worst case found at 250 Hz is 2.3 mm.
///
/// In the box it checks the sensor's origin and no other point: a large sensor or holder needs a smaller box. Before the
/// planes it checks the whole `capsule` as well, which is around the tool in the frame of the tip. When the pose is
/// older than `max_age_ms` the output is absent.
///
/// ```toml
/// [nodes.workspace_limit]
/// type = "workspace_limit"
/// in.twist = "contact_limit.twist"
/// in.pose = "state.sensor_pose"
/// min_m = [-0.8, -0.4, 0.1]
/// max_m = [-0.3, 0.4, 0.7]
/// keep_out = [[0.0, 0.0, 1.0, 0.12]]     # a table at z = 0.12 m
/// deceleration_m_per_s2 = 0.5
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct WorkspaceLimit {
    params: Params,
    planes: Box<[Plane]>,
    /// The tool, if it stays before the planes too.
    tool: Option<Tool>,
    /// Maximum age of the pose [ns].
    max_age: i64,
}

/// Parameters of `workspace_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Corner of the box with the smallest coordinates, `[x, y, z]` in the base.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M)]
    min_m: [f64; 3],
    /// Corner of the box with the largest coordinates.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M)]
    max_m: [f64; 3],
    /// Planes `[nx, ny, nz, d]` in the base behind which the sensor must not be: n·p >= d, with a unit vector n that
    /// points to the free side.
    #[param(unit = "1, 1, 1, m", default = Rows::default())]
    keep_out: Rows,
    /// Pose of the sensor on the tip, for the capsule.
    #[param(default = Mount::NONE)]
    mount: Mount,
    /// The tool as a capsule in the frame of the tip, which stays before the planes too.
    capsule: Option<Capsule>,
    /// Deceleration with which the sensor can stop before a face.
    #[param(unit = "m/s2", above = 0.0, usual = ..=USUAL_M_PER_S2)]
    deceleration_m_per_s2: f64,
    /// Maximum age of the pose; five periods of the slowest device behind it if not given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `workspace_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", known, sampled)]
    pose: In<'a, Pose>,
}

/// What `workspace_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion, slowed down before a face.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the motion that passes.
    #[port(unit = "1", frame = "_")]
    workspace: Out<Scalar>,
}

impl Node for WorkspaceLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    // The pose and its age move on while a motion is held.
    const LIMITS: Limits =
        Limits { through: Some("twist"), holds: &["workspace"], breaks: &["acceleration"], ..Limits::NONE };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let sides = ["x", "y", "z"].into_iter().zip(params.min_m.into_iter().zip(params.max_m));
        if let Some((axis, (min, max))) = sides.into_iter().find(|(_, (min, max))| min >= max) {
            let message = format!("the box is empty along {axis}: from {min} to {max} m");
            // A number that no arm reaches is the wrong one of the two.
            let is_min = min.abs() > USUAL_REACH_M && max.abs() <= USUAL_REACH_M;
            let (param, help) = match is_min {
                true => ("min_m", "make each entry less than that of `max_m`"),
                false => ("max_m", "make each entry greater than that of `min_m`"),
            };
            return Err(Mistake::param(param, message).help(help).into());
        }
        let planes = planes::planes(&params.keep_out)?;
        planes::check_room(&params.keep_out, &planes, [&params.min_m, &params.max_m])?;
        setup.warnings.extend(planes::unusual_distances(&params.keep_out));
        if let Some(start) = &setup.inputs.pose.start {
            setup.warnings.extend(start_outside(start, "min_m", &params.min_m, -1.0));
            setup.warnings.extend(start_outside(start, "max_m", &params.max_m, 1.0));
            setup.warnings.extend(planes::start_behind(start, &params.keep_out, &planes));
        }
        setup.outputs.workspace = fraction();
        let max_age = max_age(params.max_age_ms, setup.sample_period("pose"));
        let tool = params.capsule.as_ref().map(|capsule| Tool::new(Some(capsule), &params.mount));
        Ok(Self { params, planes, tool, max_age })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        if inputs.pose.stamp().age(tick.now) > self.max_age {
            return;
        }
        let Params { min_m: min, max_m: max, deceleration_m_per_s2: deceleration, .. } = self.params;
        let (twist, pose) = (countable(&inputs.twist), inputs.pose.0);
        let (velocity, position) = (pose.rotation * twist.linear(), pose.translation.vector);
        let delay = 2.0 * tick.max_gap;
        let mut scale = scale(&velocity, &position, [min, max], deceleration, delay);
        if !self.planes.is_empty() {
            scale = scale.min(planes::scale(&self.planes, &velocity, (&position, 0.0), deceleration, delay));
            // Both balls at the ends of a capsule bound all of it.
            for (end, radius) in self.tool.iter().flat_map(|tool| tool.ends.map(|end| (end, tool.radius))) {
                let velocity = pose.rotation * Tool::velocity(&twist, &end);
                let ball = (&(position + pose.rotation * end), radius);
                scale = scale.min(planes::scale(&self.planes, &velocity, ball, deceleration, delay));
            }
        }
        out.twist.set(Twist(twist.0 * scale));
        out.workspace.set(scale);
    }
}

/// Returns the warning about a sensor that starts beyond a corner of the box, from which only the way back is free.
///
/// `sign` is -1 for the corner with the smallest coordinates, and 1 for the other one.
fn start_outside(start: &[f64; 3], param: &str, corner: &[f64; 3], sign: f64) -> Option<Mistake> {
    // A corner or a mount in another unit has its own warning.
    if start.iter().chain(corner).any(|value| value.abs() > USUAL_REACH_M) {
        return None;
    }
    let is_beyond = |axis: usize| sign * (start[axis] - corner[axis]) > 0.0;
    let axis = (0..3).find(|axis| is_beyond(*axis))?;
    let (name, side) = (["x", "y", "z"][axis], if sign < 0.0 { "less" } else { "greater" });
    let at = start.map(|value| (value * 1e3).round() / 1e3);
    let message = format!(
        "the sensor starts outside the workspace, at {at:?} m: its {name} is {side} than {} m, so only motion toward the \
         box is free",
        corner[axis]
    );
    // A few centimetres of room, so that the sensor can move there.
    let room = |axis: usize| ((start[axis] + sign * 0.05) * 100.0).round() / 100.0;
    let wider = [0, 1, 2].map(|axis| if is_beyond(axis) { room(axis) } else { corner[axis] });
    let help = format!("write `{wider:?}`, or change the start or the mount of the arm in the bench");
    Some(Mistake::new(Code::StartOutside, At::Param(param.into()), message).help(help))
}

/// Returns the largest factor up to 1 with which a velocity can still be stopped within a box.
///
/// `position` and the corners `[min, max]` are in [m], the velocity in [m/s], `deceleration` in [m/s²]. The velocity
/// stays the same for `delay` [s] before it decreases.
#[must_use]
pub fn scale(
    velocity: &Vector3<f64>,
    position: &Vector3<f64>,
    [min, max]: [[f64; 3]; 2],
    deceleration: f64,
    delay: f64,
) -> f64 {
    let toward = |axis: usize| {
        let v = velocity[axis];
        let distance = if v > 0.0 { max[axis] - position[axis] } else { position[axis] - min[axis] };
        (v.abs(), stopping_speed(distance, deceleration, delay))
    };
    scale_within(velocity.norm(), (0..3).map(toward))
}

#[cfg(test)]
mod tests;
