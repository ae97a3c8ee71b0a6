//! The model of a simulated pad: its parameters, what the simulation supports of them, and its facts.

use tactflow_runtime::node::{FilePath, Mistake, Mistakes};
use tactflow_runtime::signal::{ImageShape, Unit};

use super::foam::Foam;
use super::readout::Electronics;
use crate::arm::mount::Mount;
use crate::devices::{Facts, arm, pad};

/// Largest number of tactels of a simulated pad.
pub const MAX_TACTELS: usize = 128 * 128;
/// Default of the largest difference of a zero from the calibrated one: three times the usual threshold [raw].
pub(super) const TARE_BOUND: f64 = 50.0;
/// Largest number of points of a simulated pad.
const MAX_POINTS: f64 = 4e6;
/// Largest latency of an image [frames].
const MAX_LATENCY_FRAMES: f64 = 1000.0;

/// The parameters of a simulated pad.
#[derive(Debug, Clone)]
pub struct PadModel {
    /// Its tactels.
    pub shape: ImageShape,
    /// Largest distance between simulated points [m].
    pub points_apart: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Time from taking an image until it is available [s].
    pub latency_s: f64,
    /// The foam.
    pub foam: Foam,
    /// The electronics.
    pub electronics: Electronics,
    /// Calibration file that the pad states.
    pub calibration: Option<FilePath>,
    /// Noise threshold that the pad states [N].
    pub threshold: f64,
    /// Number of frames of the self-test that the pad states.
    pub rest_frames: usize,
    /// Largest difference of a zero from the calibrated one that the pad states [raw].
    pub tare_bound: f64,
    /// Unit of pressure that the pad states [N per tactel].
    pub pressure: f64,
}

impl PadModel {
    /// Returns the shape of an image in raw counts.
    #[must_use]
    pub fn shape(rows: usize, cols: usize, pitch: f64) -> ImageShape {
        ImageShape { rows, cols, pitch: [pitch; 2], unit: Unit::RAW }
    }

    /// Returns the mistakes in the parameters: what the simulation does not support.
    #[must_use]
    pub fn check(&self) -> Mistakes {
        let Self { points_apart, foam, shape, .. } = self;
        let (rows, cols, pitch) = (shape.rows, shape.cols, shape.pitch[0]);
        let points = (pitch / points_apart).ceil().max(1.0).powi(2) * shape.tactels() as f64;
        let limits = [
            (
                shape.tactels() <= MAX_TACTELS,
                "rows",
                format!("{rows} by {cols} tactels are more than the {MAX_TACTELS} that can be simulated"),
            ),
            (
                points <= MAX_POINTS,
                "pitch",
                format!("a pitch of {pitch} m with points {points_apart} m apart needs more than {MAX_POINTS} points"),
            ),
            (
                self.latency_s * self.rate_hz <= MAX_LATENCY_FRAMES,
                "latency_s",
                format!("the latency must be at most {MAX_LATENCY_FRAMES} frames"),
            ),
            (foam.damping <= 10.0, "foam.damping", "the damping under a tactel must be at most 10 N s/m".into()),
            ((0.0002..=0.05).contains(&foam.spread), "foam.spread", "the spread must be from 0.0002 to 0.05 m".into()),
            (
                foam.static_friction >= foam.sliding_friction,
                "foam.static_friction",
                "static friction must not be less than sliding friction".into(),
            ),
            (
                (0.0001..=0.001).contains(points_apart),
                "points_apart",
                "points must be from 0.0001 to 0.001 m apart".into(),
            ),
        ];
        let broken = limits.into_iter().filter(|(holds, ..)| !holds);
        broken.map(|(_, name, message)| Mistake::param(name, message)).collect()
    }

    /// Returns the facts of a pad that sits on its arm at `mount`.
    ///
    /// # Errors
    /// If the path of the calibration cannot be stated.
    pub fn facts(&self, mount: &Mount) -> Result<Facts, Mistakes> {
        let mut calibration = toml::Table::new();
        if let Some(file) = &self.calibration {
            calibration.insert("file".into(), arm::fact_of("calibration", file)?.into());
        }
        let mut facts = pad::facts(self.threshold, self.pressure, Unit::NEWTON, calibration);
        let Electronics { common_noise, own_noise, .. } = self.electronics;
        facts.push(pad::mount(mount));
        let bound = self.calibration.is_some().then_some(self.tare_bound);
        facts.extend(pad::rest(self.rest_frames, bound, Unit::RAW));
        facts.extend([("common_noise".into(), common_noise.into()), ("own_noise".into(), own_noise.into())]);
        Ok(facts)
    }
}
