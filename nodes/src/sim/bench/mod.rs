//! `sim_bench`: the simulated bench as a device: a pad, an arm and objects.
//!
//! Between two exchanges the world advances in steps of at most `step_s`, at the velocity that was commanded last. An
//! image is taken at the rate `rate_hz`. It is available `latency_s` later, with the stamp of the time when it was
//! taken.

mod check;

use std::borrow::Cow;
use std::collections::VecDeque;

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Output, Samples, Stepped};
use tactflow_runtime::node::{Describe, FilePath, Mistakes, Param, PortSpec};
use tactflow_runtime::signal::{Image, ImageShape, Joint, Kind, Pose, Scalar, ScalarShape, Unit};

use super::foam::Foam;
use super::joints::{JointDynamics, SimArm};
use super::object::{Object, ObjectParams};
use super::readout::{Electronics, Readout};
use super::shape::pose3;
use super::world::World;
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use crate::devices::arm::{self, ArmPorts};
use crate::devices::{Facts, nanos, pad, period_of};
use crate::random::Random;
use crate::roles::ground_truth;
use crate::usual::{USUAL_PRESSURE_N, USUAL_THRESHOLD_N};

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

/// Inertia of the joints of an LWR in a bent posture, with rotors [kg m²].
const INERTIA: [f64; 7] = [2.0, 2.0, 1.0, 0.8, 0.3, 0.25, 0.1];

/// Largest number of tactels of a simulated pad.
pub const MAX_TACTELS: usize = 128 * 128;

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
/// clock. The pad states the facts `dead`, `threshold`, `pressure` and `calibration`, and the standard deviations of
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
    image: Output<Image>,
    arm: ArmPorts,
    truth: TruthPorts,
    world: World,
    readout: Readout,
    joints: Vec<Joint>,
    period: i64,
    latency: i64,
    end: i64,
    last: Option<i64>,
    /// Images that are taken but not yet available, with their stamps.
    taken: VecDeque<(i64, Vec<f32>)>,
    /// Buffers for further images.
    spare: Vec<Vec<f32>>,
    /// Number of images that were handed over.
    shown: u64,
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
        let chain = load(&params.urdf, &params.tip, &params.mount)?;
        let start = arm::start_of(params.start.as_deref(), params.home.as_deref())?;
        let joints = arm::joints(&chain, params.acceleration, &start)?;
        let shape = ImageShape { rows: params.rows, cols: params.cols, pitch: [params.pitch; 2], unit: Unit::RAW };
        check::check(&params, joints.joints.len(), &shape)?;
        let (period, latency) = (period_of(params.rate_hz), nanos(params.latency_s));
        let mut description = Description::every(period as f64 * 1e-9);
        let image = pad::fill(&mut description, shape.clone(), pad_facts(&params)?);
        let facts = arm::facts(&params.urdf, &params.tip, Some(params.home.as_deref().unwrap_or(&start)))?;
        let arm = ArmPorts::fill(&mut description, &joints, facts);
        let frames = (latency / period) as usize + 2;
        let bench = Self {
            image,
            arm,
            truth: TruthPorts::fill(&mut description, &shape),
            readout: Readout::new(shape.tactels(), params.electronics.clone(), params.seed),
            joints: joints.joints,
            period,
            latency,
            end: params.for_s.map_or(i64::MAX, nanos),
            last: None,
            taken: VecDeque::with_capacity(frames),
            spare: vec![vec![0.0; shape.tactels()]; frames],
            shown: 0,
            sequence: 0,
            threshold: params.threshold,
            world: world(params, chain, start, shape)?,
        };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(bench)) })
    }
}

fn pad_facts(params: &Params) -> Result<Facts, Mistakes> {
    let mut calibration = toml::Table::new();
    if let Some(file) = &params.calibration {
        calibration.insert("file".into(), arm::fact_of("calibration", file)?.into());
    }
    let mut facts = pad::facts(params.threshold, params.pressure, Unit::NEWTON, calibration);
    let Electronics { common_noise, own_noise, .. } = params.electronics;
    facts.push(pad::mount(&params.mount));
    facts.extend([("common_noise".into(), common_noise.into()), ("own_noise".into(), own_noise.into())]);
    Ok(facts)
}

/// Returns the world with its objects, which are placed relative to the sensor.
fn world(params: Params, chain: Chain, start: Vec<f64>, shape: ImageShape) -> Result<World, Mistakes> {
    let joint = |inertia: f64| JointDynamics {
        stiffness: params.stiffness,
        damping_ratio: params.damping_ratio,
        inertia,
        friction: params.friction,
    };
    let inertia = params.inertia.as_deref().unwrap_or(&INERTIA);
    let arm = SimArm::new(chain, inertia.iter().copied().map(joint).collect(), start);
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
        let begin = self.last.unwrap_or(-1);
        let mut beat = (begin.div_euclid(self.period) + 1) * self.period;
        while beat <= now {
            self.world.advance(beat as f64 * 1e-9, velocity);
            let forces = self.world.image();
            let mut counts = match self.spare.pop() {
                Some(room) => room,
                // No buffer is free, so the oldest image, which was never read, is dropped.
                None => self.taken.pop_front().expect("all buffers are in `taken`").1,
            };
            self.readout.read(self.period as f64 * 1e-9, forces, &mut counts);
            self.taken.push_back((beat, counts));
            beat += self.period;
        }
        if beat - self.period < now {
            self.world.advance(now as f64 * 1e-9, velocity);
        }
        self.last = Some(now);
    }

    /// Hands over the images that are available at `now` [ns].
    fn show(&mut self, now: i64, samples: &mut Samples) {
        while self.taken.front().is_some_and(|(stamp, _)| stamp + self.latency <= now) {
            let (stamp, counts) = self.taken.pop_front().expect("the front was just checked");
            self.shown += 1;
            samples.write(self.image, stamp, self.shown).cells_mut().copy_from_slice(&counts);
            self.spare.push(counts);
        }
    }
}

impl Stepped for SimBench {
    fn next(&self) -> Option<i64> {
        let next = self.last.map_or(0, |last| (last / self.period + 1) * self.period);
        (next < self.end).then_some(next)
    }

    fn end(&self) -> Option<i64> {
        (self.end < i64::MAX).then(|| (self.end - 1) / self.period * self.period)
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.last.is_some_and(|last| now <= last) {
            return Ok(());
        }
        let velocity = commands.joints(self.arm.velocity);
        arm::check_velocity(&self.joints, velocity)?;
        self.advance(now, velocity);
        if !self.world.is_sound() {
            return Err(DeviceError("the simulation diverged: make `step_s` smaller or the bench less stiff".into()));
        }
        self.sequence += 1;
        self.show(now, samples);
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
        let noise = truth.pressure.map(|pressure| self.readout.noise(pressure, truth.tactels));
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
