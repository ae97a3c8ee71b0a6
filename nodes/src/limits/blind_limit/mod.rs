//! `blind_limit`: bounds the motion without a contact. Time and way are those of the node's own output, which later
//! limiters only reduce.

mod budget;
mod clear_box;
mod pads;

use nalgebra::Vector3;
use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Image, Pose, Scalar, Stamp, Twist};

use super::{fraction, max_age};
use crate::motion::bounds::countable;
use clear_box::ClearBox;
use pads::Pads;

pub use budget::{Bounds, Budget, Motion};
pub use pads::corners;

/// Bounds the time and the way of the motion since the last contact.
///
/// While nothing touches the pad, the arm may move for at most `blind_s` and by at most `blind_mm`, in all modes and
/// from the start of the run. Time counts only while a motion is commanded. The way is that of the fastest corner of
/// the pad, so a rotation counts too. Before a bound the motion slows down, so that it can stop with
/// `deceleration_m_per_s2` and `deceleration_rad_per_s2`; these must not exceed the accelerations of the
/// `acceleration_limit` behind it. The motion is scaled as a whole and keeps its direction. Until it brakes, the twist
/// passes unchanged.
///
/// A contact that lasts for 40 ms refills both budgets: `contact` must be set in samples at least 40 ms apart, and in
/// all between them. A contact or an image that is older than `max_age_ms` is none. Once a budget is spent the output
/// is zero and `spent` is set, until a contact or the operator word `resume` refills it. The policy `blind` decides
/// whether that stops this arm or ends the run.
///
/// The bench may declare a box that is known to be empty, for transfers and retreats: `clear_min_m` and `clear_max_m`
/// in its section `[facts.arm]`. Nothing counts while the whole pad is in it. A task cannot set it.
///
/// An arm with two pads also wires `second_contact`, `second_image` and `second_pose`. Then a lasting contact of either
/// pad refills the budgets, and the way is that of the fastest corner of both pads.
///
/// ```toml
/// [nodes.blind_limit]
/// type = "blind_limit"
/// in.twist = "workspace_limit.twist"
/// in.contact = "label.present"
/// in.image = "calibrate.image"
/// in.pose = "state.sensor_pose"
/// blind_s = 20.0
/// blind_mm = 100.0
/// deceleration_m_per_s2 = 0.5
/// deceleration_rad_per_s2 = 5.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct BlindLimit {
    bounds: Bounds,
    clear: Option<ClearBox>,
    pads: Pads,
    /// Maximum ages of the contact, the image and the pose of the first pad, and of those of the second one [ns].
    max_ages: [[i64; 3]; 2],
}

/// Parameters of `blind_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Longest time of a motion since the last contact.
    #[param(unit = "s", range = 0.001..=60.0)]
    blind_s: f64,
    /// Longest way of the pad's fastest corner since the last contact.
    #[param(unit = "mm", range = 0.001..=500.0)]
    blind_mm: f64,
    /// Linear deceleration with which the sensor can stop.
    #[param(unit = "m/s2", above = 0.0)]
    deceleration_m_per_s2: f64,
    /// Angular deceleration with which the sensor can stop.
    #[param(unit = "rad/s2", above = 0.0)]
    deceleration_rad_per_s2: f64,
    /// Corner with the smallest coordinates of a box that is known to be empty, `[x, y, z]` in the base.
    #[param(unit = "m", from_bench)]
    clear_min_m: Option<[f64; 3]>,
    /// Corner with the largest coordinates of that box.
    #[param(unit = "m", from_bench)]
    clear_max_m: Option<[f64; 3]>,
    /// Maximum age of the contact, the image and the pose; five periods of the slowest device behind each if not
    /// given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `blind_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: Option<In<'a, Twist>>,
    /// Whether something touches the pad; an absent flag is no contact.
    #[port(quantity = "contact", known, sampled)]
    contact: Option<In<'a, Flag>>,
    /// The whole image of the pad.
    #[port(unit = "_", frame = "A", quantity = "tactile_image", known, sampled)]
    image: Option<In<'a, Image>>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", known, sampled)]
    pose: Option<In<'a, Pose>>,
    /// Whether something touches the second pad of the arm; an absent flag is no contact.
    #[port(quantity = "contact", known, sampled, optional)]
    second_contact: Option<In<'a, Flag>>,
    /// The whole image of the second pad.
    #[port(unit = "_", frame = "C", quantity = "tactile_image", known, sampled, optional)]
    second_image: Option<In<'a, Image>>,
    /// Pose of the second pad in the base.
    #[port(frame = "C", reference = "B", quantity = "sensor_pose", known, sampled, optional)]
    second_pose: Option<In<'a, Pose>>,
}

