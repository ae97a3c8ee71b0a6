//! `sim_bench`: the simulated bench as a device: a pad, an arm and objects.
//!
//! Between two exchanges the world advances in steps of at most `step_s`, at the velocity that was commanded last. An
//! image is taken at the rate `rate_hz`. It is available `latency_s` later, with the stamp of the time when it was
//! taken.

mod check;

use std::borrow::Cow;

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Output, Samples, Stepped};
use tactflow_runtime::node::{Describe, FilePath, Mistakes, Param, PortSpec};
use tactflow_runtime::signal::{Image, ImageShape, Joint, Kind, Pose, Scalar, ScalarShape, Unit};

use super::arm_model::ArmModel;
use super::foam::Foam;
use super::frames::{Beats, Frames};
use super::joints::SimArm;
use super::object::{Object, ObjectParams};
use super::pad_model::{PadModel, TARE_BOUND};
use super::readout::{Electronics, Readout};
use super::shape::pose3;
use super::world::World;
use crate::arm::mount::Mount;
use crate::devices::arm::{self, ArmPorts};
use crate::devices::{nanos, pad, period_of};
use crate::roles::ground_truth;
use crate::usual::{USUAL_PRESSURE_N, USUAL_THRESHOLD_N};
use tactflow_runtime::random::Random;

/// Parameters of `sim_bench`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Seed of the noise and of the random offsets of the objects.
    #[param(default = 1)]
    seed: u64,
    /// Duration of the run; unlimited if not given.
    #[param(unit = "s", above = 0.0)]
    for_s: Option<f64>,
    /// Objects to touch.
    #[param(default = vec![])]
    objects: Vec<ObjectParams>,
    /// Number of rows of the pad.
    #[param(range = 1..=1_000_000, default = 16)]
    rows: usize,
    /// Number of columns of the pad.
    #[param(range = 1..=1_000_000, default = 16)]
    cols: usize,
    /// Distance between the centres of neighbouring tactels, along x and along y.
    #[param(unit = "m", above = 0.0, default = 0.005)]
    pitch: f64,
    /// Frames per second.
    #[param(unit = "1/s", range = 0.001..=1e6, default = 250.0)]
    rate_hz: f64,
    /// Time from taking an image until it is available.
    #[param(unit = "s", range = 0.0.., default = 0.004)]
    latency_s: f64,
    /// Calibration file of the pad, stated as a fact for `calibrate`.
    calibration: Option<FilePath>,
    /// Noise threshold that the pad states as a fact.
    #[param(unit = "N", range = 0.0.., usual = ..=USUAL_THRESHOLD_N, default = 0.015)]
    threshold: f64,
    /// Number of frames of the self-test at the start, stated as a fact; 0 for none.
    #[param(default = pad::REST_FRAMES)]
    rest_frames: usize,
    /// Largest difference of a zero from that of the `calibration`, stated as a fact if there is one.
    #[param(unit = "raw", above = 0.0, default = TARE_BOUND)]
    tare_bound: f64,
    /// Unit of pressure that the pad states as a fact: p = 1 in the paper.
    #[param(unit = "N/tactel", above = 0.0, usual = ..=USUAL_PRESSURE_N, default = 0.1)]
    pressure: f64,
    /// Properties of the foam.
    #[param(default = Foam::DEFAULT)]
    foam: Foam,
    /// Largest distance between simulated points of the pad; a thin probe needs a smaller one than a ball.
    #[param(unit = "m", above = 0.0, default = 0.001)]
    points_apart: f64,
    /// Properties of the electronics.
    #[param(default = Electronics::DEFAULT)]
    electronics: Electronics,
    /// Model of the arm.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Pose of the sensor on that link.
    #[param(default = Mount::NONE)]
    mount: Mount,
    /// Posture that the arm prefers, stated as a fact; in m for a prismatic joint.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Joint positions at the start, one per joint; `home` if not given.
    #[param(unit = "rad")]
    start: Option<Vec<f64>>,
    /// Stiffness of the joints.
    #[param(unit = "N m/rad", above = 0.0, default = 200.0)]
    stiffness: f64,
    /// Damping of the joints as a fraction of the critical one.
    #[param(unit = "1", range = 0.0.., default = 0.2)]
    damping_ratio: f64,
    /// Inertia of each joint; that of the seven joints of an LWR if not given.
    #[param(unit = "kg m2")]
    inertia: Option<Vec<f64>>,
    /// Dry friction of the joints.
    #[param(unit = "N m", range = 0.0.., default = 0.1)]
    friction: f64,
    /// Largest acceleration that the arm states for each joint.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// Longest step of the simulation.
    #[param(unit = "s", above = 0.0, default = 0.002)]
    step_s: f64,
}

