//! The gauge of a pad: its load, and the speed toward the object that this load allows.

use tactflow_runtime::node::{In, Mistakes, State};
use tactflow_runtime::signal::{Image, ImageShape, Stamp, Unit};

use super::super::max_age;
use super::ceilings::Ceilings;
use super::{PadLoad, Params, allowed_speed, load};

/// Reads the load of a pad, and compares it with its ceilings.
pub(in crate::limits) struct Gauge {
    ceilings: Ceilings,
    shape: ImageShape,
    begin: f64,
    approach: f64,
    /// Maximum age of the image [ns].
    max_age: i64,
}

/// What a gauge remembers.
#[derive(State)]
pub struct Reading {
    /// Stamp of the image that `load` was computed from, if there was one.
    stamp: Option<Stamp>,
    /// Load of that image.
    load: PadLoad,
}

/// A point of a pad that presses on an object, and what it may do there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::limits) struct Pressed {
    /// The point in the frame of the pad [m].
    pub(in crate::limits) point: [f64; 2],
    /// Speed toward the object that the load allows [m/s]; `None` if it allows any.
    pub(in crate::limits) allowed: Option<f64>,
    /// The load [unit of the image].
    pub(in crate::limits) load: f64,
}

impl Gauge {
    /// Creates the gauge of an image of this shape, whose samples come every `period` [s].
    pub(in crate::limits) fn new(
        params: &Params,
        shape: &ImageShape,
        period: f64,
        warnings: &mut Mistakes,
    ) -> Result<Self, Mistakes> {
        let ceilings = Ceilings::new(params, shape.unit, warnings)?;
        let &Params { begin, approach_m_per_s: approach, .. } = params;
        Ok(Self { ceilings, shape: shape.clone(), begin, approach, max_age: max_age(params.max_age_ms, period) })
    }

    /// Whether the image has raw readings, so that nothing is limited in newtons.
    pub(in crate::limits) fn is_uncalibrated(&self) -> bool {
        self.shape.unit == Unit::RAW
    }

    /// Returns whether a sample is young enough at the time `now` [ns].
    pub(in crate::limits) const fn is_fresh(&self, stamp: Stamp, now: i64) -> bool {
        stamp.age(now) <= self.max_age
    }

    /// Returns the point under the ceiling of the sum, and the point under that of a tactel.
    pub(in crate::limits) fn read(&self, image: &In<'_, Image>, reading: &mut Reading) -> [Pressed; 2] {
        let (Ceilings { force, peak }, stamp) = (self.ceilings, image.stamp());
        if image.is_new() || reading.stamp != Some(stamp) {
            reading.stamp = Some(stamp);
            reading.load = load(&self.shape, image, [self.begin * force, self.begin * peak]);
        }
        let PadLoad { sum, centre, peak: highest, place } = reading.load;
        let pressed = |point, load: f64, ceiling: f64| Pressed {
            point,
            allowed: allowed_speed(load / ceiling, self.begin, self.approach),
            load,
        };
        [pressed(centre, sum, force), pressed(place, highest, peak)]
    }
}
