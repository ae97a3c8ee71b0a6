//! `follow_path`: a sensor follows a path that is given as points.

mod file;
mod path;
mod points;
mod trace;

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{Absence, Describe, FilePath, Interval, Mistakes, Motion};
use tactflow_runtime::node::{Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Scalar, Twist};

use super::hold_pose::Inputs;
use super::placement::Placement;
use crate::usual::{USUAL_LENGTH_M, USUAL_M_PER_S, USUAL_M_PER_S2, USUAL_REACH_M};
use path::Profile;
use trace::{Law, Trace};

/// Moves a sensor along a path through points, with rounded corners.
///
/// The velocity is the speed along the path at its closest point, plus `gain_per_s` times the distance to that point.
/// The node does not turn the sensor: hold its orientation with `hold_pose`, or let a controller do it.
///
/// **Path.** `path` lists the points, or `file` names a CSV file with the columns x, y and z, or a PLY file, such as
/// `tactflow run --points` writes. Each corner is an arc of the radius `corner_m` that is tangent to both legs. A
/// closed path returns to its first point and ends there; it begins behind the corner at the first point. Begin it in
/// the middle of a leg if it must begin exactly at the first point.
///
/// **Frame.** With `relative_to = "base"`, the points are in the base of the arm. With `relative_to = "start"`, they
/// are in the frame of the sensor when the run begins, so that the same file runs on any arm. `origin` is the pose of
/// the frame of the points in that frame. A bench can state it as a fact: `origin = { from = "arm.workpiece", optional
/// = true }`.
///
/// **Speed.** In a corner of radius r the speed is at most sqrt(`acceleration_m_per_s2` r), and the sensor brakes
/// before corners and before the end with that acceleration. The further the sensor is from the path, the slower it
/// moves along it; at `wait_m` it only moves back to the path.
///
/// **Compliant arms** trail behind their commands: by friction over stiffness, and by their lag times the speed. In a
/// corner the trailing distance turns with the path, and pulls the sensor off it. State the distance as `trail_m`, and
/// choose a lower acceleration and a smaller `wait_m` where the path must be followed closely. If nothing else damps
/// the arm, `gain_per_s` must be less than 2 ζ ω, with its natural frequency ω [rad/s] and its damping ratio ζ.
///
/// **One run** begins when the gate is set, or when a mode sets a speed. The sensor first moves straight to the
/// beginning of the path, to within 0.5 mm. The run follows the measured pose, not a time: the closest point is
/// searched from the last one on and at most 5 mm ahead, so an arm that is held skips nothing, and a path may cross
/// itself. When the gate is not set, the run pauses. After `reset_after_ms` without the gate or the pose, or at a speed
/// of 0, it is abandoned and the next one begins afresh. When 0.1 mm are left, `done` is set, and the sensor is held at
/// the end.
///
/// With `in_plane`, the node leaves the sensor's z to other nodes, such as a controller of pressure: the twist has no
/// vz, and distances do not count along z.
///
/// ```toml
/// [nodes.path]                        # a square with 5 mm corners, beginning where the sensor is
/// type = "follow_path"
/// in.pose = "state.sensor_pose"
/// in.gate = "label.present"
/// path = [[0, 0, 0], [0.02, 0, 0], [0.02, 0.04, 0], [-0.02, 0.04, 0], [-0.02, 0, 0]]   # [m]
/// closed = true
/// relative_to = "start"
/// in_plane = true
/// speed_m_per_s = 0.01
/// ```
#[derive(Describe)]
pub struct FollowPath {
    law: Law,
    relative_to: Reference,
    origin: IsometryMatrix3<f64>,
    is_gated: bool,
}

