//! `contact_limit`: only the motion into the object is limited.
//!
//! At the point (x, y) of the pad, with z pointing out of the pad toward the object, the pad approaches the object at
//! vz + wx y - wy x. The point is the centre of gravity of the whole image for `force`, and the highest tactel for
//! `peak`. The excess is subtracted from vz: a roll then goes on about the contact. While nothing touches the pad, each
//! corner can be the first that does, and the whole motion is scaled.

mod ceiling;
mod ceilings;
mod gauge;
mod load;

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Image, Jacobian, Pose, Scalar, Twist};

use super::fraction;
use super::lost_contact::approach;
use crate::motion::bounds::countable;
use crate::usual::{USUAL_FORCE_N, USUAL_M_PER_S, USUAL_PEAK_N};

pub use ceiling::Ceiling;
pub(super) use gauge::Gauge;
pub use gauge::Reading;
pub use load::{PadLoad, centre, highest, load};

/// Stops the motion into an object when the force or a single tactel reaches its ceiling.
///
/// There are two ceilings: `force_n` for the sum of the whole image, and `peak_n` for its highest tactel. They take an
/// image in N. An image of raw readings takes `force_raw` and `peak_raw` instead: then nothing is limited in newtons, so
/// the bench must say `allow_uncalibrated = true`. For an image of pressures no sum is a force: `calibrate` converts it
/// to N.
///
/// The approach has room to brake at every load: it keeps its speed v for a time τ, slows down with the deceleration a,
/// and is at rest before the load has grown to the ceiling. With the stiffness k of the contact this is
/// k (v τ + v²/(2a)) = ceiling - load. τ is the age of the image and two periods of the graph, one until the next command
/// and one until the arm follows. So a slow pad or a slow graph makes the approach slow, also before the first touch.
/// The way out is always free.
///
/// For the sum, k is that of the foam under the whole pad, `foam_n_per_m3` times its area: a flat rigid object. If the
/// cell has only small or soft objects, `contact_n_per_m` is the stiffness of the stiffest contact, with the foam. For a
/// tactel, k is 8 times that of the foam under it, because foam stiffens. How much raw readings grow is not known. For
/// them the ceiling is taken to be reached where an approach at `approach_m_per_s` from the first touch ends.
///
/// The approach is the speed at the contact, vz + wx y - wy x with z pointing out of the pad: at the centre of gravity
/// for `force`, and at the highest tactel for `peak`. A roll goes on about the contact. While no tactel is above
/// `threshold`, the approach is that of the fastest corner.
///
/// It reads the whole image, because an object outside the selected region presses on the pad too. Negative tactels do
/// not count. When the image is older than `max_age_ms` the output is absent: a blind sensor does not move.
///
/// A compliant arm gives way. While a tactel is touched, the arm is a spring in series with the foam. Its stiffness
/// along z follows from that of the joints, `joint_n_m_per_rad`, in the posture of `in.pose` and `in.jacobian`. Before
/// the touch the arm counts as stiff, because its mass presses first. The force of that hit is not computed.
///
/// ```toml
/// [nodes.contact_limit]
/// type = "contact_limit"
/// in.twist = "lost_contact.twist"
/// in.image = "calibrate.image"
/// force_n = 15.0
/// peak_n = 3.0
/// deceleration_m_per_s2 = 2.0
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct ContactLimit {
    gauge: Gauge,
}

