//! `lost_contact`: what a motion may do once a contact is lost. It reads the contact and no force, so it does not depend
//! on what the controller makes of features that are absent.

mod course;

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{
    Flag, Image, ImageShape, Jacobian, Joints, Pose, Scalar, ScalarShape, Stamp, Twist, Unit,
};

use super::max_age;
use crate::motion::bounds::countable;
use crate::motion::normal::lead;
use crate::usual::USUAL_M_PER_S;

pub use course::{Course, Phase, Times};

/// Keeps the motion from pushing into the void when a contact is lost.
///
/// A contact counts once it has lasted for 40 ms; before the first one everything passes. From the first tick without
/// the contact, no corner of the pad moves into the object: vz is at most -(|wx| h/2 + |wy| w/2), with the width w and
/// the height h of the pad. If the contact does not come back within `debounce_ms`, it is lost. Then:
///
/// 1. The arm gives back its lead, the way by which a compliant arm has pressed ahead of its position. It moves out along
///    -z at `retreat_m_per_s`, so that the spring does not push the sensor to where the object was. A stiff arm has no lead.
/// 2. It rests until `wait_ms` after the first tick without the contact, or after the last tick in which anything touched
///    the pad since. If the object is pushed back during the rest, it meets a sensor that has not moved on. From 3 s
///    after the loss on, a touch that flickers no longer begins the rest anew.
/// 3. It searches: a motion with a part into the object is slowed down as a whole, until no corner of the pad is faster
///    than `search_m_per_s`.
///
/// The wanted motion out of the object always passes. Once a contact has lasted for 40 ms again, everything does. Just
/// after a first touch the pad may bounce: a contact that is lost within half a second is searched at once, without a retreat
/// and a rest. A contact that comes back within 100 ms is the same contact, and no first touch.
///
/// The lead is n · J (equilibrium - position) with the normal n of the pad, in the first tick without the contact: once it
/// is given back, the spring brings the sensor to rest where the contact was lost. A contact or an image that is older than
/// `max_age_ms` is no contact. The output can jump, so an `acceleration_limit` stands behind this node.
///
/// ```toml
/// [nodes.lost_contact]
/// type = "lost_contact"
/// in.twist = "bumpless.twist"
/// in.contact = "label.present"
/// in.image = "calibrate.image"
/// in.pose = "state.sensor_pose"
/// in.jacobian = "state.jacobian"
/// in.position = "arm.position"
/// in.equilibrium = "arm.equilibrium"
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct LostContact {
    times: Times,
    manner: Manner,
    /// Maximum ages of the contact, the image and the pose [ns].
    max_ages: [i64; 3],
}

/// Parameters of `lost_contact`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Time without the contact after which it is lost.
    #[param(unit = "ms", range = 0.001..=1000.0, default = 20.0)]
    debounce_ms: f64,
    /// Time from the first tick without the contact, or from a touch after it, until the arm searches.
    #[param(unit = "ms", range = 0.0..=60000.0, default = 1500.0)]
    wait_ms: f64,
    /// Speed at which the lead is given back.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S, default = 0.02)]
    retreat_m_per_s: f64,
    /// Maximum speed of the search.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S, default = 0.005)]
    search_m_per_s: f64,
    /// Maximum age of the contact, the image and the pose; five periods of the slowest device behind each if not
    /// given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `lost_contact` reads.
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
    /// Spatial Jacobian of the sensor in the base.
    #[port(frame = "B", robot = "R", sampled)]
    jacobian: Option<In<'a, Jacobian>>,
    /// Measured joint positions; those of prismatic joints are in m.
    #[port(unit = "rad", robot = "R", quantity = "position", known, sampled)]
    position: Option<In<'a, Joints>>,
    /// Posture that the commands have moved the arm to.
    #[port(unit = "rad", robot = "R", quantity = "equilibrium", known, sampled)]
    equilibrium: Option<In<'a, Joints>>,
}

/// What `lost_contact` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion that is left of the wanted one, or the retreat.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Whether a contact is missing that has lasted before.
    lost: Out<Flag>,
    /// What is left to give back of the lead of a compliant arm; 0 while something touches.
    #[port(unit = "m", frame = "_")]
    lead: Out<Scalar>,
}

/// What `lost_contact` remembers.
#[derive(State)]
pub struct State {
    course: Course,
    /// The phase of the last tick.
    phase: Option<Phase>,
    /// What is left to give back of the lead [m].
    lead: f64,
}

