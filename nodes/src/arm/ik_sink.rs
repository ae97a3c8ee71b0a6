//! `ik_sink`: joint velocities for a twist. Each step has four parts:
//!
//! 1. Twist and Jacobian are moved from the origin of the base to that of the sensor, along its axes (Ad of the inverse
//!    pose, eq. 4). Damping depends on the frame, so it is done in the frame of the task.
//! 2. [`damped::solve`]: an inverse that is exact but for nearly lost directions.
//! 3. [`null_space::project`]: motion toward the posture, if there is one, that leaves the sensor exactly still.
//! 4. [`joint_limits::add_within`]: almost always the sum is within the limits of all joints, and is the answer.
//!
//! Otherwise `Sharing` decides: the elbow gives way first, then the task is slowed down in its direction. Where that
//! would stop it although the arm can still follow in part, the velocities are those that lose the least of the twist.
//!
//! The state is scratch memory alone: each output depends only on the inputs of its step.

use tactflow_runtime::node::{
    Describe, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick, refuse_any,
};
use tactflow_runtime::signal::{Jacobian, Joint, Joints, JointsShape, Pose, Scalar, ScalarShape, Twist, Unit};

use super::damped::{self, Nearness};
use super::joint_limits::{self, Elbow, interval};
use super::joint_names::names;
use super::least_lost::{LeastLost, weighted};
use super::null_space;
use crate::motion::bounds::scale_into;

/// A motion in the direction of the twist is the answer if it is at least this fraction of what can be followed of the
/// twist in any direction [1].
const STRAIGHT: f64 = 0.7;
/// Up to this fraction it is not.
const STOPPED: f64 = 0.4;
/// From this damping on, the answer is the motion that loses the least [1].
const DAMPED: f64 = 0.05;
/// The damping of the motion that loses the least, as a fraction of the parameter: weaker, as the limits bound it too.
const SOFTNESS: f64 = 0.2;

/// Moves the arm: computes joint velocities for a twist, within the limits of the arm.
///
/// Resolved motion rate control, as in section IV of the paper. Twist and Jacobian are moved to the origin of the
/// sensor, where the task is defined. The arm follows the twist exactly while every singular value of the Jacobian is
/// at least `damping`. Below, only the nearly lost directions are damped: `sigma` and `damping` tell how near a
/// singularity is.
///
/// An arm with more than six joints can move its elbow while the sensor stays still. It drifts toward `posture`, at
/// `posture_gain`. Where a joint cannot move as fast as the twist needs, the elbow gives way first. If that is not
/// enough, the twist is slowed down as a whole and keeps its direction. A direction that is blocked would stop the arm:
/// it then moves so that it loses the least of the twist. In all this a slide never becomes a push: the velocity along z
/// of the sensor is between 0 and the wanted one.
///
/// `share` is the fraction of the twist that is followed, 1 far from every limit, and `lost` is the rest of the twist.
/// `limited` says which joints are the reason.
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
/// in.equilibrium = "arm.equilibrium"
/// posture = { from = "arm.home", optional = true }   # [rad]
/// ```
#[derive(Describe)]
pub struct IkSink {
    /// With their limits.
    joints: Vec<Joint>,
    params: Params,
    /// The inverse of the gain toward a limit [s].
    limit_delay: f64,
}

/// Parameters of `ik_sink`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Singular values below this are damped, and no others.
    #[param(unit = "1, m", above = 0.0, default = 0.02)]
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
    /// Posture that the commands have moved to; without it, the joint positions. The ranges of the joints hold for both,
    /// as those of `joint_limit` do.
    #[port(unit = "rad", robot = "R", quantity = "equilibrium", optional)]
    equilibrium: Option<In<'a, Joints>>,
}

/// What `ik_sink` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Joint velocities; those of prismatic joints are in m/s.
    #[port(unit = "rad/s", robot = "R")]
    velocity: Out<Joints>,
    /// Fraction of the twist that is followed, along its direction. The drift toward the posture does not count.
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
    /// The part of the twist that is not followed. It is no motion to be commanded.
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
    sharing: Sharing,
}