/// Parameters of `contact_limit` and `second_contact_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Ceiling of the sum of an image in N.
    #[param(unit = "N", above = 0.0, usual = ..=USUAL_FORCE_N)]
    force_n: Option<f64>,
    /// Ceiling of a single tactel of an image in N.
    #[param(unit = "N", above = 0.0, usual = ..=USUAL_PEAK_N)]
    peak_n: Option<f64>,
    /// Ceiling of the sum of an image of raw readings.
    #[param(unit = "raw", above = 0.0)]
    force_raw: Option<f64>,
    /// Ceiling of a single tactel of an image of raw readings.
    #[param(unit = "raw", above = 0.0)]
    peak_raw: Option<f64>,
    /// Deceleration with which the sensor can stop.
    #[param(unit = "m/s2", above = 0.0)]
    deceleration_m_per_s2: f64,
    /// Stiffness of the foam of the pad under a light load, of an area of 1 m².
    #[param(unit = "N/m3", above = 0.0, default = 1.2e7)]
    foam_n_per_m3: f64,
    /// Stiffness of the stiffest contact that the pad can make, with its foam; that of the foam alone if not given.
    #[param(unit = "N/m", above = 0.0)]
    contact_n_per_m: Option<f64>,
    /// A tactel above this value counts as touched; a hundredth of the ceiling of a tactel if not given.
    #[param(unit = "U", above = 0.0, from_bench)]
    threshold: Option<f64>,
    /// Stiffness of the joints of a compliant arm, the largest one; in N/m for prismatic joints. The arm is stiff if not
    /// given.
    #[param(unit = "N m/rad", above = 0.0)]
    joint_n_m_per_rad: Option<f64>,
    /// Maximum speed of the approach at any load. The graph does not load if it cannot stop below a ceiling.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S)]
    approach_m_per_s: Option<f64>,
    /// Maximum age of the image; five periods of the slowest device behind it if not given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `contact_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// The whole calibrated image.
    #[port(unit = "U", frame = "A", quantity = "tactile_image", known, sampled)]
    image: In<'a, Image>,
    /// Pose of the sensor in the base; it counts for a compliant arm.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", known, sampled, optional)]
    pose: Option<In<'a, Pose>>,
    /// Spatial Jacobian of the sensor in the base; it counts for a compliant arm.
    #[port(frame = "B", robot = "_", sampled, optional)]
    jacobian: Option<In<'a, Jacobian>>,
}

/// What `contact_limit` and `second_contact_limit` write.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion with a limited approach of the pad.
    #[port(frame = "A")]
    pub(in crate::limits) twist: Out<Twist>,
    /// Fraction of the approach that passes under the ceiling of the sum.
    #[port(unit = "1", frame = "_")]
    pub(in crate::limits) force: Out<Scalar>,
    /// Fraction of the approach that passes under the ceiling of a tactel.
    #[port(unit = "1", frame = "_")]
    pub(in crate::limits) peak: Out<Scalar>,
}

impl Node for ContactLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = Reading;

    // The image and its age move on while a motion is held, and the poses of two pads.
    const LIMITS: Limits = Limits {
        through: Some("twist"),
        holds: &["force", "peak"],
        breaks: &["wrench", "workspace", "blind", "speed", "acceleration"],
        guards: Some("image"),
        ..Limits::NONE
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let periods = [setup.period, setup.sample_period("image")];
        let gauge = Gauge::new(&params, &setup.inputs.image, periods, &mut setup.warnings)?;
        setup.is_uncalibrated = gauge.is_uncalibrated();
        (setup.outputs.force, setup.outputs.peak) = (fraction(), fraction());
        Ok(Self { gauge })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut Reading) {
        if !self.gauge.is_fresh(inputs.image.stamp(), tick.now) {
            return;
        }
        let mut twist = countable(&inputs.twist);
        let arm = inputs.pose.as_deref().zip(inputs.jacobian.as_deref());
        let [sum, highest] = self.gauge.read(&inputs.image, arm, tick, state);
        let [force, peak] = [&sum, &highest].map(|pressed| {
            bar(&mut twist, self.gauge.half(), pressed.allowed, || self.gauge.point(pressed, &inputs.image))
        });
        out.twist.set(twist);
        // A NaN in the image makes the fraction NaN, which ends the run.
        out.force.set(force + 0.0 * sum.load);
        out.peak.set(peak + 0.0 * highest.load);
    }
}

/// Limits the approach of a pad, whose `half` sizes are in m, to `allowed` [m/s]. Returns the fraction of the approach
/// that passes.
///
/// If no corner is faster than `allowed`, nothing changes, and `point` is not called. Otherwise `point` returns where the
/// object presses on the pad [m], and the approach at that point is limited. If it returns `None`, the whole motion is
/// scaled until no corner is too fast.
pub fn bar(twist: &mut Twist, half: [f64; 2], allowed: f64, point: impl FnOnce() -> Option<[f64; 2]>) -> f64 {
    let fastest = approach(twist, half);
    if fastest <= allowed {
        return 1.0;
    }
    let Some([x, y]) = point() else {
        twist.0 *= allowed / fastest;
        return allowed / fastest;
    };
    let [_, _, vz, wx, wy, _] = twist.0.into();
    let speed = vz + wx * y - wy * x;
    if speed <= allowed {
        return 1.0;
    }
    twist.0[2] -= speed - allowed;
    allowed / speed
}
