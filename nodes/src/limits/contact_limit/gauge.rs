//! The gauge of a pad: its load, and the speed toward the object that this load allows.

use tactflow_runtime::node::{In, Mistakes, State, Tick, refuse_any};
use tactflow_runtime::signal::{Image, ImageShape, Jacobian, Pose, Stamp, Unit};

use super::super::max_age;
use super::ceiling::Ceiling;
use super::ceilings::Ceilings;
use super::{PadLoad, Params, centre, highest, load};
use crate::motion::normal::give;

/// Value of a tactel that counts as touched, as a fraction of its ceiling, if the threshold is not given [1].
const DEFAULT_THRESHOLD: f64 = 0.01;
/// How many times as stiff the foam is under one tactel at its ceiling as under a light load [1]. Foam of 8 mm stiffens
/// by this much up to 3 N on 25 mm².
const STIFFENING: f64 = 8.0;
/// Largest approach toward what presses on an image of raw readings, if it is not given [m/s].
const DEFAULT_RAW_APPROACH: f64 = 0.01;
/// Time constant of a load that falls [s]. A rise is believed at once: a pad whose noise dips below the ceiling would
/// otherwise press harder with each dip.
const FALL_S: f64 = 0.1;

/// Reads the load of a pad, and compares it with its ceilings.
pub(in crate::limits) struct Gauge {
    /// Of the sum of the whole image.
    force: Ceiling,
    /// Of a single tactel.
    peak: Ceiling,
    shape: ImageShape,
    /// Time between two ticks [s].
    period: f64,
    /// Maximum age of the image [ns].
    max_age: i64,
    /// A tactel above this value is touched [unit of the image].
    threshold: f64,
    /// Compliance of the joints of a compliant arm [rad/(N m)].
    joints: Option<f64>,
    /// Fraction of a fall of the load that counts with each image [1].
    fall: f64,
}

/// What a gauge remembers.
#[derive(State)]
pub struct Reading {
    /// Stamp of the image that `load` was computed from, if there was one.
    stamp: Option<Stamp>,
    /// Load of that image.
    load: PadLoad,
    /// The load with its falls low-passed.
    held: PadLoad,
}

/// A load of the pad, and what it allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::limits) struct Pressed {
    /// The load [unit of the image].
    pub(in crate::limits) load: f64,
    /// Speed toward the object that it allows [m/s].
    pub(in crate::limits) allowed: f64,
    at: Place,
}

/// Where a load is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// Nothing is known to touch the pad, so each of its points may be the first that does.
    Anywhere,
    /// At the centre of gravity of the image.
    Centre,
    /// At the highest tactel.
    Highest,
}

impl Gauge {
    /// Creates the gauge of an image of this shape, whose samples come every `sample_period` [s]. The graph ticks every
    /// `period` [s].
    pub(in crate::limits) fn new(
        params: &Params,
        shape: &ImageShape,
        [period, sample_period]: [f64; 2],
        warnings: &mut Mistakes,
    ) -> Result<Self, Mistakes> {
        let ceilings = Ceilings::new(params, shape.unit, warnings)?;
        // An image that is not sampled in each tick is older by a period at most.
        let delay = 2.0 * period + (sample_period - period).max(0.0);
        let [force, peak] = stiffnesses(params, shape, &ceilings, delay);
        let approach = params.approach_m_per_s.unwrap_or(f64::INFINITY);
        let ceiling =
            |load, stiffness| Ceiling { load, stiffness, deceleration: params.deceleration_m_per_s2, approach };
        let (force, peak) = (ceiling(ceilings.force, force), ceiling(ceilings.peak, peak));
        if params.approach_m_per_s.is_some() && shape.unit == Unit::NEWTON {
            let refused = [force.refuse("force_n", shape.unit, delay), peak.refuse("peak_n", shape.unit, delay)];
            refuse_any(refused.into_iter().flatten().take(1))?;
        }
        let max_age = max_age(params.max_age_ms, sample_period);
        let threshold = params.threshold.unwrap_or(DEFAULT_THRESHOLD * peak.load);
        let joints = params.joint_n_m_per_rad.filter(|_| shape.unit == Unit::NEWTON).map(f64::recip);
        Ok(Self {
            force,
            peak,
            shape: shape.clone(),
            period,
            max_age,
            threshold,
            joints,
            fall: sample_period / (FALL_S + sample_period),
        })
    }

