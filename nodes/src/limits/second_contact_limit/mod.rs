//! `second_contact_limit`: the ceilings of a second pad of the arm, for a motion in the frame of the first pad.
//!
//! With n the normal of the second pad, p the point on it, and z the normal of the first pad, the second pad approaches
//! its object at s = n·(v + ω × p). What exceeds the allowed speed is removed without a larger approach at any point of
//! the first pad: a translation d changes the approach of all its points by z·d. If the pads do not face each other,
//! n·z >= 0, the excess is removed along n. Otherwise it is removed along t, the part of n that is perpendicular to z.
//! The speed along t that this may remove is u + r: the motion along t, and the retreat r of the first pad, so the arm
//! slides aside at most as fast as it retreats. If that is not enough, the retreat itself drives the second pad into
//! its object, and the whole motion is scaled; this needs an angle of more than 135 degrees between the normals. See
//! decision 024.

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{Image, Jacobian, Pose, Twist};

use super::contact_limit::{ContactLimit, Gauge, Outputs, Params, Reading};
use super::fraction;
use crate::motion::bounds::countable;

/// Below this sine of the angle between the normals, the pads face each other exactly: no direction along the first pad
/// leads away from the object of the second one [1].
const MIN_SINE: f64 = 1e-6;

/// A speed below this fraction of the motion is rounding, which must not scale the motion [1].
const NEGLIGIBLE: f64 = 1e-9;

/// Stops the motion of a second pad into an object when its force or a single tactel reaches its ceiling.
///
/// An arm with two pads has a `contact_limit` for the pad in whose frame the motion is, and behind it a
/// `second_contact_limit` for the other pad. Both have the same parameters, and each has its own image. The pads must
/// be fixed to each other: the motion of a finger joint is not limited.
///
/// `in.pose` is the pose of the pad in whose frame the motion is, and `in.image_pose` that of the pad of the image.
/// Each comes from an `arm_state` with the `mount` of its pad.
///
/// The approach of the second pad is its speed along its own normal, at the point of the contact. The node never
/// makes an approach of the first pad faster, at any of its points, so the limits of the `contact_limit` before it
/// still hold. While the normals of the pads are at most 135 degrees apart, it never reduces a retreat of the first pad, and
/// may add a motion along the first pad, away from the object of the second one. Pads that face each other more exactly
/// have no such way: then the whole motion is scaled. The retreat of the second pad is always free.
///
/// When the image or one of the poses is older than `max_age_ms` the output is absent.
///
/// `builtin:parts/two_pad_move.toml` contains both limiters.
///
/// ```toml
/// [nodes.second_contact_limit]
/// type = "second_contact_limit"
/// in.twist = "contact_limit.twist"
/// in.pose = "state.sensor_pose"
/// in.image = "calibrate.image"
/// in.image_pose = "state.sensor_pose"         # of the second pad, from an `arm_state` of its own
/// force_n = 15.0
/// peak_n = 3.0
/// deceleration_m_per_s2 = 2.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct SecondContactLimit {
    gauge: Gauge,
}

/// What `second_contact_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the first pad's origin, in the frame of the first pad.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// Pose of the first pad in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", known, sampled)]
    pose: In<'a, Pose>,
    /// The whole calibrated image of the second pad.
    #[port(unit = "U", frame = "C", quantity = "tactile_image", known, sampled)]
    image: In<'a, Image>,
    /// Pose of the second pad in the base.
    #[port(frame = "C", reference = "B", quantity = "sensor_pose", known, sampled)]
    image_pose: In<'a, Pose>,
    /// Spatial Jacobian of the second pad in the base; it counts for a compliant arm.
    #[port(frame = "B", robot = "_", sampled, optional)]
    jacobian: Option<In<'a, Jacobian>>,
}