/// What `blind_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion, slowed down before a budget is spent.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the motion that passes.
    #[port(unit = "1", frame = "_")]
    blind: Out<Scalar>,
    /// Whether a budget is spent.
    spent: Out<Flag>,
    /// Fraction that is left of the budgets, of the one of which less is left.
    #[port(unit = "1", frame = "_")]
    left: Out<Scalar>,
}

/// What `blind_limit` remembers.
#[derive(State)]
pub struct State {
    budget: Budget,
    /// Speed of the fastest corner in the last output [m/s].
    speed: f64,
    /// The last known corners of the second pad in the frame of the first one [m].
    second: Option<[Vector3<f64>; 4]>,
}

impl Node for BlindLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits {
        through: Some("twist"),
        holds: &["blind"],
        // It stands before the speed limit, so that only that one scales what it lets pass.
        breaks: &["speed", "acceleration"],
        spends: Some("spent"),
        ..Limits::NONE
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shapes = &setup.inputs;
        let wired = [shapes.second_contact.is_some(), shapes.second_image.is_some(), shapes.second_pose.is_some()];
        let pads = Pads::new([shapes.image.as_ref(), shapes.second_image.as_ref()], wired)?;
        let clear = ClearBox::new(params.clear_min_m, params.clear_max_m)?;
        (setup.outputs.blind, setup.outputs.left) = (fraction(), fraction());
        let max_age = |input| max_age(params.max_age_ms, setup.sample_period(input));
        let max_ages = [["contact", "image", "pose"], ["second_contact", "second_image", "second_pose"]]
            .map(|pad| pad.map(max_age));
        let Params { blind_s: time, blind_mm, deceleration_m_per_s2: linear, .. } = params;
        let bounds = Bounds { time, way: blind_mm * 1e-3, linear, angular: params.deceleration_rad_per_s2 };
        Ok(Self { bounds, clear, pads, max_ages })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_fresh = |stamp: Stamp, max_age: i64| stamp.age(tick.now) <= max_age;
        let [first, second] = self.max_ages;
        let touched = |contact: Option<In<'_, Flag>>, image: Option<In<'_, Image>>, ages: [i64; 3]| {
            let has_image = image.is_some_and(|image| is_fresh(image.stamp(), ages[1]));
            let contact = contact.filter(|contact| **contact && has_image && is_fresh(contact.stamp(), ages[0]));
            contact.map(|contact| contact.stamp().nanos)
        };
        let contacts =
            [touched(inputs.contact, inputs.image, first), touched(inputs.second_contact, inputs.second_image, second)];
        state.budget.touch(contacts, tick.is_resumed);
        let pose = inputs.pose.filter(|pose| is_fresh(pose.stamp(), first[2])).map(|pose| pose.value());
        let second = inputs.second_pose.filter(|pose| is_fresh(pose.stamp(), second[2])).map(|pose| pose.value());
        state.second = pose.zip(second).and_then(|(pose, second)| self.pads.second(pose, second)).or(state.second);
        let corners = self.pads.all(state.second.as_ref());
        let room = self.clear.as_ref().zip(pose).map_or(0.0, |(clear, pose)| clear.room(pose, &corners));
        if !tick.is_halted && room <= 0.0 {
            state.budget.spend(state.speed, tick.dt);
        }
        let motion = inputs.twist.map(|twist| countable(&twist));
        let (scale, speed) = motion.as_ref().map_or((1.0, 0.0), |twist| {
            let motion = Motion::of(twist, &corners, &self.bounds);
            (state.budget.scale(&motion, &self.bounds, room, 2.0 * tick.max_gap), motion.speed)
        });
        state.speed = scale * speed;
        out.spent.set(state.budget.is_spent());
        out.left.set(state.budget.left(&self.bounds));
        if let Some(twist) = motion {
            out.twist.set(if scale < 1.0 { Twist(twist.0 * scale) } else { twist });
            out.blind.set(scale);
        }
    }
}

#[cfg(test)]
mod tests;
