//! `contact_limit`: only the motion into the object is limited.
//!
//! At the point (x, y) of the pad, with z pointing out of the pad toward the object, the pad approaches the object at
//! vz + wx y - wy x. The point is the centre of gravity of the whole image for `force`, and the highest tactel for
//! `peak`. The excess is subtracted from vz: a roll then goes on about the contact.

mod ceilings;
mod gauge;
mod load;

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Image, Scalar, Twist};

use super::fraction;
use crate::motion::bounds::countable;
use crate::usual::{USUAL_FORCE_N, USUAL_M_PER_S, USUAL_PEAK_N};

pub use gauge::Reading;
pub(super) use gauge::{Gauge, Pressed};
pub use load::{PadLoad, load};

/// Stops the motion into an object when the force or a single tactel reaches its ceiling.
///
/// There are two ceilings: `force_n` for the sum of the whole image, and `peak_n` for its highest tactel. They take an
/// image in N. An image of raw readings takes `force_raw` and `peak_raw` instead: then nothing is limited in newtons, so
/// the bench must say `allow_uncalibrated = true`. For an image of pressures no sum is a force: `calibrate` converts it
/// to N.
///
/// From the fraction `begin` of a ceiling on the approach is slowed down linearly, and at the ceiling it is zero. The way out is always
/// free, and a roll goes on about the contact. The approach is the speed at the contact, vz + wx y - wy x with z
/// pointing out of the pad: at the centre of gravity for `force`, and at the highest tactel for `peak`.
///
/// It reads the whole image, because an object outside the selected region presses on the pad too. Negative tactels do
/// not count. When the image is older than `max_age_ms` the output is absent: a blind sensor does not move.
///
/// It does not predict the force that a stiff object adds while the motion brakes, which is about the stiffness times
/// the braking distance. For hard objects use a lower `begin` or a lower `approach_m_per_s`.
///
/// ```toml
/// [nodes.contact_limit]
/// type = "contact_limit"
/// in.twist = "lost_contact.twist"
/// in.image = "calibrate.image"
/// force_n = 15.0
/// peak_n = 3.0
/// approach_m_per_s = 0.05
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
    /// Fraction of a ceiling at which the approach begins to slow down; with 1 it stops at the ceiling at once.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.5)]
    begin: f64,
    /// Maximum speed of the approach at `begin`.
    #[param(unit = "m/s", above = 0.0, usual = ..=USUAL_M_PER_S)]
    approach_m_per_s: f64,
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
}

/// What `contact_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion with a limited approach.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the approach that passes under the ceiling of the sum.
    #[port(unit = "1", frame = "_")]
    force: Out<Scalar>,
    /// Fraction of the approach that passes under the ceiling of a tactel.
    #[port(unit = "1", frame = "_")]
    peak: Out<Scalar>,
}

impl Node for ContactLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = Reading;

    // The image and its age move on while a motion is held.
    const LIMITS: Limits = Limits {
        through: Some("twist"),
        holds: &["force", "peak"],
        breaks: &["workspace", "blind", "speed", "acceleration"],
        guards: Some("image"),
        ..Limits::NONE
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let gauge = Gauge::new(&params, &setup.inputs.image, setup.sample_period("image"), &mut setup.warnings)?;
        setup.is_uncalibrated = gauge.is_uncalibrated();
        (setup.outputs.force, setup.outputs.peak) = (fraction(), fraction());
        Ok(Self { gauge })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut Reading) {
        if !self.gauge.is_fresh(inputs.image.stamp(), tick.now) {
            return;
        }
        let mut twist = countable(&inputs.twist);
        let [sum, highest] = self.gauge.read(&inputs.image, state);
        let [force, peak] = [sum, highest].map(|pressed| bar(&mut twist, pressed.point, pressed.allowed));
        out.twist.set(twist);
        // A NaN in the image makes the fraction NaN, which ends the run.
        out.force.set(force + 0.0 * sum.load);
        out.peak.set(peak + 0.0 * highest.load);
    }
}

/// Returns the speed that a load of `times` its ceiling allows toward the object [m/s], or `None` if it allows any.
///
/// It falls linearly from `approach` [m/s], at the fraction `begin` of the ceiling, to 0 at the ceiling.
#[must_use]
pub fn allowed_speed(times: f64, begin: f64, approach: f64) -> Option<f64> {
    if times < begin || times <= 0.0 {
        return None;
    }
    Some(if times < 1.0 { approach * (1.0 - times) / (1.0 - begin) } else { 0.0 })
}

/// Limits the approach at a point of the pad to `allowed` [m/s]. Returns the fraction of the approach that passes.
pub fn bar(twist: &mut Twist, [x, y]: [f64; 2], allowed: Option<f64>) -> f64 {
    let Some(allowed) = allowed else { return 1.0 };
    let [_, _, vz, wx, wy, _] = twist.0.into();
    let speed = vz + wx * y - wy * x;
    if speed <= allowed {
        return 1.0;
    }
    twist.0[2] -= speed - allowed;
    allowed / speed
}
