//! The model of a simulated pad: its parameters, what the simulation supports of them, and its facts.

use tactflow_runtime::node::{FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{ImageShape, Unit};

use super::foam::Foam;
use super::readout::{Electronics, MAX_COUNT};
use crate::arm::mount::Mount;
use crate::devices::{Facts, arm, pad};
use crate::usual::{USUAL_PRESSURE_N, USUAL_THRESHOLD_N};

/// Largest number of tactels of a simulated pad.
pub const MAX_TACTELS: usize = 128 * 128;
/// Default of the largest difference of a zero from the calibrated one: three times the usual threshold [raw].
const TARE_BOUND: f64 = 50.0;
/// Largest number of points of a simulated pad.
const MAX_POINTS: f64 = 4e6;
/// Largest latency of an image [frames].
const MAX_LATENCY_FRAMES: f64 = 1000.0;

/// The parameters of a simulated pad.
#[derive(Debug, Clone, Param)]
pub struct PadModel {
    /// Number of rows of a pad.
    #[param(range = 1..=1_000_000, default = 16)]
    rows: usize,
    /// Number of columns of a pad.
    #[param(range = 1..=1_000_000, default = 16)]
    cols: usize,
    /// Distance between the centres of neighbouring tactels, along x and along y.
    #[param(unit = "m", above = 0.0, default = 0.005)]
    pitch: f64,
    /// Frames per second.
    #[param(unit = "1/s", range = 0.001..=1e6, default = 250.0)]
    pub rate_hz: f64,
    /// Time from taking an image until it is available.
    #[param(unit = "s", range = 0.0.., default = 0.004)]
    pub latency_s: f64,
    /// Calibration file of a pad, stated as a fact for `calibrate`.
    calibration: Option<FilePath>,
    /// Noise threshold that a pad states as a fact.
    #[param(unit = "N", range = 0.0.., usual = ..=USUAL_THRESHOLD_N, default = 0.015)]
    pub threshold: f64,
    /// Number of frames of the self-test at the start, stated as a fact; 0 for none.
    #[param(default = pad::REST_FRAMES)]
    rest_frames: usize,
    /// Largest difference of a zero from that of the `calibration`, stated as a fact if there is one.
    #[param(unit = "raw", above = 0.0, default = TARE_BOUND)]
    tare_bound: f64,
    /// Unit of pressure that a pad states as a fact: p = 1 in the paper.
    #[param(unit = "N/tactel", above = 0.0, usual = ..=USUAL_PRESSURE_N, default = 0.1)]
    pressure: f64,
    /// Properties of the foam, with its friction on an object.
    #[param(default = Foam::default())]
    pub foam: Foam,
    /// Largest distance between simulated points of a pad; a thin probe needs a smaller one than a ball.
    #[param(unit = "m", above = 0.0, default = 0.001)]
    pub points_apart: f64,
    /// Properties of the electronics.
    #[param(default = Electronics::default())]
    pub electronics: Electronics,
}

impl PadModel {
    /// Returns the shape of an image in raw counts.
    #[must_use]
    pub const fn shape(&self) -> ImageShape {
        ImageShape { rows: self.rows, cols: self.cols, pitch: [self.pitch; 2], unit: Unit::RAW }
    }

    /// Returns the number of tactels.
    #[must_use]
    pub const fn tactels(&self) -> usize {
        self.rows * self.cols
    }

    /// Returns the area of a pad [m²].
    #[must_use]
    pub fn area(&self) -> f64 {
        self.tactels() as f64 * self.pitch.powi(2)
    }

    /// Returns the mistakes in the parameters: what the simulation does not support.
    #[must_use]
    pub fn check(&self) -> Mistakes {
        let Self { rows, cols, pitch, points_apart, foam, .. } = self;
        let points = (pitch / points_apart).ceil().max(1.0).powi(2) * self.tactels() as f64;
        let limits = [
            (
                self.tactels() <= MAX_TACTELS,
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
        facts.extend(pad::frames(MAX_COUNT, self.tactels(), Unit::RAW));
        facts.extend([("common_noise".into(), common_noise.into()), ("own_noise".into(), own_noise.into())]);
        facts.push(("foam_n_per_m3".into(), self.foam.per_area().into()));
        Ok(facts)
    }
}
