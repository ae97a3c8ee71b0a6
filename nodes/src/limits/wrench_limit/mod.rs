//! `wrench_limit`: the ceiling of the force and the torque on the whole tool.
//!
//! The environment exerts the force f and the torque t on the tool. With a twist (v, ω) about the same origin, the power
//! of the motion against the load is -(f·v + t·ω). For a contact at a point p, t = p × f, and this is |f| times the
//! speed s = -f·(v + ω × p) / |f| with which the point moves into the load. So s needs no point. While |f| is below a
//! threshold, its direction is noise, and each point of the tool may be the first that touches: s is the speed of the
//! fastest one. One factor scales the whole twist until s is allowed: no limit of a pad is violated by that.

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Features, Jacobian, Pose, Scalar, Twist};

use super::contact_limit::Ceiling;
use super::{fraction, max_age};
use crate::arm::capsule::{Capsule, Tool};
use crate::arm::mount::Mount;
use crate::motion::bounds::countable;
use crate::usual::USUAL_FORCE_N;

/// Force below which its direction is noise, as a fraction of the ceiling, if the threshold is not given [1].
const DEFAULT_THRESHOLD: f64 = 0.1;
/// The components of a wrench, in their order.
const NAMES: [&str; 6] = ["fx", "fy", "fz", "tx", "ty", "tz"];

/// Stops the motion of a tool into a load when the force or the torque on it reaches its ceiling.
///
/// A pad does not feel what touches its housing, the tool or the flange. A sensor of the wrench does: a sensor at the
/// wrist, or an arm that estimates the wrench. Its weight of the tool must be compensated. `wrench_n` is the ceiling of
/// the force, and `wrench_n_m` that of the torque about the origin of the tip.
///
/// The motion has room to brake at every load, as in `contact_limit`: it keeps its speed v for a time τ, slows down with
/// the deceleration a, and is at rest before the load has grown to the ceiling. With the stiffness k of the contact this
/// is k (v τ + v²/(2a)) = ceiling - load. τ is the age of the wrench and two periods of the graph. k is
/// `stiffness_n_per_m`, that of the stiffest contact of the tool. For the torque it is k times the lever |t|/|f|.
///
/// Only the speed into the load is limited: against the force, at the point where it acts. The way out is free, and so
/// is a motion across the force. Below `threshold_n` nothing is known to touch the tool. Then the fastest point of the
/// `capsule` around the tool is limited, in all directions; without a capsule, that of the line from the tip to the
/// sensor. The motion is scaled as a whole and keeps its direction.
///
/// A compliant arm gives way as soon as it is touched: with `joint_n_m_per_rad`, `in.pose` and `in.jacobian` it is a
/// spring in series. The force of the first hit is not computed.
///
/// When the wrench is older than `max_age_ms`, or a component is absent, the output is absent.
///
/// ```toml
/// [nodes.wrench_limit]
/// type = "wrench_limit"
/// in.twist = "contact_limit.twist"
/// in.wrench = "force.wrench"
/// wrench_n = 30.0
/// deceleration_m_per_s2 = 2.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct WrenchLimit {
    force: Ceiling,
    /// Its stiffness is that of the force, until a lever multiplies it.
    torque: Option<Ceiling>,
    threshold: f64,
    /// Pose of the tip in the frame of the sensor.
    tip: IsometryMatrix3<f64>,
    tool: Tool,
    /// Largest lever of a contact [m].
    reach: f64,
    /// Compliance of the joints of a compliant arm [rad/(N m)].
    joints: Option<f64>,
    /// Time between two ticks [s].
    period: f64,
    /// Maximum age of the wrench [ns].
    max_age: i64,
}

/// Parameters of `wrench_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Ceiling of the force.
    #[param(unit = "N", above = 0.0, usual = ..=USUAL_FORCE_N)]
    wrench_n: f64,
    /// Ceiling of the torque about the origin of the tip; none if not given.
    #[param(unit = "N m", above = 0.0)]
    wrench_n_m: Option<f64>,
    /// Deceleration with which the tool can stop.
    #[param(unit = "m/s2", above = 0.0)]
    deceleration_m_per_s2: f64,
    /// Stiffness of the stiffest contact that the tool can make.
    #[param(unit = "N/m", above = 0.0, default = 1e5)]
    stiffness_n_per_m: f64,
    /// Force below which nothing is known to touch the tool; a tenth of the ceiling if not given.
    #[param(unit = "N", above = 0.0)]
    threshold_n: Option<f64>,
    /// Pose of the sensor in whose frame the motion is on the tip.
    #[param(default = Mount::NONE)]
    mount: Mount,
    /// The tool as a capsule in the frame of the tip.
    capsule: Option<Capsule>,
    /// Stiffness of the joints of a compliant arm, the largest one; in N/m for prismatic joints. The arm is stiff if not
    /// given.
    #[param(unit = "N m/rad", above = 0.0)]
    joint_n_m_per_rad: Option<f64>,
    /// Maximum age of the wrench; five periods of the slowest device behind it if not given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `wrench_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// The wrench that the environment exerts on the tool, about the origin of the tip and in its axes.
    #[port(unit = "_", frame = "_", quantity = "wrench", known, sampled)]
    wrench: In<'a, Features>,
    /// Pose of the sensor in the base; it counts for a compliant arm.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", known, sampled, optional)]
    pose: Option<In<'a, Pose>>,
    /// Spatial Jacobian of the sensor in the base; it counts for a compliant arm.
    #[port(frame = "B", robot = "_", sampled, optional)]
    jacobian: Option<In<'a, Jacobian>>,
}

