//! `sim_pair`: a simulated cell of two arms with a pad each, and a free object that both pads can hold.
//!
//! Between two exchanges the cell advances in steps of at most `step_s`, at the velocities that were commanded last.
//! Both pads take their images at the same times.

pub mod body;
pub mod carried;
pub mod side;
pub mod table;
pub mod truth;
pub mod world;

#[cfg(test)]
mod tests;

use parry3d_f64::math::Vec3;
use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Samples, Stepped};
use tactflow_runtime::node::{Describe, FilePath, Mistakes, Param, refuse_any};
use tactflow_runtime::signal::{Joint, Pose};

use self::carried::CarriedParams;
use self::side::SideParams;
use self::table::Table;
use self::truth::ObjectPorts;
use self::world::{ArmAndPad, PairWorld};
use super::arm_model::{ArmBody, ArmModel, LoadedArm};
use super::frames::{Beats, Frames};
use super::joints::SimArm;
use super::pad_model::PadModel;
use super::readout::Readout;
use super::shape::pose3;
use super::steps::check_step;
use crate::devices::arm::{self, ArmPorts};
use crate::devices::{nanos, pad, period_of};
use crate::usual::USUAL_REACH_M;
use tactflow_runtime::random::Random;

/// Parameters of `sim_pair`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Seed of the noise and of the random offset of the object.
    #[param(default = 1)]
    seed: u64,
    /// Duration of the run; unlimited if not given.
    #[param(unit = "s", above = 0.0)]
    for_s: Option<f64>,
    /// The free object, which rests on the table at the start.
    object: CarriedParams,
    /// Height of the top of the table in the cell.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M, default = 0.0)]
    table_height: f64,
    /// Coefficient of friction between the table and the object.
    #[param(unit = "1", range = 0.0.., default = 0.4)]
    table_friction: f64,
    /// The arm and the pad of the side `left`.
    left: SideParams,
    /// The arm and the pad of the side `right`.
    right: SideParams,
    /// Both pads.
    #[param(flatten)]
    pad: PadModel,
    /// Model of both arms.
    urdf: Option<FilePath>,
    /// Link that carries the sensor.
    tip: Option<String>,
    /// Both arms, beside their models.
    #[param(flatten)]
    arm: ArmBody,
    /// Longest step of the simulation; a light object makes the steps shorter.
    #[param(unit = "s", above = 0.0, default = 0.002)]
    step_s: f64,
}

/// A simulated cell: two arms with a foam pad each, and a free object that both pads can hold.
///
/// The pads, their electronics and the arms are those of `sim_bench`, and the parameters have the same names. Those of
/// the device hold for both arms and pads; an arm that differs has its own values in `left` or `right`, such as
/// `right.home`. The key `robot` of the device names the robot of both arms.
///
/// The frame of the cell has its z up. `left.base` and `right.base` are the bases of the arms in this frame. All of a
/// task happens in the base of each arm, so that no task knows the cell.
///
/// The device fills `tactile_pad` and `velocity_arm` on two sides. A bench names the side of each role:
/// `left_pad = "cell.left"`.
///
/// The object is a rigid box or ball of uniform density. It moves and turns freely under gravity, the forces of both
/// pads and those of the table. The coefficients of friction between the pads and the object are `static_friction` and
/// `sliding_friction` of `foam`. Friction sticks and slips at every tactel, so the pads also hold the object against
/// turning. The shear of the foam is damped with the time constant of its compression. The table is stiff: the object
/// sinks in by 0.1 mm under its weight.
///
/// The steps are as short as the object needs: a light object between large pads needs short ones. The device refuses
/// an object that needs more than 64 of them in a `step_s`.
///
/// It runs in virtual time, and the same commands and seed give the same bits. The facts of pads and arms are those of
/// `sim_bench`. Both pads have the curves of the same `electronics.serial`, so that one calibration serves both, and
/// each has its own noise. The role `true_object`, which a bench binds as `object`, gives the true position of the
/// object, the forces on it and whether it is held to scenarios and recordings only.
///
/// Not simulated: contact of an arm or a pad with the other one or with the table; air; further objects; and what `sim_bench` does not simulate.
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
/// pad = "cell.left"
/// arm = "cell.left"
///
/// [devices.cell]
/// type = "sim_pair"
/// for_s = 4.0                         # [s]
/// calibration = "builtin:calibrations/sim_pad.toml"
/// urdf = "builtin:lwr4p.urdf"         # two KUKA LWR 4+
/// tip = "lwr_7_link"
/// mount = { xyz = [0.0, 0.0, 0.03] }  # of the sensors on their tips [m]
/// start = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]   # [rad]
/// left.base = { xyz = [0.6, 0.0, 0.0] }           # in the cell, whose z is up [m]
/// right.base = { xyz = [-0.6, 0.0, 0.0] }
/// object = { shape = "ball", radius = 0.04, mass = 0.3 }   # [m, kg]
/// ```
#[derive(Describe)]
pub struct SimPair {
    sides: [Side; 2],
    object: ObjectPorts,
    world: PairWorld,
    beats: Beats,
    /// Number of exchanges that advanced the time.
    sequence: u64,
}