/// A simulated bench: a foam pad on an arm in joint impedance control, and objects to touch.
///
/// The bench closes the loop without hardware: commands move the arm and its pad, and contact gives an image and pushes
/// the arm back.
///
/// The pad is an elastic foundation of foam on a rigid plate, simulated at points at most 1 mm apart. Each point is a
/// stiffening spring in series with the stiffness of the object. The foam spreads a load over several tactels, and
/// friction sticks and slips at every tactel. Each tactel has its own saturating curve, hysteresis, creep and noise,
/// and reads 12 bits: the image is in raw counts, and `calibration` names the file that converts them to forces.
///
/// The arm is that of the paper. Every joint is a spring and a damper toward a posture that moves at the commanded
/// velocity, so the pad yields and tilts under a load.
///
/// Objects are placed relative to the sensor at the start, whose z points out of the pad: `at = [0.01, 0, 0.05]` is 1
/// cm along the sensor's x and 5 cm in front of it. They are fixed, stand on a compliant `mount`, or follow their
/// `motion`.
///
/// It runs in virtual time, and the same commands and seed give the same bits; with `--realtime` it is paced by the
/// clock. The pad states the facts `dead`, `threshold`, `pressure`, `calibration`, `rest_frames` and `tare_bound`, and the standard deviations of
/// its noise: `common_noise`, which all tactels share, as a fraction of the reading, and `own_noise` of each tactel in
/// raw counts. The pad also states its `mount`. The arm states `urdf`, `tip` and `home`, which is its start if no `home` is
/// given. In the role `ground_truth` it provides true values to
/// scenarios and recordings only.
///
/// Not simulated: gravity, coupling of the joints, rotation of objects under load, interaction between columns of foam,
/// wear and temperature.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
/// arm = "velocity_arm"
///
/// [commands]
/// arm.velocity = "joint_limit.velocity"
///
/// [bind]
/// pad = "bench"
/// arm = "bench"
///
/// [devices.bench]
/// type = "sim_bench"
/// for_s = 4.0                         # [s]
/// calibration = "builtin:calibrations/sim_pad.toml"
/// urdf = "builtin:lwr4p.urdf"         # a KUKA LWR 4+
/// tip = "lwr_7_link"
/// mount = { xyz = [0.0, 0.0, 0.03] }  # of the sensor on the tip [m]
/// start = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]   # [rad]
/// objects = [
///     { shape = "ball", radius = 0.04, at = [0.01, -0.005, 0.041] },   # 1 mm before the pad [m]
/// ]
/// ```
#[derive(Describe)]
pub struct SimBench {
    arm: ArmPorts,
    truth: TruthPorts,
    world: World,
    frames: Frames,
    joints: Vec<Joint>,
    beats: Beats,
    /// Number of exchanges that advanced the time.
    sequence: u64,
    threshold: f64,
}

/// The ports of the role `ground_truth`.
struct TruthPorts {
    /// Each scalar with its name.
    scalars: Vec<(Cow<'static, str>, Output<Scalar>)>,
    /// The noise-free image.
    image: Output<Image>,
}

impl TruthPorts {
    /// Adds the role to a description.
    fn fill(description: &mut Description, shape: &ImageShape) -> Self {
        let role = ground_truth();
        let mut truth = description.fills(role.name);
        let image = truth.output("image", ImageShape { unit: Unit::NEWTON, ..shape.clone() });
        let scalars = role.outputs.into_iter().filter(|port| port.kind == Kind::Scalar);
        let scalar = |port: PortSpec| {
            let unit = port.args[0].parse().expect("the role's units are units");
            (port.name.clone(), truth.output(port.name, ScalarShape::of(unit)))
        };
        Self { scalars: scalars.map(scalar).collect(), image }
    }
}

impl Device for SimBench {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let (pad, model) = (params.pad(), params.arm());
        let arm = model.load()?;
        check::check(&params, &pad, &model, arm.joints.joints.len())?;
        let (period, latency) = (period_of(params.rate_hz), nanos(params.latency_s));
        let mut description = Description::every(period as f64 * 1e-9);
        let image = pad::fill(&mut description, pad.shape.clone(), pad.facts(&params.mount)?);
        let joints = arm.joints.joints.clone();
        let ports = ArmPorts::fill(&mut description, &arm.joints, model.facts(&arm)?);
        let tactels = pad.shape.tactels();
        let readout = Readout::new(tactels, pad.electronics.clone(), params.seed);
        let bench = Self {
            arm: ports,
            truth: TruthPorts::fill(&mut description, &pad.shape),
            frames: Frames::new(image, readout, tactels, [period, latency]),
            joints,
            beats: Beats::new(period, params.for_s.map_or(i64::MAX, nanos)),
            sequence: 0,
            threshold: params.threshold,
            world: world(params, model.arm(arm), pad.shape)?,
        };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(bench)) })
    }
}

