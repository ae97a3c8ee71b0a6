//! `ik_sink`: joint velocities for a twist. Each step has four parts:
//!
//! 1. Twist and Jacobian are moved from the origin of the base to that of the sensor, along its axes (Ad of the inverse
//!    pose, eq. 4). Damping depends on the frame, so it is done in the frame of the task.
//! 2. [`damped::solve`]: an inverse that damps only near-singular directions.
//! 3. [`null_space::project`]: motion toward the posture, if there is one, that leaves the sensor exactly still.
//! 4. [`joint_limits`]: within the speeds and the ranges of the joints the elbow gives way first, then the task is slowed
//!    down and keeps its direction; the posture gets what the task leaves.
//!
//! The state is scratch memory alone: each output depends only on the inputs of its step.

use tactflow_runtime::node::{
    Describe, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick, refuse_any,
};
use tactflow_runtime::signal::{Jacobian, Joint, Joints, JointsShape, Pose, Scalar, ScalarShape, Twist, Unit};

use super::joint_limits::{Elbow, interval};
use super::joint_names::names;
use super::{damped, null_space};

/// Moves the arm: computes joint velocities for a twist, within the limits of the arm.
///
/// Resolved motion rate control, as in section IV of the paper. Twist and Jacobian are moved to the origin of the
/// sensor, where the task is defined. The arm follows the twist exactly while every singular value of the Jacobian is
/// at least `damping`. Below, only the nearly lost directions are damped. `sigma` and `damping` tell how near a
/// singularity is, and `lost` is the part of the twist that is not followed. What remains of a slide never becomes a
/// push: the velocity along z of the sensor is between 0 and the wanted one, but for 0.5 % of the rest of the twist.
///
/// An arm with more than six joints can move its elbow while the sensor stays still. It drifts toward `posture`, at
/// `posture_gain`. Where a joint cannot move as fast as the twist needs, the elbow gives way first. Only if that is
/// not enough, the twist is slowed down as a whole and keeps its direction: `share` is the fraction of it that remains,
/// 1 far from every limit. `limited` says which joints are the reason.
///
/// This node decides how the joints share a motion within their speeds and ranges. It approaches a limit so slowly
/// that the joint can brake with the acceleration that the arm states. It guarantees no limit: `joint_limit`, the
/// node between it and the arm, owns the limits of the joints. It also ramps, and stops old commands. Without
/// a twist the velocity is absent.
///
/// ```toml
/// [nodes.ik]
/// type = "ik_sink"
/// in.twist = "to_base.twist"
/// in.sensor_pose = "state.sensor_pose"
/// in.jacobian = "state.jacobian"
/// in.joints = "state.joints"
/// posture = { from = "arm.home", optional = true }   # [rad]
/// ```
#[derive(Describe)]
pub struct IkSink {
    /// With their limits.
    joints: Vec<Joint>,
    params: Params,
    limit_gain: f64,
}

/// Parameters of `ik_sink`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Singular values below this are damped, and no others.
    #[param(unit = "1, m", above = 0.0, default = 0.05)]
    damping: f64,
    /// Posture that the arm drifts toward without moving the sensor, one entry for each joint; in m for
    /// a prismatic joint.
    #[param(unit = "rad", live)]
    posture: Option<Vec<f64>>,
    /// Speed of the drift for each unit of distance.
    #[param(unit = "1/s", range = 0.0.., default = 0.5, live)]
    posture_gain: f64,
    /// Maximum speed toward a position limit for each unit of distance to it, as far as the joint can brake. The default
    /// is 5, or half the rate of the graph if that is less.
    #[param(unit = "1/s", above = 0.0)]
    limit_gain: Option<f64>,
}

/// What `ik_sink` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Spatial twist of the sensor in the base.
    #[port(frame = "B")]
    twist: In<'a, Twist>,
    /// Pose of the sensor in the base.
    #[port(frame = "S", reference = "B", quantity = "sensor_pose", known)]
    sensor_pose: In<'a, Pose>,
    /// Spatial Jacobian of the sensor in the base.
    #[port(frame = "B", robot = "R")]
    jacobian: In<'a, Jacobian>,
    /// Joint positions with their limits; those of prismatic joints are in m.
    #[port(unit = "rad", robot = "R", quantity = "position")]
    joints: In<'a, Joints>,
}

/// What `ik_sink` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Joint velocities; those of prismatic joints are in m/s.
    #[port(unit = "rad/s", robot = "R")]
    velocity: Out<Joints>,
    /// Fraction of the twist that the joint limits leave. The drift toward the posture does not count.
    #[port(unit = "1", frame = "_")]
    share: Out<Scalar>,
    /// 1 for a joint whose largest velocity the twist and the drift together exceed, -1 for its smallest one, else 0.
    #[port(unit = "1", robot = "R")]
    limited: Out<Joints>,
    /// Smallest singular value of the Jacobian at the sensor, in m and rad. Above `damping` it is a lower bound, up to
    /// 22 % too small.
    #[port(unit = "1", frame = "_")]
    sigma: Out<Scalar>,
    /// Fraction of the weakest direction that is lost: 0 far from a singularity, 1 at it.
    #[port(unit = "1", frame = "_")]
    damping: Out<Scalar>,
    /// The part of the twist that is lost near a singularity. It is no motion to be commanded.
    #[port(frame = "S")]
    lost: Out<Twist>,
}