impl Node for SecondContactLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = Reading;

    const LIMITS: Limits = ContactLimit::LIMITS;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let periods = [setup.period, setup.sample_period("image")];
        let gauge = Gauge::new(&params, &setup.inputs.image, periods, &mut setup.warnings)?;
        setup.is_uncalibrated = gauge.is_uncalibrated();
        (setup.outputs.force, setup.outputs.peak) = (fraction(), fraction());
        Ok(Self { gauge })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut Reading) {
        let stamps = [inputs.image.stamp(), inputs.pose.stamp(), inputs.image_pose.stamp()];
        if !stamps.into_iter().all(|stamp| self.gauge.is_fresh(stamp, tick.now)) {
            return;
        }
        let second = inputs.pose.0.inverse() * inputs.image_pose.0;
        let mut twist = countable(&inputs.twist);
        let arm = inputs.jacobian.as_deref().map(|jacobian| (&*inputs.image_pose, jacobian));
        let [sum, highest] = self.gauge.read(&inputs.image, arm, tick, state);
        let [force, peak] = [&sum, &highest].map(|pressed| {
            bar(&mut twist, &second, self.gauge.half(), pressed.allowed, || self.gauge.point(pressed, &inputs.image))
        });
        out.twist.set(twist);
        // A NaN in the image makes the fraction NaN, which ends the run.
        out.force.set(force + 0.0 * sum.load);
        out.peak.set(peak + 0.0 * highest.load);
    }
}

/// Limits the approach of the second pad to `allowed` [m/s]. Its pose in the frame of the twist is `second`, and its
/// `half` sizes are in m. Returns the fraction of the approach that passes.
///
/// If no corner is faster than `allowed`, nothing changes, and `point` is not called. Otherwise `point` returns where the
/// object presses on the pad [m], and the approach at that point is limited. If it returns `None`, the whole motion is
/// scaled until no corner is too fast.
fn bar(
    twist: &mut Twist,
    second: &IsometryMatrix3<f64>,
    half: [f64; 2],
    allowed: f64,
    point: impl FnOnce() -> Option<[f64; 2]>,
) -> f64 {
    let [x_axis, y_axis, normal] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| second.rotation * axis);
    let at = |point: &Vector3<f64>| twist.linear() + twist.angular().cross(point);
    let turn = |axis: &Vector3<f64>| normal.dot(&twist.angular().cross(axis)).abs();
    let fastest = normal.dot(&at(&second.translation.vector)) + turn(&x_axis) * half[0] + turn(&y_axis) * half[1];
    if fastest <= allowed {
        return 1.0;
    }
    let Some([x, y]) = point() else {
        twist.0 *= allowed / fastest;
        return allowed / fastest;
    };
    let point = x_axis * x + y_axis * y + second.translation.vector;
    let velocity = at(&point);
    let speed = normal.dot(&velocity);
    if speed <= allowed {
        return 1.0;
    }
    let change = retreat(&normal, &velocity, speed - allowed);
    *twist = Twist::new(twist.linear() + change, twist.angular());
    let left = speed + normal.dot(&change);
    let size = velocity.norm() + twist.angular().norm() * point.norm();
    if left - allowed > NEGLIGIBLE * size {
        twist.0 *= allowed / left;
    }
    allowed / speed
}

/// Returns the translation that removes an `excess` of the approach along `normal`, or as much of it as is possible
/// without a larger approach of the first pad, whose normal is z [m/s]. `velocity` is that of the point.
fn retreat(normal: &Vector3<f64>, velocity: &Vector3<f64>, excess: f64) -> Vector3<f64> {
    if normal.z >= 0.0 {
        return normal * -excess;
    }
    let sine = (normal.x * normal.x + normal.y * normal.y).sqrt();
    if sine < MIN_SINE {
        return Vector3::zeros();
    }
    let along = Vector3::new(normal.x / sine, normal.y / sine, 0.0);
    let most = along.dot(velocity) - velocity.z.min(0.0);
    along * -(excess / sine).min(most).max(0.0)
}

#[cfg(test)]
mod tests;
