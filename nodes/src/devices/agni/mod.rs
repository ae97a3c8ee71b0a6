//! `agni`: tactile sensors of the AGNI serial protocol, such as the Myrmex v2 and the tactile glove.
//!
//! | module | what it holds |
//! |---|---|
//! | `messages` | the messages of the protocol, without any I/O |
//! | `layout` | where the readings are in a payload |
//! | `sensors` | which sensor is which pad |
//! | `port`, `session` | the port and the handshake |
//! | `driver` | the driver |
//! | `listen` | what is understood of any bytes, without a port |

mod driver;
mod layout;
mod listen;
mod messages;
mod port;
mod sensors;
mod session;

use std::time::Duration;

use tactflow_runtime::device::{Description, Device, Driver, Opened, Output};
use tactflow_runtime::node::{At, Describe, FilePath, Map, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Image, ImageShape, Unit};
use tactflow_runtime::source::Code;

use self::driver::{Agni as AgniDriver, PadPort};
use self::layout::LayoutParams;
pub(crate) use self::listen::listen;
use self::sensors::{Pad, SensorParams, pads};
use super::{arm, pad};
use crate::arm::mount::Mount;

/// Parameters of `agni`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The port: `serial:/dev/serial/by-id/…`, or `tcp:HOST:PORT` for a server that passes on a serial port.
    link: String,
    /// The sensors that the bench uses, one for each pad.
    #[param(default = vec![SensorParams::default()])]
    sensors: Vec<SensorParams>,
    /// Layouts of other sensors, by their names.
    #[param(default = Map(std::collections::BTreeMap::new()))]
    layouts: Map<LayoutParams>,
    /// Frames per second of each sensor. The device is asked for them if `sets_rate` is true.
    #[param(unit = "Hz", range = 0.16..=10_000.0, default = 250.0)]
    rate_hz: f64,
    /// Whether the device is asked to send `rate_hz` frames per second. Not all firmware can.
    #[param(default = false)]
    sets_rate: bool,
    /// Unit of the stamps of the device, which the protocol does not state. Without it, frames have the time of their
    /// arrival.
    #[param(unit = "ms", above = 0.0)]
    stamp_unit_ms: Option<f64>,
    /// Time without a frame after which a pad is lost.
    #[param(unit = "ms", above = 0.0, default = 200.0)]
    silence_ms: f64,
    /// Time from the measurement of a frame to its arrival.
    #[param(unit = "ms", range = 0.0..=1e3, default = 0.0)]
    latency_ms: f64,
    /// Distance between the centres of neighbouring tactels, along x and along y.
    #[param(unit = "m", above = 0.0, default = 0.005)]
    pitch: f64,
    /// Calibration file, stated as a fact for `calibrate`. Its readings are from 0 to 1, in the unit `1`.
    calibration: Option<FilePath>,
    /// Force on a tactel that reads 1, if there is no `calibration`: a straight line for all tactels.
    #[param(unit = "N", above = 0.0)]
    full_scale: Option<f64>,
    /// Force on a tactel that is above its noise. The default is 5 % of `full_scale`, or 0.015 N with a `calibration`.
    #[param(unit = "N", range = 0.0..)]
    threshold: Option<f64>,
    /// Number of frames of the self-test at the start, stated as a fact; 0 for none.
    #[param(default = pad::REST_FRAMES)]
    rest_frames: usize,
    /// Largest difference of a zero from the calibrated one, stated as a fact. The default is three times the noise of a
    /// reading, 0.15, or 0.0125 with a `calibration`.
    #[param(unit = "1", above = 0.0)]
    tare_bound: Option<f64>,
    /// Unit of pressure that the pad states as a fact: p = 1 in the paper. The default is 0.1, or three times the threshold
    /// if that is more: a mean of tactels above the threshold is never below it.
    #[param(unit = "N/tactel", above = 0.0)]
    pressure: Option<f64>,
    /// Pose of the pad on the tip of its arm, stated as a fact.
    #[param(default = Mount::NONE)]
    mount: Mount,
}

/// Tactile sensors of the AGNI serial protocol: the Myrmex v2 and the tactile glove.
///
/// The device stops the sensors, asks for their configuration, and starts them. The configuration says how many sensors
/// there are, and how many bytes each sends. A pad takes the first free sensor whose length is that of its layout, or
/// the one that `number` or `uid` names. If there is none, the run ends with the list of the sensors that the device
/// has.
///
/// A Myrmex v2 has 16 by 16 tactels, 5 mm apart. Its readings have 12 bits and fall with the force, so the image is 1 -
/// reading / 4095, in the unit `1`. It is not calibrated: give a `calibration`, which `tactflow calibrate` makes from a
/// log with a reference force, or the `full_scale` of a tactel. Without them, a task runs only on a bench with
/// `allow_uncalibrated = true`, and its limits are fractions of the full reading. The layout `glove` sorts the 64
/// tactels of a glove by their ids, in 8 rows of 8. `layouts` describes other sensors.
///
/// Several sensors on one device are several pads, each with a `side`, and a bench binds `left_pad = "skin.left"`.
///
/// A frame with a wrong checksum is dropped, and so is one whose words have other channels than those before, unless a
/// second one in a row has them too (that they stay the same has not been seen on a sensor). After bytes that are no
/// frame, the next frame only shows where frames begin, and is not used. When the port is gone, or no frame comes for
/// `silence_ms`, the pads are lost, and the device connects again. A device with another serial number ends the run:
/// nothing is known of its zeros. It counts `frames`, `rejected frames`, `resyncs`, `skipped bytes`, `bad frames`,
/// `errors of the device` and `reconnects`. At the end of a run it stops the sensors.
///
/// The unit of the stamps is not documented. With `stamp_unit_ms`, the age of a frame is computed from them. It states
/// the facts `dead`, `threshold`, `pressure`, `calibration`, `mount`, `rest_frames` and `tare_bound`.
///
/// It is tested against a simulated device, and has not run on a sensor.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
///
/// [bind]
/// pad = "skin"
///
/// [devices.skin]
/// type = "agni"
/// link = "serial:/dev/serial/by-id/usb-TactileModuleV2-B012-if00"
/// full_scale = 3.0                    # of a tactel, until it is calibrated [N]
/// ```
#[derive(Describe)]
pub struct Agni;

