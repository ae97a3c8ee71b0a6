//! `true_pad`: a simulated pad whose ground truth is known in closed form.

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Output, Samples, Stepped};
use tactflow_runtime::node::{Describe, Mistakes, Param};
use tactflow_runtime::random::Random;
use tactflow_runtime::signal::{Image, ImageShape, Scalar, ScalarShape, Unit};

/// Parameters of `true_pad`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Seed of the noise.
    #[param(default = 1)]
    seed: u64,
    /// Standard deviation of a tactel.
    #[param(unit = "N", range = 0.0.., default = 0.0)]
    noise: f64,
    /// Time at which the contact begins.
    #[param(unit = "s", range = 0.0.., default = 0.5)]
    from_s: f64,
    /// Time at which the contact ends; never if not given.
    #[param(unit = "s", above = 0.0)]
    to_s: Option<f64>,
    /// Position of the contact at its begin.
    #[param(unit = "m", default = 0.01)]
    at: f64,
    /// Time constant of the motion to the middle.
    #[param(unit = "s", above = 0.0, default = 0.25)]
    tau_s: f64,
    /// Time at which the device fails; never if not given.
    #[param(unit = "s", above = 0.0)]
    unplug_s: Option<f64>,
    /// Duration of the samples; unlimited if not given.
    #[param(unit = "s", above = 0.0)]
    for_s: Option<f64>,
}

/// A pad under a round contact that slides to the middle, with the ground truth of that contact.
///
/// From `from_s` on the contact is at `at · exp(-(t - from_s) / tau_s)` on the x axis, so every figure of a scenario is
/// known in closed form. The image has white noise from the seed; the ground truth has none.
#[derive(Debug, Describe)]
pub struct TruePad {
    params: Params,
    image: Output<Image>,
    /// Each scalar of the ground truth with its name.
    truth: Vec<(&'static str, Output<Scalar>)>,
    clean: Output<Image>,
    random: Random,
    next: i64,
}

const PERIOD: i64 = 4_000_000;
const SIDE: usize = 16;
const PITCH: f64 = 0.005;
const FORCE: f64 = 3.0;
const RADIUS: f64 = 0.012;

/// Names and units of the scalars of the ground truth.
const TRUTH: [(&str, &str); 15] = [
    ("force", "N"),
    ("tangential", "N"),
    ("peak", "N"),
    ("x", "m"),
    ("y", "m"),
    ("pressure", "N/tactel"),
    ("orientation", "rad mod pi"),
    ("area", "m2"),
    ("depth", "m"),
    ("tilt", "rad"),
    ("path", "m"),
    ("distance", "m"),
    ("coverage", "1"),
    ("common_noise", "N/tactel"),
    ("own_noise", "N/tactel"),
];

impl Device for TruePad {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let shape = ImageShape { rows: SIDE, cols: SIDE, pitch: [PITCH; 2], unit: Unit::NEWTON };
        let calibration = toml::Table::from_iter([("gain".to_owned(), 1.0.into())]);
        let mut description = Description::every(PERIOD as f64 * 1e-9);
        let mut pad = description.fills("tactile_pad");
        pad.fact("threshold", 0.015);
        pad.fact("pressure", 0.1);
        pad.fact("calibration", calibration);
        pad.fact("noise", params.noise);
        let image = pad.output("image", shape.clone());
        let mut truth = description.fills("ground_truth");
        let clean = truth.output("image", shape);
        let number = |(name, unit): (&'static str, &str)| {
            (name, truth.output(name, ScalarShape::of(unit.parse().expect("it is a unit"))))
        };
        let truth = TRUTH.map(number).into();
        let random = Random::new(params.seed, 0);
        let pad = Self { params, image, truth, clean, random, next: 0 };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(pad)) })
    }
}

impl TruePad {
    /// Returns the position of the contact at `time` [s], or `None` without contact [m].
    fn contact(&self, time: f64) -> Option<f64> {
        let since = time - self.params.from_s;
        let is_over = self.params.to_s.is_some_and(|to| time >= to);
        (since >= 0.0 && !is_over).then(|| self.params.at * libm::exp(-since / self.params.tau_s))
    }
}

/// Returns the noise-free image.
fn clean(x: f64) -> Vec<f32> {
    let place = |i: usize| (i as f64 - (SIDE - 1) as f64 / 2.0) * PITCH;
    let bump = |i: usize| {
        let (dx, dy) = (place(i % SIDE) - x, place(i / SIDE));
        let rest = (1.0 - (dx * dx + dy * dy) / (RADIUS * RADIUS)).max(0.0);
        rest * rest
    };
    let cells: Vec<f64> = (0..SIDE * SIDE).map(bump).collect();
    let sum: f64 = cells.iter().sum();
    cells.iter().map(|cell| (cell / sum * FORCE) as f32).collect()
}

impl Stepped for TruePad {
    fn next(&self) -> Option<i64> {
        let is_over = self.params.for_s.is_some_and(|end| self.next as f64 * 1e-9 >= end);
        (!is_over).then_some(self.next)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if now < self.next {
            return Ok(());
        }
        let (stamp, sequence) = (self.next, (self.next / PERIOD) as u64 + 1);
        self.next += PERIOD;
        let time = stamp as f64 * 1e-9;
        if self.params.unplug_s.is_some_and(|at| time >= at) {
            return Err(DeviceError("its plug is out".into()));
        }
        let contact = self.contact(time);
        let image = contact.map_or_else(|| vec![0.0; SIDE * SIDE], clean);
        let noisy: Vec<f32> =
            image.iter().map(|cell| cell + (self.params.noise * self.random.normal()) as f32).collect();
        samples.write(self.image, stamp, sequence).cells_mut().copy_from_slice(&noisy);
        samples.write(self.clean, stamp, sequence).cells_mut().copy_from_slice(&image);
        for (name, port) in &self.truth {
            let value = match *name {
                "force" => Some(if contact.is_some() { FORCE } else { 0.0 }),
                "x" => contact,
                "y" => contact.map(|_| 0.0),
                _ => None,
            };
            match value {
                Some(value) => *samples.write(*port, stamp, sequence) = value,
                None => samples.clear(*port, stamp, sequence),
            }
        }
        Ok(())
    }
}