    /// Whether the image has raw readings, so that nothing is limited in newtons.
    pub(in crate::limits) fn is_uncalibrated(&self) -> bool {
        self.shape.unit == Unit::RAW
    }

    /// Returns half of the width and of the height of the pad [m].
    pub(in crate::limits) fn half(&self) -> [f64; 2] {
        self.shape.half()
    }

    /// Returns whether a sample is young enough at the time `now` [ns].
    pub(in crate::limits) const fn is_fresh(&self, stamp: Stamp, now: i64) -> bool {
        stamp.age(now) <= self.max_age
    }

    /// Returns the sum of the image, and its highest tactel, each with the speed that it allows.
    ///
    /// The load is as old as the image. A command acts until the next tick, and the arm follows one tick later. `arm` is
    /// the pose of the pad and its Jacobian.
    pub(in crate::limits) fn read(
        &self,
        image: &In<'_, Image>,
        arm: Option<(&Pose, &Jacobian)>,
        tick: &Tick,
        reading: &mut Reading,
    ) -> [Pressed; 2] {
        let stamp = image.stamp();
        if image.is_new() || reading.stamp != Some(stamp) {
            reading.stamp = Some(stamp);
            reading.load = load(image);
            reading.held = reading.load.held(reading.held, self.fall);
        }
        let delay = stamp.age(tick.now) as f64 * 1e-9 + 2.0 * self.period.max(tick.dt);
        let PadLoad { sum, peak } = reading.load;
        let touches = peak > self.threshold;
        // Before the touch the mass of the arm counts, and not its spring.
        let gives_way = self.joints.zip(arm).filter(|_| touches);
        let compliance = gives_way.map_or(0.0, |(joints, (pose, jacobian))| joints * give(pose, jacobian));
        let pressed = |ceiling: &Ceiling, load: f64, held: f64, place: Place| Pressed {
            load,
            allowed: ceiling.in_series(compliance).allowed_speed(held, delay),
            at: if touches { place } else { Place::Anywhere },
        };
        let held = reading.held;
        [pressed(&self.force, sum, held.sum, Place::Centre), pressed(&self.peak, peak, held.peak, Place::Highest)]
    }

    /// Returns where a load is on the pad [m]; `None` if that can be anywhere.
    pub(in crate::limits) fn point(&self, pressed: &Pressed, image: &Image) -> Option<[f64; 2]> {
        match pressed.at {
            Place::Anywhere => None,
            Place::Centre => Some(centre(&self.shape, image)),
            Place::Highest => Some(highest(&self.shape, image, pressed.load)),
        }
    }
}

/// Returns how much the sum of the image and its highest tactel grow on the way into an object [unit of the image per
/// m].
///
/// A calibrated image has the stiffness of the foam, or that of the stiffest contact if it is known and smaller. How
/// much raw readings grow is not known: there the ceiling is reached where the approach from the first touch ends.
fn stiffnesses(params: &Params, shape: &ImageShape, ceilings: &Ceilings, delay: f64) -> [f64; 2] {
    if shape.unit == Unit::RAW {
        let v = params.approach_m_per_s.unwrap_or(DEFAULT_RAW_APPROACH);
        let way = v * delay + v * v / (2.0 * params.deceleration_m_per_s2);
        return [ceilings.force / way, ceilings.peak / way];
    }
    let tactel = params.foam_n_per_m3 * shape.pitch[0] * shape.pitch[1];
    let pad = tactel * (shape.rows * shape.cols) as f64;
    [pad, STIFFENING * tactel].map(|foam| params.contact_n_per_m.map_or(foam, |contact| contact.min(foam)))
}