impl Params {
    fn pad(&self) -> PadModel {
        PadModel {
            shape: PadModel::shape(self.rows, self.cols, self.pitch),
            points_apart: self.points_apart,
            rate_hz: self.rate_hz,
            latency_s: self.latency_s,
            foam: self.foam.clone(),
            electronics: self.electronics.clone(),
            calibration: self.calibration.clone(),
            threshold: self.threshold,
            rest_frames: self.rest_frames,
            tare_bound: self.tare_bound,
            pressure: self.pressure,
        }
    }

    fn arm(&self) -> ArmModel {
        ArmModel {
            urdf: self.urdf.clone(),
            tip: self.tip.clone(),
            mount: self.mount.clone(),
            home: self.home.clone(),
            start: self.start.clone(),
            stiffness: self.stiffness,
            damping_ratio: self.damping_ratio,
            inertia: self.inertia.clone(),
            friction: self.friction,
            acceleration: self.acceleration,
        }
    }
}

/// Returns the world with its objects, which are placed relative to the sensor.
fn world(params: Params, arm: SimArm, shape: ImageShape) -> Result<World, Mistakes> {
    let from = arm.motion().pose;
    let mut scatter = Random::new(params.seed, 3);
    let place = |(i, object): (usize, &ObjectParams)| {
        let offset = [0, 1].map(|_| scatter.uniform(-object.scatter, object.scatter));
        Object::new(object, from, offset).map_err(|message| check::object(i, message))
    };
    let objects = params.objects.iter().enumerate().map(place).collect::<Result<Vec<_>, _>>()?;
    Ok(World::new(arm, objects, shape, params.foam, params.points_apart, params.step_s))
}

impl SimBench {
    /// Advances to `now` [ns] and takes the images that are due until then.
    fn advance(&mut self, now: i64, velocity: &[f64]) {
        let period = self.beats.period();
        for beat in self.beats.pass(now) {
            self.world.advance(beat as f64 * 1e-9, velocity);
            self.frames.take(beat, period, self.world.image());
        }
        if now % period != 0 {
            self.world.advance(now as f64 * 1e-9, velocity);
        }
    }
}

impl Stepped for SimBench {
    fn next(&self) -> Option<i64> {
        self.beats.next()
    }

    fn end(&self) -> Option<i64> {
        self.beats.end()
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.beats.is_past(now) {
            return Ok(());
        }
        let velocity = commands.joints(self.arm.velocity);
        arm::check_velocity(&self.joints, velocity)?;
        self.advance(now, velocity);
        if !self.world.is_sound() {
            return Err(DeviceError("the simulation diverged: make `step_s` smaller or the bench less stiff".into()));
        }
        self.sequence += 1;
        self.frames.show(now, samples);
        let SimArm { position, equilibrium, .. } = &self.world.arm;
        self.arm.write(samples, now, self.sequence, [position, equilibrium]);
        self.write_truth(now, commands.report(self.arm.contact), samples);
        Ok(())
    }
}

impl SimBench {
    /// Writes the ground truth: each scalar to the output of the role with its name, and the noise-free image.
    fn write_truth(&mut self, now: i64, report: Option<&Pose>, samples: &mut Samples) {
        let measured = report.and_then(|pose| self.world.measure(pose3(pose).translation));
        let truth = self.world.truth(self.threshold);
        let noise = truth.pressure.map(|pressure| self.frames.readout().noise(pressure, truth.tactels));
        let value = |name: &str| match name {
            "force" => Some(truth.force),
            "tangential" => Some(truth.tangential),
            "peak" => Some(truth.peak),
            "x" => truth.middle.map(|middle| middle.x),
            "y" => truth.middle.map(|middle| middle.y),
            "pressure" => truth.pressure,
            "orientation" => truth.orientation,
            "area" => Some(truth.area),
            "depth" => Some(truth.depth),
            "tilt" => truth.tilt,
            "path" => measured.and_then(|measured| measured.path),
            "distance" => measured.map(|measured| measured.distance),
            "coverage" => self.world.coverage(),
            "common_noise" => noise.map(|[common, _]| common),
            "own_noise" => noise.map(|[_, own]| own),
            other => unreachable!("the role has an output `{other}` that the bench does not know"),
        };
        for (name, port) in &self.truth.scalars {
            match value(name) {
                Some(value) => *samples.write(*port, now, self.sequence) = value,
                None => samples.clear(*port, now, self.sequence),
            }
        }
        let cells = samples.write(self.truth.image, now, self.sequence).cells_mut();
        cells.iter_mut().zip(self.world.image()).for_each(|(cell, force)| *cell = *force as f32);
    }
}