impl Device for Agni {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let mut mistakes = Mistakes::new();
        let address = port::address(&params.link).map_err(|mistake| mistakes.push(mistake)).ok();
        let found = pads(params.sensors.clone(), &params.layouts).map_err(|found| mistakes.extend(found)).ok();
        mistakes.extend(params.check());
        let (Some(address), Some(pads), true) = (address, found, mistakes.is_empty()) else { return Err(mistakes) };
        let mut description = Description::every(1.0 / params.rate_hz);
        description.latency = params.latency_ms * 1e-3;
        let mut ports = Vec::new();
        for pad in pads {
            let image = params.state(&mut description, &pad)?;
            ports.push(PadPort::new(pad, image));
        }
        let mut driver = AgniDriver::new(address, ports);
        driver.period = params.sets_rate.then(|| (1e4 / params.rate_hz).round().clamp(1.0, 65_535.0) as u16);
        driver.stamp_unit = params.stamp_unit_ms.map(|unit| unit * 1e6);
        driver.silence = Duration::from_secs_f64(params.silence_ms * 1e-3);
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

impl Params {
    /// Returns the mistakes in the parameters of the forces.
    fn check(&self) -> Mistakes {
        let mut mistakes = Mistakes::new();
        if self.calibration.is_some() && self.full_scale.is_some() {
            let message = "`calibration` and `full_scale` exclude each other";
            mistakes
                .push(Mistake::key("full_scale", message).help("leave out `full_scale`: the file has its own curves"));
        }
        if self.threshold.is_some() && !self.is_calibrated() {
            let message = "the pad has no forces, so it has no `threshold` in N";
            let mistake = Mistake::new(Code::MissingKey, At::Param("threshold".into()), message);
            mistakes.push(mistake.help("name a `calibration`, or give the `full_scale` of a tactel"));
        }
        mistakes
    }

    fn is_calibrated(&self) -> bool {
        self.calibration.is_some() || self.full_scale.is_some()
    }

    /// Adds the role of a pad to a description.
    fn state(&self, description: &mut Description, pad: &Pad) -> Result<Output<Image>, Mistakes> {
        /// Noise of a reading: what a Myrmex shows without a load [1].
        const NOISE: f64 = 0.05;
        /// Force on a tactel that is above the noise of a calibrated pad [N].
        const THRESHOLD_N: f64 = 0.015;
        /// Usual pressure: p = 1 in the paper [N per tactel].
        const PRESSURE: f64 = 0.1;
        /// Largest difference of the zero of a calibrated tactel: 50 of its 4096 steps [1].
        const TARE_BOUND: f64 = 0.0125;
        let mut calibration = toml::Table::new();
        if let Some(file) = &self.calibration {
            calibration.insert("file".into(), arm::fact_of("calibration", file)?.into());
        }
        if let Some(gain) = self.full_scale {
            calibration.insert("gain".into(), gain.into());
            calibration.insert("unit".into(), "N".into());
        }
        let default =
            self.full_scale.map_or(if self.is_calibrated() { THRESHOLD_N } else { NOISE }, |full| NOISE * full);
        let unit = if self.is_calibrated() { Unit::NEWTON } else { Unit::ONE };
        let rounded = |value: f64| (value * 1e6).round() / 1e6;
        let threshold = self.threshold.unwrap_or_else(|| rounded(default));
        let pressure = self.pressure.unwrap_or_else(|| rounded(3.0 * threshold).max(PRESSURE));
        let mut facts = pad::facts(threshold, pressure, unit, calibration);
        facts.push(pad::mount(&self.mount));
        let bound = if self.calibration.is_some() { TARE_BOUND } else { 3.0 * NOISE };
        facts.extend(pad::rest(self.rest_frames, Some(self.tare_bound.unwrap_or(bound)), Unit::ONE));
        let layout = &pad.layout;
        let shape = ImageShape { rows: layout.rows, cols: layout.cols, pitch: [self.pitch; 2], unit: Unit::ONE };
        let fill = match &pad.side {
            Some(side) => description.fills_on(side.clone(), pad::ROLE),
            None => description.fills(pad::ROLE),
        };
        Ok(pad::fill(fill, shape, facts))
    }
}

#[cfg(test)]
mod tests;