/// What `wrench_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion, slowed down before the ceiling.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the motion that passes.
    #[port(unit = "1", frame = "_")]
    wrench: Out<Scalar>,
}

impl Node for WrenchLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    // The wrench and its age move on while a motion is held.
    const LIMITS: Limits =
        Limits { through: Some("twist"), holds: &["wrench"], breaks: &["acceleration"], ..Limits::NONE };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if !setup.inputs.wrench.names().eq(NAMES) {
            let message = format!("a wrench has the features `{}`", NAMES.join("`, `"));
            return Err(Mistake::input("wrench", message).help("wire the port `wrench` of a `force_sensor`").into());
        }
        let ceiling = |load| Ceiling {
            load,
            stiffness: params.stiffness_n_per_m,
            deceleration: params.deceleration_m_per_s2,
            approach: f64::INFINITY,
        };
        let tool = Tool::new(params.capsule.as_ref(), &params.mount);
        setup.outputs.wrench = fraction();
        Ok(Self {
            force: ceiling(params.wrench_n),
            torque: params.wrench_n_m.map(ceiling),
            threshold: params.threshold_n.unwrap_or(DEFAULT_THRESHOLD * params.wrench_n),
            tip: params.mount.pose().inverse(),
            reach: tool.reach(&params.mount),
            tool,
            joints: params.joint_n_m_per_rad.map(f64::recip),
            period: setup.period,
            max_age: max_age(params.max_age_ms, setup.sample_period("wrench")),
        })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let age = inputs.wrench.stamp().age(tick.now);
        let mut wrench = [0.0; 6];
        let mut parts = inputs.wrench.values();
        let is_whole = wrench.iter_mut().all(|part| {
            parts.next().flatten().is_some_and(|value| {
                *part = value;
                true
            })
        });
        if age > self.max_age || !is_whole {
            return;
        }
        let load = Load::new(&wrench, &self.tip);
        let twist = countable(&inputs.twist);
        let delay = age as f64 * 1e-9 + 2.0 * self.period.max(tick.dt);
        let arm = inputs.pose.as_deref().zip(inputs.jacobian.as_deref());
        let [speed, allowed] = self.toward_load(&load, &twist, arm, delay);
        let scale = if speed > allowed { allowed / speed } else { 1.0 };
        out.twist.set(Twist(twist.0 * scale));
        // A NaN in the wrench makes the fraction NaN, which ends the run.
        out.wrench.set(scale + 0.0 * (load.size + load.torque));
    }
}

/// The load on a tool.
struct Load {
    /// Direction of the force in the axes of the sensor, and the torque about its origin for a unit force [m].
    force: Vector3<f64>,
    moment: Vector3<f64>,
    /// Force [N], and torque about the origin of the tip [N m].
    size: f64,
    torque: f64,
}

impl Load {
    /// Returns the load of a wrench, of a tip with that pose in the frame of the sensor.
    fn new([fx, fy, fz, tx, ty, tz]: &[f64; 6], tip: &IsometryMatrix3<f64>) -> Self {
        let (force, torque) = (Vector3::new(*fx, *fy, *fz), Vector3::new(*tx, *ty, *tz));
        let (size, turned) = (force.norm(), tip.rotation * force);
        let moment = tip.rotation * torque + tip.translation.vector.cross(&turned);
        Self { force: turned / size, moment: moment / size, size, torque: torque.norm() }
    }

    /// Returns the sum of the squares of how fast the point of the load moves along the force for each joint [m²].
    ///
    /// A force f turns joint i by f J_i / k, and that moves the point by J_i times as much.
    fn gain(&self, (pose, jacobian): (&Pose, &Jacobian)) -> f64 {
        let force = pose.0.rotation * self.force;
        let moment = pose.0.rotation * self.moment + pose.0.translation.vector.cross(&force);
        jacobian.0.iter().map(|joint| (joint.linear().dot(&force) + joint.angular().dot(&moment)).powi(2)).sum()
    }
}

impl WrenchLimit {
    /// Returns the speed of a motion into the load, and the largest one that is allowed [m/s].
    fn toward_load(&self, load: &Load, twist: &Twist, arm: Option<(&Pose, &Jacobian)>, delay: f64) -> [f64; 2] {
        let is_touched = load.size > self.threshold;
        let gives_way = self.joints.zip(arm).filter(|_| is_touched);
        let compliance = gives_way.map_or(0.0, |(joints, arm)| joints * load.gain(arm));
        let [speed, lever] = match is_touched {
            true => {
                let along = load.force.dot(&twist.linear()) + load.moment.dot(&twist.angular());
                [-along, load.torque / load.size]
            }
            false => [self.tool.speed(twist), self.reach],
        };
        let force = self.force.in_series(compliance).allowed_speed(load.size, delay);
        let torque = self.torque.map_or(f64::INFINITY, |ceiling| {
            let Ceiling { stiffness, .. } = ceiling.in_series(compliance);
            Ceiling { stiffness: stiffness * lever, ..ceiling }.allowed_speed(load.torque, delay)
        });
        [speed, force.min(torque)]
    }
}

#[cfg(test)]
mod tests;