/// What an arm and its pad exchange with the graph.
struct Side {
    arm: ArmPorts,
    joints: Vec<Joint>,
    frames: Frames,
}

/// Names of the sides in a bench file.
const NAMES: [&str; 2] = ["left", "right"];

impl Device for SimPair {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let pad = &params.pad;
        refuse_any(pad.check().into_iter().chain(check_step(params.step_s)))?;
        let [left, right] = [params.load(0)?, params.load(1)?];
        let max_step = params.object.step(&pad.foam, pad.area(), params.step_s)?;
        let mut scatter = Random::new(params.seed, 3);
        let offset = [0, 1].map(|_| scatter.uniform(-params.object.scatter, params.object.scatter));
        let body = params.object.body(params.table_height, offset)?;
        let table = Table::new(params.table_height, params.table_friction, &body);
        let period = period_of(pad.rate_hz);
        let mut description = Description::every(period as f64 * 1e-9);
        description.latency = params.pad.latency_s;
        let noise = [2, 4].map(|stream| Random::new(params.seed, stream));
        let [left_noise, right_noise] = noise;
        let (left, left_arm) = params.side(&mut description, NAMES[0], left, left_noise)?;
        let (right, right_arm) = params.side(&mut description, NAMES[1], right, right_noise)?;
        let on_base = |side: &SideParams, arm: SimArm| {
            ArmAndPad::new(pose3(&Pose(side.base.pose())), arm, &pad.shape(), pad.foam.clone(), pad.points_apart)
        };
        let arms = [on_base(&params.left, left_arm), on_base(&params.right, right_arm)];
        let cell = Self {
            sides: [left, right],
            object: ObjectPorts::fill(&mut description),
            world: PairWorld::new(arms, body, table, max_step),
            beats: Beats::new(period, params.for_s.map_or(i64::MAX, nanos)),
            sequence: 0,
        };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(cell)) })
    }
}

impl Params {
    /// Reads and checks the model of the left (0) or the right arm (1).
    fn load(&self, side: usize) -> Result<(ArmModel, LoadedArm), Mistakes> {
        let (own, name) = ([&self.left, &self.right][side], NAMES[side]);
        let model = own.model(name, self)?;
        let place = |mistakes: Mistakes| own.place(name, mistakes);
        let loaded = model.load().map_err(place)?;
        refuse_any(place(model.check_inertia(loaded.joints.joints.len())))?;
        refuse_any(place(model.check_motion(self.step_s)))?;
        Ok((model, loaded))
    }

    /// Adds the roles of an arm and its pad to a description. Returns them and the simulated arm.
    fn side(
        &self,
        description: &mut Description,
        name: &'static str,
        (model, loaded): (ArmModel, LoadedArm),
        noise: Random,
    ) -> Result<(Side, SimArm), Mistakes> {
        let pad = &self.pad;
        let times = [period_of(pad.rate_hz), nanos(pad.latency_s)];
        let image = pad::fill(description.fills_on(name, pad::ROLE), pad.shape(), pad.facts(&model.body.mount)?);
        let arm = ArmPorts::fill(description.fills_on(name, arm::ROLE), &loaded.joints, model.facts(&loaded)?);
        let tactels = pad.tactels();
        let readout = Readout::new(tactels, pad.electronics.clone(), self.seed).with_noise(noise);
        let joints = loaded.joints.joints.clone();
        let side = if name == NAMES[0] { &self.left } else { &self.right };
        let down = pose3(&Pose(side.base.pose())).rotation.inverse() * -Vec3::Z;
        Ok((Side { arm, joints, frames: Frames::new(image, readout, tactels, times) }, model.arm(loaded, down)))
    }
}

impl SimPair {
    /// Advances to `now` [ns] and takes the images that are due until then.
    fn advance(&mut self, now: i64, velocity: [&[f64]; 2]) {
        let period = self.beats.period();
        for beat in self.beats.pass(now) {
            self.world.advance(beat as f64 * 1e-9, velocity);
            for (side, arm) in self.sides.iter_mut().zip(&mut self.world.sides) {
                side.frames.take(beat, period, arm.forces());
            }
        }
        if now % period != 0 {
            self.world.advance(now as f64 * 1e-9, velocity);
        }
    }
}

impl Stepped for SimPair {
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
        let velocity = [0, 1].map(|side: usize| commands.joints(self.sides[side].arm.velocity));
        for (side, velocity) in self.sides.iter().zip(velocity) {
            arm::check_velocity(&side.joints, velocity)?;
        }
        self.advance(now, velocity);
        if !self.world.is_sound() {
            return Err(DeviceError("the simulation diverged: make `step_s` smaller or the cell less stiff".into()));
        }
        self.sequence += 1;
        for (side, ArmAndPad { arm, .. }) in self.sides.iter_mut().zip(&self.world.sides) {
            side.frames.show(now, samples);
            side.arm.write(samples, now, self.sequence, [&arm.position, &arm.equilibrium]);
        }
        self.object.write(&self.world, now, self.sequence, samples);
        Ok(())
    }
}
