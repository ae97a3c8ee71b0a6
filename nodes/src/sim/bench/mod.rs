//! `sim_bench`: the simulated bench as a device: a pad, an arm and objects.
//!
//! Between two exchanges the world advances in steps of at most `step_s`, at the velocity that was commanded last. An
//! image is taken at the rate `rate_hz`. It is available `latency_s` later, with the stamp of the time when it was
//! taken.

mod check;

use std::borrow::Cow;

use nalgebra::IsometryMatrix3;
use parry3d_f64::math::Vec3;
use tactflow_runtime::device::{
    Commands, Description, Device, DeviceError, Disturbance, Driver, Opened, Output, Samples, Stepped,
};
use tactflow_runtime::node::{Describe, Mistakes, Param, PortSpec};
use tactflow_runtime::signal::{Image, ImageShape, Joint, Kind, Pose, Scalar, ScalarShape, Unit};

use super::arm_model::ArmModel;
use super::frames::{Beats, Frames};
use super::housing::{Housing, HousingModel};
use super::joints::SimArm;
use super::object::{Object, ObjectParams};
use super::pad_model::PadModel;
use super::readout::{Electronics, Readout};
use super::shape::pose3;
use super::vector_readout::{VectorElectronics, VectorReadout};
use super::world::World;
use crate::devices::arm::{self, ArmPorts};
use crate::devices::wrench::{WrenchPorts, moved};
use crate::devices::{nanos, pad, period_of};
use crate::roles::ground_truth;
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
    /// The pad.
    #[param(flatten)]
    pad: PadModel,
    /// The arm.
    #[param(flatten)]
    arm: ArmModel,
    /// The housing of the pad, a hard capsule in the frame of the tip that objects touch; none if not given.
    housing: Option<HousingModel>,
    /// The electronics of a pad with three axes, which also fills the role `three_axis_pad`; `{ }` for those of their
    /// defaults. Without it the pad has one axis.
    vectors: Option<VectorElectronics>,
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
/// In the role `force_sensor` it measures the wrench of all contacts at the tip: of the pad, and of a `housing`, a hard
/// capsule around the tool that the pad does not see. The tool has no weight and no inertia of its own.
///
/// The controller compensates gravity, up to a `gravity_error`, and a `load` at the sensor couples the joints. An object
/// with a `turn_mount` turns under a load. `gain_error` lets the tactels differ from their calibration.
///
/// Not simulated: coupling of the joints by the masses of the links, Coriolis forces, interaction between columns of foam, friction on
/// the housing, wear and temperature.
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
    wrench: WrenchPorts,
    /// Pose of the pad on the tip.
    mount: IsometryMatrix3<f64>,
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
        let Params { pad, arm: model, .. } = &params;
        let (arm, shape) = (model.load()?, pad.shape());
        check::check(&params, arm.joints.joints.len())?;
        let (period, latency) = (period_of(pad.rate_hz), nanos(pad.latency_s));
        let mut description = Description::every(period as f64 * 1e-9);
        description.latency = pad.latency_s;
        let facts = pad.facts(&model.body.mount)?;
        let (image, vectors) = match &params.vectors {
            None => (pad::fill(description.fills(pad::ROLE), shape.clone(), facts), None),
            Some(electronics) => {
                let facts = facts.into_iter().chain(electronics.facts(&pad.foam)).collect();
                let (image, vectors) = pad::fill_three_axes(description.fills(pad::THREE_AXES), shape.clone(), facts);
                let Electronics { serial, .. } = pad.electronics;
                (image, Some((vectors, VectorReadout::new(pad.tactels(), electronics, serial, params.seed))))
            }
        };
        let joints = arm.joints.joints.clone();
        let ports = ArmPorts::fill(description.fills(arm::ROLE), &arm.joints, model.facts(&arm)?);
        let tactels = pad.tactels();
        let readout = Readout::new(tactels, pad.electronics.clone(), params.seed);
        let bench = Self {
            arm: ports,
            truth: TruthPorts::fill(&mut description, &shape),
            wrench: WrenchPorts::fill(&mut description, Vec::new()),
            mount: model.body.mount.pose(),
            frames: Frames::new(image, readout, tactels, [period, latency]).with_vectors(vectors),
            joints,
            beats: Beats::new(period, params.for_s.map_or(i64::MAX, nanos)),
            sequence: 0,
            threshold: pad.threshold,
            world: world(&params, model.arm(arm, -Vec3::Z), shape)?,
        };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(bench)) })
    }
}

/// Returns the world with its objects, which are placed relative to the sensor.
fn world(params: &Params, arm: SimArm, shape: ImageShape) -> Result<World, Mistakes> {
    let from = arm.motion().pose;
    let mut scatter = Random::new(params.seed, 3);
    let place = |(i, object): (usize, &ObjectParams)| {
        let offset = [0, 1].map(|_| scatter.uniform(-object.scatter, object.scatter));
        Object::new(object, from, offset).map_err(|message| check::object(i, message))
    };
    let objects = params.objects.iter().enumerate().map(place).collect::<Result<Vec<_>, _>>()?;
    let housing = params.housing.as_ref().map(|model| Housing::new(model, &params.arm.body.mount));
    let world = World::new(arm, objects, shape, params.pad.foam.clone(), params.pad.points_apart, params.step_s);
    Ok(world.with_housing(housing).with_drag(params.vectors.is_some()))
}

impl SimBench {
    /// Advances to `now` [ns] and takes the images that are due until then.
    fn advance(&mut self, now: i64, velocity: &[f64]) {
        let period = self.beats.period();
        for beat in self.beats.pass(now) {
            self.world.advance(beat as f64 * 1e-9, velocity);
            self.frames.take(beat, period, self.world.forces());
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

    fn disturb(&mut self, disturbance: &Disturbance) -> bool {
        self.world.disturb(disturbance);
        true
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
        self.wrench.write(samples, now, self.sequence, &moved(&self.world.wrench(), &self.mount));
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
        cells.iter_mut().zip(&self.world.forces().normal).for_each(|(cell, force)| *cell = *force as f32);
    }
}
