//! What every pad states: the role `tactile_pad` or `three_axis_pad`, its images and its facts.

use std::borrow::Cow;

use tactflow_runtime::device::{Fill, Output};
#[cfg(feature = "drivers")]
use tactflow_runtime::node::{FilePath, Mistakes};
use tactflow_runtime::signal::{Image, ImageShape, Unit, VectorImage, VectorImageShape};

use super::Facts;
#[cfg(feature = "drivers")]
use super::arm::fact_of;
use crate::arm::mount::Mount;

/// The type of the role of a pad.
pub(crate) const ROLE: &str = "tactile_pad";

/// The type of the role of a pad with three axes.
pub(crate) const THREE_AXES: &str = "three_axis_pad";

/// States what a pad with three axes gives in its role, each in the unit of the image. Returns the handles of its image and
/// of its vector image.
pub(crate) fn fill_three_axes(
    mut pad: Fill<'_>,
    shape: ImageShape,
    facts: Facts,
) -> (Output<Image>, Output<VectorImage>) {
    pad.facts(facts);
    (pad.output("image", shape.clone()), pad.output("vectors", VectorImageShape(shape)))
}

/// States what a pad gives in its role. Returns the handle of its image.
pub(crate) fn fill(mut pad: Fill<'_>, shape: ImageShape, facts: Facts) -> Output<Image> {
    pad.facts(facts);
    pad.output("image", shape)
}

/// Returns the fact of where a pad sits on its arm.
pub(crate) fn mount(mount: &Mount) -> (Cow<'static, str>, toml::Value) {
    let mount = [("xyz", mount.xyz), ("rpy", mount.rpy)];
    let mount: toml::Table = mount.into_iter().map(|(name, list)| (name.to_owned(), list.to_vec().into())).collect();
    ("mount".into(), mount.into())
}

/// Returns the facts of a pad without dead tactels. The threshold is in `unit`, and the pressure in `unit` per tactel.
pub(crate) fn facts(threshold: f64, pressure: f64, unit: Unit, calibration: toml::Table) -> Facts {
    vec![
        ("dead".into(), toml::Value::Array(vec![])),
        ("threshold".into(), format!("{threshold} {unit}").into()),
        ("pressure".into(), format!("{pressure} {}", unit.per_tactel()).into()),
        ("calibration".into(), calibration.into()),
    ]
}

/// What a pad of any make states of itself.
#[cfg(feature = "drivers")]
pub(crate) struct PadFacts<'p> {
    pub(crate) unit: Unit,
    pub(crate) threshold: Option<f64>,
    pub(crate) pressure: Option<f64>,
    pub(crate) calibration: Option<&'p FilePath>,
    pub(crate) mount: Option<&'p Mount>,
    pub(crate) rest_frames: usize,
    pub(crate) tare_bound: Option<f64>,
}

#[cfg(feature = "drivers")]
impl PadFacts<'_> {
    /// Returns the facts. With a calibration, the threshold and the pressure are in N.
    ///
    /// # Errors
    /// If the path of the calibration cannot be a fact.
    pub(crate) fn facts(&self) -> Result<Facts, Mistakes> {
        let mut calibration = toml::Table::new();
        match self.calibration {
            Some(file) => calibration.insert("file".to_owned(), fact_of("calibration", file)?.into()),
            None => calibration.insert("gain".to_owned(), 1.0.into()),
        };
        // What `calibrate` makes of the image.
        let unit = if self.calibration.is_some() { Unit::NEWTON } else { self.unit };
        let mut facts: Facts =
            vec![("dead".into(), toml::Value::Array(Vec::new())), ("calibration".into(), calibration.into())];
        facts.extend(self.threshold.map(|threshold| ("threshold".into(), format!("{threshold} {unit}").into())));
        let pressure = self.pressure.map(|pressure| format!("{pressure} {}", unit.per_tactel()));
        facts.extend(pressure.map(|pressure| ("pressure".into(), pressure.into())));
        facts.extend(self.mount.map(mount));
        facts.extend(rest(self.rest_frames, self.tare_bound, self.unit));
        Ok(facts)
    }
}

/// Number of frames of the self-test of a pad, if its bench does not set it.
pub(crate) const REST_FRAMES: usize = 40;

/// Returns the facts of the self-test of a pad: its number of frames, and how far a zero may be off, in `unit`.
pub(crate) fn rest(frames: usize, bound: Option<f64>, unit: Unit) -> Facts {
    let mut facts: Facts = vec![("rest_frames".into(), (frames as i64).into())];
    facts.extend(bound.map(|bound| ("tare_bound".into(), format!("{bound} {unit}").into())));
    facts
}

/// Fraction of the full scale of all tactels by which their sum can change from frame to frame [1]. Garbage changes it by
/// more. So does a blow, which then costs one frame.
const MAX_RISE: f64 = 0.125;

/// Returns the facts of what a frame of a pad with so many tactels can be: the largest reading, in `unit`, and the
/// largest change of the sum.
pub(crate) fn frames(max_reading: f64, tactels: usize, unit: Unit) -> Facts {
    let max_rise = MAX_RISE * max_reading * tactels as f64;
    [("max_reading", max_reading), ("max_rise", max_rise)]
        .map(|(name, value)| (name.into(), format!("{value} {unit}").into()))
        .into()
}