/// Parameters of `follow_path`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Points of the path, `[x, y, z]`. Give this or `file`.
    #[param(unit = "m", range = -1e6..=1e6, usual = -USUAL_REACH_M..=USUAL_REACH_M)]
    path: Option<Vec<[f64; 3]>>,
    /// A CSV or PLY file with the points of the path, in metres. Give this or `path`.
    file: Option<FilePath>,
    /// Frame that `origin` is given in.
    #[param(default = Reference::Base)]
    relative_to: Reference,
    /// Pose of the frame of the points in the frame `relative_to`.
    #[param(default = Placement::NONE)]
    origin: Placement,
    /// Whether the path returns to its first point.
    #[param(default = false)]
    closed: bool,
    /// Radius of the corners.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, default = 0.005)]
    corner_m: f64,
    /// Largest speed along the path, and of the motion back to it. At 0 there is no run.
    #[param(unit = "m/s", range = 0.0.., usual = ..=USUAL_M_PER_S, default = 0.0, live)]
    speed_m_per_s: f64,
    /// Largest acceleration across the path in corners, and along it.
    #[param(unit = "m/s2", above = 0.0, usual = ..=USUAL_M_PER_S2, default = 0.005, live)]
    acceleration_m_per_s2: f64,
    /// Speed per distance from the path.
    #[param(unit = "1/s", above = 0.0, usual = ..=20.0, default = 2.0, live)]
    gain_per_s: f64,
    /// Distance from the path at which the motion along it stops, until the sensor is back.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, default = 0.002, live)]
    wait_m: f64,
    /// Distance by which the arm trails behind its commands while it moves.
    #[param(unit = "m", range = 0.0.., usual = ..=USUAL_LENGTH_M, default = 0.0, live)]
    trail_m: f64,
    /// Whether motion and distances along the sensor's z are left out.
    #[param(default = false)]
    in_plane: bool,
}

/// The frame in which the pose of the path is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Reference {
    /// The base of the arm.
    Base,
    /// The frame of the sensor when the run begins.
    Start,
}

/// What `follow_path` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion along the path; absent without a run.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the path that is behind the sensor, from 0 to 1.
    #[port(unit = "1", frame = "A")]
    progress: Out<Scalar>,
    /// Distance from the path, or from its beginning until the sensor has been there; absent without a run.
    #[port(unit = "m", frame = "A")]
    error: Out<Scalar>,
    /// Whether the sensor has reached the end of the path.
    done: Out<Flag>,
}

/// What `follow_path` remembers.
#[derive(State)]
pub struct State {
    /// The run in progress.
    trace: Option<Trace>,
    /// Since the last pose.
    interval: Interval,
    /// Of the gate.
    absence: Absence,
}

impl Node for FollowPath {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.progress.range = [0.0, 1.0];
        let (path, unusual) = params.read_path()?;
        setup.warnings.extend(unusual);
        if params.speed_m_per_s == 0.0 {
            setup.motion = Motion::Still;
        }
        let law = Law {
            profile: Profile::new(&path, params.acceleration_m_per_s2),
            path,
            gain: params.gain_per_s,
            speed: params.speed_m_per_s,
            acceleration: params.acceleration_m_per_s2,
            wait: params.wait_m,
            trail: params.trail_m,
            is_in_plane: params.in_plane,
        };
        let (relative_to, origin) = (params.relative_to, params.origin.pose());
        Ok(Self { law, relative_to, origin, is_gated: setup.inputs.gate.is_some() })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_open = !self.is_gated || inputs.gate.is_some_and(|gate| *gate);
        let dt = state.interval.step(&inputs.pose, tick).filter(|_| is_open && !tick.is_halted);
        if state.absence.is_long(is_open, tick) || self.law.speed == 0.0 {
            state.trace = None;
        }
        if is_open && self.law.speed > 0.0 {
            let pose = &inputs.pose.0;
            let trace = state.trace.get_or_insert_with(|| Trace::new(self.frame(pose)));
            if dt.is_none() {
                trace.pause();
            }
            let step = trace.step(&self.law, pose, dt.unwrap_or(0.0));
            let velocity = pose.rotation.inverse_transform_vector(&step.velocity);
            out.twist.set(Twist::new(velocity, Vector3::zeros()));
            out.error.set(step.distance);
        } else if let Some(trace) = &mut state.trace {
            trace.pause();
        }
        out.done.set(state.trace.is_some_and(|trace| trace.is_done));
        out.progress.set(state.trace.map_or(0.0, |trace| trace.progress(&self.law)));
    }
}

impl FollowPath {
    /// Returns the pose of the frame of the points in the base, for a run that begins at a pose of the sensor.
    fn frame(&self, pose: &IsometryMatrix3<f64>) -> IsometryMatrix3<f64> {
        match self.relative_to {
            Reference::Base => self.origin,
            Reference::Start => pose * self.origin,
        }
    }
}

#[cfg(test)]
mod tests;