/// How the joints share a motion that exceeds a limit or is near a singularity.
#[derive(State)]
struct Sharing {
    elbow: Elbow,
    least_lost: LeastLost,
    /// The velocities that lose the least [rad/s].
    turned: Vec<f64>,
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
        Ok(Self { joints: shape.joints.clone(), params, limit_delay: 1.0 / limit_gain })
    }

    fn state(&self) -> State {
        let count = self.joints.len();
        let sharing = Sharing { elbow: Elbow::new(count), least_lost: LeastLost::new(count), turned: vec![0.0; count] };
        State { columns: vec![[0.0; 6]; count], drift: vec![0.0; count], sharing }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let State { columns, drift, sharing } = state;
        let velocity = &mut out.velocity.write().0;
        let q = &inputs.joints.0;
        let equilibrium = inputs.equilibrium.as_ref().map_or(q, |equilibrium| &equilibrium.value().0);
        let places = || q.iter().zip(equilibrium).map(|(q, equilibrium)| [*q, *equilibrium]);
        // A copy, so that it stays in registers while the columns are written.
        let pose = *inputs.sensor_pose.value();
        for (column, of_base) in columns.iter_mut().zip(&inputs.jacobian.0) {
            *column = at_sensor(&pose, of_base);
        }
        let twist = at_sensor(&pose, &inputs.twist);
        let nearness = damped::solve(columns, &twist, self.params.damping, velocity);
        if let Some(posture) = &self.params.posture {
            for ((drift, posture), q) in drift.iter_mut().zip(posture).zip(q) {
                *drift = self.params.posture_gain * (posture - q);
            }
            null_space::project(columns, &mut sharing.elbow.rows, drift);
        }
        let limited = &mut out.limited.write().0;
        limited.fill(0.0);
        let (mut share, mut lost) = (1.0, [0.0; 6]);
        if nearness.damping > 0.0
            || !joint_limits::add_within(&self.joints, places(), self.limit_delay, velocity, drift)
        {
            for (room, (joint, place)) in sharing.elbow.intervals.iter_mut().zip(self.joints.iter().zip(places())) {
                *room = interval(joint, place, self.limit_delay);
            }
            sharing.mark(velocity, drift, limited);
            sharing.share_out(&self.joints, columns, &twist, nearness, self.params.damping, velocity);
            sharing.elbow.add_drift(columns, velocity, drift);
            lost = rest(columns, &twist, velocity);
            share = followed(&twist, &lost);
        }
        out.share.set(share);
        out.sigma.set(nearness.sigma);
        out.damping.set(nearness.damping);
        out.lost.set(Twist(lost.into()));
    }
}

impl Sharing {
    /// Sets `limited` for the joints whose interval the sum of the task and the drift leaves.
    fn mark(&self, velocity: &[f64], drift: &[f64], limited: &mut [f64]) {
        for (i, (min, max)) in self.elbow.intervals.iter().enumerate() {
            let sum = velocity[i] + drift[i];
            limited[i] = f64::from(i8::from(sum > *max) - i8::from(sum < *min));
        }
    }

    /// Turns the `velocity` [rad/s] that the whole `twist` takes to the one within the intervals.
    ///
    /// The result is a mean of the motion that keeps the direction and of the one that loses the least. Both are within
    /// the intervals and never push, and both are convex conditions, so the mean is and does too.
    #[cold]
    fn share_out(
        &mut self,
        joints: &[Joint],
        columns: &[[f64; 6]],
        twist: &[f64; 6],
        nearness: Nearness,
        damping: f64,
        velocity: &mut [f64],
    ) {
        // As fast as the speeds of the joints allow: a twist that is too fast is no reason to turn it.
        let pace = scale_into(velocity, joints.iter().map(|joint| (-joint.speed, joint.speed)));
        for (turned, v) in self.turned.iter_mut().zip(&*velocity) {
            *turned = pace * v;
        }
        let straight = self.elbow.keep_direction(columns, velocity);
        if nearness.damping == 0.0 && straight >= STRAIGHT {
            return;
        }
        let slower = twist.map(|x| pace * x);
        self.least_lost.solve(columns, &slower, &self.elbow.intervals, SOFTNESS * damping, &mut self.turned);
        let most = followed(twist, &rest(columns, twist, &self.turned));
        let by_stop = smooth((STRAIGHT * most - straight) / ((STRAIGHT - STOPPED) * most).max(f64::MIN_POSITIVE));
        let part = by_stop.max(smooth(nearness.damping / DAMPED));
        for (v, turned) in velocity.iter_mut().zip(&self.turned) {
            *v += part * (turned - *v);
        }
        self.elbow.clamp(velocity);
    }
}

/// Returns the part of the twist that these velocities do not produce [m/s, rad/s].
fn rest(columns: &[[f64; 6]], twist: &[f64; 6], velocity: &[f64]) -> [f64; 6] {
    let mut rest = *twist;
    for (column, v) in columns.iter().zip(velocity) {
        for (rest, column) in rest.iter_mut().zip(column) {
            *rest -= column * v;
        }
    }
    rest
}

/// Returns the fraction of a twist that is followed along its direction, if this part of it is lost.
fn followed(twist: &[f64; 6], lost: &[f64; 6]) -> f64 {
    let size = weighted(twist, twist);
    if size > 0.0 { (1.0 - weighted(lost, twist) / size).clamp(0.0, 1.0) } else { 1.0 }
}

/// Rises from 0 at 0 to 1 at 1, with continuous slope.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
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
