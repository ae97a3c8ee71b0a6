//! `hold_pose`: a sensor moves to a pose and stays there.
//!
//! With the pose R, p of the sensor in the base and the target R*, p*, in the frame of the sensor:
//!
//! ```text
//! v = min(g |d|, v_max) d / |d|      d = R' (p* - p)
//! w = min(g |e|, w_max) e / |e|      e = log(R' R*), the rotation vector
//! ```
//!
//! On an arm that follows exactly, the rotation does not move the origin of the sensor, so d and e decay independently,
//! each on a straight line.

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{Absence, Describe, In, Inputs, Mistakes, Motion, Node, Out, Outputs, Param};
use tactflow_runtime::node::{Setup, State, Tick};
use tactflow_runtime::signal::line::scale_to;
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

use super::placement::Placement;
use crate::motion::pose::rotation_vector;
use crate::usual::{USUAL_M_PER_S, USUAL_RAD_PER_S};

/// Moves a sensor to a pose and holds it there.
///
/// The twist is proportional to the distance and to the rotation vector (the logarithm of the rotation) to the target,
/// both in the frame of the sensor, and bounded by `speed_m_per_s` and `speed_rad_per_s`. The sensor moves on a
/// straight line and turns about a fixed axis.
///
/// **Target.** `target` is a pose in the base of the arm, and a mode can set another one. Without it the node holds the
/// pose at which the hold begins: when the gate is set, when a mode sets a speed, or when a mode has no `target` any
/// more. When the gate is not set for `reset_after_ms`, or when both speeds are 0, the hold ends. Flicker of the gate
/// only pauses it.
///
/// **Parts.** A speed of 0 frees that part of the motion. With `speed_rad_per_s` alone the node holds the orientation,
/// while other nodes move the sensor. Held components must not also be in a `projector` that passes servoing.
///
/// `there` is for the condition of a mode. It counts the parts whose speed is not 0.
///
/// The pose is measured. On a compliant arm under load, the node moves the equilibrium until the measured pose is that
/// of the target. The contact limits still apply.
///
/// ```toml
/// [nodes.hold]                        # keeps the orientation at which it begins
/// type = "hold_pose"
/// in.pose = "state.sensor_pose"
/// speed_rad_per_s = 0.2
/// ```
#[derive(Describe)]
pub struct HoldPose {
    params: Params,
    target: Option<IsometryMatrix3<f64>>,
    is_gated: bool,
}

/// Parameters of `hold_pose`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Speed per distance to the target, linear and angular.
    #[param(unit = "1/s", above = 0.0, usual = ..=20.0, default = 2.0, live)]
    gain_per_s: f64,
    /// Largest linear speed. At 0 the position is free.
    #[param(unit = "m/s", range = 0.0.., usual = ..=USUAL_M_PER_S, default = 0.0, live)]
    speed_m_per_s: f64,
    /// Largest angular speed. At 0 the orientation is free.
    #[param(unit = "rad/s", range = 0.0.., usual = ..=USUAL_RAD_PER_S, default = 0.0, live)]
    speed_rad_per_s: f64,
    /// Pose to hold, in the base of the arm. Without it, the pose at which the hold begins.
    #[param(live)]
    target: Option<Placement>,
    /// Distance within which the sensor is there.
    #[param(unit = "m", above = 0.0, default = 0.001, live)]
    within_m: f64,
    /// Angle within which the sensor is there.
    #[param(unit = "rad", above = 0.0, default = 0.01, live)]
    within_rad: f64,
}

/// What a motion along measured poses reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose")]
    pub(super) pose: In<'a, Pose>,
    /// The motion continues while this is present and set. Without this wire it always continues.
    #[port(optional)]
    pub(super) gate: Option<In<'a, Flag>>,
}

/// What `hold_pose` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion toward the target; absent without a hold.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Distance to the target; absent without a hold.
    #[port(unit = "m", frame = "A")]
    distance: Out<Scalar>,
    /// Angle to the target; absent without a hold.
    #[port(unit = "rad", frame = "A")]
    angle: Out<Scalar>,
    /// Whether the sensor is within `within_m` and `within_rad` of the target.
    there: Out<Flag>,
}

/// What `hold_pose` remembers.
#[derive(State)]
pub struct State {
    /// The pose at which the hold began, if there is no target.
    held: Option<IsometryMatrix3<f64>>,
    /// Of the gate.
    absence: Absence,
}

impl Node for HoldPose {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let target = params.target.as_ref().map(Placement::pose);
        let this = Self { params, target, is_gated: setup.inputs.gate.is_some() };
        if this.is_still() {
            setup.motion = Motion::Still;
        }
        Ok(this)
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_open = !self.is_gated || inputs.gate.is_some_and(|gate| *gate);
        if state.absence.is_long(is_open, tick) || self.is_still() || self.target.is_some() {
            state.held = None;
        }
        let mut is_there = false;
        if is_open && !self.is_still() {
            let target = self.target.unwrap_or_else(|| *state.held.get_or_insert(inputs.pose.0));
            let (way, turn) = between(&inputs.pose.0, &target);
            let Params { gain_per_s: gain, speed_m_per_s: linear, speed_rad_per_s: angular, .. } = self.params;
            out.twist.set(Twist::new(bounded(gain * way, linear), bounded(gain * turn, angular)));
            out.distance.set(way.norm());
            out.angle.set(turn.norm());
            is_there = (linear == 0.0 || way.norm() <= self.params.within_m)
                && (angular == 0.0 || turn.norm() <= self.params.within_rad);
        }
        out.there.set(is_there);
    }
}

impl HoldPose {
    /// Returns whether the parameters cause no motion.
    fn is_still(&self) -> bool {
        self.params.speed_m_per_s == 0.0 && self.params.speed_rad_per_s == 0.0
    }
}

/// Returns the way [m] and the rotation vector [rad] from a pose to a target, both in the frame of the pose.
fn between(pose: &IsometryMatrix3<f64>, target: &IsometryMatrix3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let way = pose.rotation.inverse_transform_vector(&(target.translation.vector - pose.translation.vector));
    (way, rotation_vector(&(pose.rotation.inverse() * target.rotation)))
}

/// Returns the velocity with its length reduced to `speed`.
fn bounded(velocity: Vector3<f64>, speed: f64) -> Vector3<f64> {
    velocity * scale_to(velocity.norm(), speed)
}

#[cfg(test)]
mod tests;