impl Node for LostContact {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits {
        through: Some("twist"),
        breaks: &["force", "peak", "wrench", "workspace", "blind", "speed", "acceleration"],
        ..Limits::NONE
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let half = setup.inputs.image.as_ref().map_or([0.0; 2], ImageShape::half);
        setup.outputs.lead = ScalarShape::of(Unit::METRE);
        let max_ages = ["contact", "image", "pose"].map(|input| max_age(params.max_age_ms, setup.sample_period(input)));
        let [debounce, wait] = [params.debounce_ms, params.wait_ms].map(|ms| (ms * 1e6) as i64);
        let manner = Manner { retreat: params.retreat_m_per_s, search: params.search_m_per_s, half };
        Ok(Self { times: Times { debounce, wait }, manner, max_ages })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let [contact_age, image_age, pose_age] = self.max_ages;
        let is_fresh = |stamp: Stamp, max_age: i64| stamp.age(tick.now) <= max_age;
        let touches = inputs.contact.is_some_and(|contact| *contact && is_fresh(contact.stamp(), contact_age))
            && inputs.image.is_some_and(|image| is_fresh(image.stamp(), image_age));
        let phase = state.course.next(tick.now, touches, state.lead > 0.0, &self.times);
        let is_first_without = phase == Phase::Barred && state.phase == Some(Phase::Touched);
        state.phase = Some(phase);
        if phase == Phase::Touched {
            state.lead = 0.0;
        }
        if is_first_without
            && let Some(((pose, jacobian), (position, equilibrium))) =
                inputs.pose.zip(inputs.jacobian).zip(inputs.position.zip(inputs.equilibrium))
            && is_fresh(pose.stamp(), pose_age)
        {
            state.lead = lead(&pose, &jacobian, &position, &equilibrium).max(0.0);
        }
        let wanted = inputs.twist.map(|twist| countable(&twist));
        let retreat = (phase == Phase::Retreat).then(Twist::default);
        if let Some(wanted) = wanted.or(retreat) {
            let twist = allowed(&wanted, phase, &self.manner);
            if phase == Phase::Retreat && !tick.is_halted {
                state.lead = (state.lead + twist.linear().z * tick.dt.min(tick.max_gap)).max(0.0);
            }
            out.twist.set(twist);
        }
        out.lost.set(!matches!(phase, Phase::Free | Phase::Touched));
        out.lead.set(state.lead);
    }
}

/// Speeds after a loss [m/s], and half of the width and of the height of the pad [m].
#[derive(Debug, Clone, Copy)]
pub struct Manner {
    /// Speed at which the lead is given back.
    pub retreat: f64,
    /// Maximum speed of the search.
    pub search: f64,
    /// Half of the width and of the height of the pad [m].
    pub half: [f64; 2],
}

/// Returns what a phase leaves of the wanted motion.
pub fn allowed(wanted: &Twist, phase: Phase, manner: &Manner) -> Twist {
    match phase {
        Phase::Free | Phase::Touched => *wanted,
        Phase::Barred => kept_out(wanted, manner.half),
        Phase::Retreat => out_along_z(wanted.linear().z.min(-manner.retreat)),
        Phase::Rest => out_along_z(wanted.linear().z.min(0.0)),
        Phase::Search => slowed_down(wanted, manner.half, manner.search),
    }
}

fn out_along_z(speed: f64) -> Twist {
    Twist([0.0, 0.0, speed, 0.0, 0.0, 0.0].into())
}

/// Returns the speed into the object of the corner of a pad that moves into it fastest [m/s]. `half` is half of the
/// width and of the height of the pad [m].
#[must_use]
pub fn approach(twist: &Twist, half: [f64; 2]) -> f64 {
    let [_, _, vz, wx, wy, _] = twist.0.into();
    vz + wx.abs() * half[1] + wy.abs() * half[0]
}

/// Returns the motion without its part into the object: no corner of the pad moves into it.
pub fn kept_out(twist: &Twist, half: [f64; 2]) -> Twist {
    let mut twist = *twist;
    twist.0[2] -= approach(&twist, half).max(0.0);
    twist
}

/// Returns the motion, scaled so that no corner of the pad is faster than `speed` [m/s] if one moves into the object.
pub fn slowed_down(twist: &Twist, half: [f64; 2], speed: f64) -> Twist {
    if approach(twist, half) <= 0.0 {
        return *twist;
    }
    let corners = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    let corners = corners.map(|[x, y]| nalgebra::Vector3::new(x * half[0], y * half[1], 0.0));
    let speeds = corners.map(|corner| (twist.linear() + twist.angular().cross(&corner)).norm());
    let fastest = speeds.into_iter().fold(0.0, f64::max);
    if fastest > speed { Twist(twist.0 * (speed / fastest)) } else { *twist }
}

#[cfg(test)]
mod tests;