/// What `ik_sink` remembers.
#[derive(State)]
pub struct State {
    /// The Jacobian's columns at the sensor.
    columns: Vec<[f64; 6]>,
    /// Motion toward the posture [rad/s].
    drift: Vec<f64>,
    elbow: Elbow,
}

impl Node for IkSink {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits::passed("twist");

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.joints;
        check(&params, shape, &setup.inputs.jacobian.0, setup.period)?;
        setup.outputs.velocity = shape.in_unit(Unit::RADIAN.per_second());
        setup.outputs.limited = shape.in_unit(Unit::ONE);
        setup.outputs.share = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        setup.outputs.sigma = ScalarShape::of(Unit::ONE);
        setup.outputs.damping = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        let limit_gain = params.limit_gain.unwrap_or(max_limit_gain(setup.period).min(5.0));
        Ok(Self { joints: shape.joints.clone(), params, limit_gain })
    }

    fn state(&self) -> State {
        let count = self.joints.len();
        State { columns: vec![[0.0; 6]; count], drift: vec![0.0; count], elbow: Elbow::new(count) }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let State { columns, drift, elbow } = state;
        let velocity = &mut out.velocity.write().0;
        let q = &inputs.joints.0;
        // A copy, so that it stays in registers while the columns are written.
        let pose = *inputs.sensor_pose.value();
        for (column, of_base) in columns.iter_mut().zip(&inputs.jacobian.0) {
            *column = at_sensor(&pose, of_base);
        }
        let nearness = damped::solve(columns, &at_sensor(&pose, &inputs.twist), self.params.damping, velocity);
        drift.fill(0.0);
        if let Some(posture) = &self.params.posture {
            for ((drift, posture), q) in drift.iter_mut().zip(posture).zip(q) {
                *drift = self.params.posture_gain * (posture - q);
            }
            null_space::project(columns, &mut elbow.rows, drift);
        }
        for ((room, joint), q) in elbow.intervals.iter_mut().zip(&self.joints).zip(q) {
            *room = interval(joint, *q, self.limit_gain);
        }
        out.share.set(elbow.fit(columns, velocity, drift, &mut out.limited.write().0));
        out.sigma.set(nearness.sigma);
        out.damping.set(nearness.damping);
        out.lost.set(Twist(nearness.lost.into()));
    }
}

/// Moves a spatial twist in the base to the origin of the sensor, along the axes of the sensor: Ad(T^-1).
#[inline]
pub(super) fn at_sensor(Pose(pose): &Pose, twist: &Twist) -> [f64; 6] {
    let (p, r) = (&pose.translation.vector, pose.rotation.matrix());
    let [vx, vy, vz, wx, wy, wz] = twist.0.into();
    let v = [vx + wy * p.z - wz * p.y, vy + wz * p.x - wx * p.z, vz + wx * p.y - wy * p.x];
    let w = [wx, wy, wz];
    let turned = |a: [f64; 3], i: usize| r[(0, i)] * a[0] + r[(1, i)] * a[1] + r[(2, i)] * a[2];
    [turned(v, 0), turned(v, 1), turned(v, 2), turned(w, 0), turned(w, 1), turned(w, 2)]
}

/// Returns the largest gain toward a limit with which a delay of one tick cannot cross it [1/s].
fn max_limit_gain(period: f64) -> f64 {
    0.5 / period
}

/// Checks the parameters against the arm and the period of the graph [s].
fn check(params: &Params, joints: &JointsShape, columns: &JointsShape, period: f64) -> Result<(), Mistakes> {
    let mut mistakes = Mistakes::new();
    if names(joints) != names(columns) {
        let message = format!("the Jacobian has the joints {:?}, but `joints` has {:?}", names(columns), names(joints));
        mistakes.push(Mistake::input("jacobian", message).help("wire both to the same `arm_state`"));
    }
    if params.damping < damped::MIN_DAMPING {
        let message =
            format!("`damping` is less than {}, which is too small for double precision", damped::MIN_DAMPING);
        mistakes.push(Mistake::param("damping", message));
    }
    let max = max_limit_gain(period);
    if params.limit_gain.is_some_and(|gain| gain > max) {
        let message = format!("a joint could cross its limit: `limit_gain` is more than {max} 1/s");
        mistakes.push(Mistake::param("limit_gain", message).help("the maximum is half the rate of the graph"));
    }
    let posture = params.posture.as_deref();
    let count = joints.joints.len();
    if let Some(entries) = posture.map(<[f64]>::len).filter(|entries| *entries != count) {
        let message = format!("`posture` has {entries} entries, but the arm has {count} joints");
        mistakes.push(Mistake::param("posture", message));
    }
    for (Joint { name, lower, upper, .. }, entry) in joints.joints.iter().zip(posture.unwrap_or_default()) {
        if !(lower..=upper).contains(&entry) {
            let message = format!(
                "joint `{name}` cannot be at {entry}: its range is {lower:.4} to {upper:.4} (rad, or m if prismatic)"
            );
            mistakes.push(Mistake::param("posture", message));
        }
    }
    refuse_any(mistakes)
}

#[cfg(test)]
mod tests;
