//! `joint_limit`: the last node before the arm.

mod following;
mod joints;
mod limiter;

use tactflow_runtime::node::{Describe, In, Inputs, Limits, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Joint, Joints, JointsShape, Scalar, Stamp, Unit};

use super::{fraction, max_age};
use crate::usual::{USUAL_LEAD_RAD, USUAL_RAD_PER_S2};

pub use following::Following;
use joints::joints;
pub use limiter::Limiter;

/// Limits positions, speeds and accelerations of the joints, and the lead of the equilibrium over the position.
///
/// It is the last node before an arm. Near the end of its range a joint moves only as fast as it can stop: v τ +
/// v²/(2a) <= d. The same holds for the lead: while a compliant arm is held, its equilibrium runs ahead, and the arm
/// springs to it when it is released, by at most `lead_rad`. Ranges apply to the position and to the equilibrium. A
/// joint outside its range can only move back.
///
/// It alone guarantees the limits of the joints, whatever computes the velocities. `ik_sink` plans within the same speeds
/// and ranges, with a longer delay, so that the planned motion is seldom scaled again.
///
/// Velocities that are too fast are scaled as a whole and keep their direction. The output then follows on a straight
/// line, as far as the accelerations allow. Only a joint that cannot brake in time with the others brakes by itself.
///
/// When the velocities are absent, or they or the arm's state are older than `max_age_ms`, the output goes to zero on a
/// straight line with these accelerations, and is absent once it is zero. When the arm's state is *absent*, the output
/// is absent at once, and the runtime ramps the command down with the same accelerations.
///
/// The delay τ is twice the graph's `max_gap_ms`, and the distance that the last command may travel in such a gap is
/// subtracted from d: no bound is crossed as long as no tick takes longer, also by an arm that acts one tick late. In a
/// slow graph this leaves little speed near a bound: use a shorter `max_gap_ms`. An arm that is moved by hand can leave
/// its range.
///
/// **A joint that does not follow** ends the task with a fault, because its motion is no longer the one that the limiters
/// before it have let pass. The equilibrium must move as the commands say: a joint is stuck if it makes less than a tenth
/// of a way of 4 mrad (4 mm for a prismatic joint). The commands must act within 100 ms, or four times the graph's
/// `max_gap_ms` if that is longer, and a robot that its operator slows down must keep 15 % of its speed. A command that the
/// arm does not get, as at a halt, does not count.
///
/// Each scalar beside the velocity is 1 while the limit of that name does not act.
///
/// ```toml
/// [nodes.joint_limit]
/// type = "joint_limit"
/// in.velocity = "ik.velocity"
/// in.position = "arm.position"
/// in.equilibrium = "arm.equilibrium"
/// acceleration = 5.0                  # [rad/s²]
/// lead_rad = 0.1
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct JointLimit {
    joints: Vec<Joint>,
    lead: f64,
    /// Maximum age of the velocities [ns].
    max_age: i64,
    /// Maximum age of the arm's state [ns].
    max_age_of_arm: i64,
}

/// Parameters of `joint_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Maximum acceleration of every joint; a smaller one that the arm states has priority.
    #[param(unit = "rad/s2", above = 0.0, usual = ..=USUAL_RAD_PER_S2)]
    acceleration: Option<f64>,
    /// Maximum lead of the equilibrium over the position.
    #[param(unit = "rad", above = 0.0, usual = ..=USUAL_LEAD_RAD)]
    lead_rad: f64,
    /// Fraction of each joint's maximum speed that is used.
    #[param(unit = "1", range = 0.0..=1.0, default = 1.0)]
    speed: f64,
    /// Maximum age of the velocities and of the arm's state; five periods of the slowest device behind each if not
    /// given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `joint_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Wanted joint velocities.
    #[port(unit = "rad/s", robot = "R")]
    velocity: Option<In<'a, Joints>>,
    /// Measured joint positions.
    #[port(unit = "rad", robot = "R", quantity = "position", known)]
    position: In<'a, Joints>,
    /// Posture that the commands have moved to.
    #[port(unit = "rad", robot = "R", quantity = "equilibrium", known)]
    equilibrium: In<'a, Joints>,
}

/// What `joint_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Joint velocities within all limits.
    #[port(unit = "rad/s", robot = "R")]
    velocity: Out<Joints>,
    /// Fraction of the wanted velocities that the bound of the lead lets pass.
    #[port(unit = "1", frame = "_")]
    lead: Out<Scalar>,
    /// Fraction of the wanted velocities that the ranges of the joints let pass.
    #[port(unit = "1", frame = "_")]
    joint_position: Out<Scalar>,
    /// Fraction of the wanted velocities that the speeds of the joints let pass.
    #[port(unit = "1", frame = "_")]
    joint_speed: Out<Scalar>,
    /// Fraction of the wanted change that the accelerations of the joints let pass in this tick.
    #[port(unit = "1", frame = "_")]
    joint_acceleration: Out<Scalar>,
    /// Whether a joint has not followed its commands.
    stuck: Out<Flag>,
}

/// What `joint_limit` remembers.
#[derive(State)]
pub struct State {
    limiter: Limiter,
    following: Following,
}

impl Node for JointLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits {
        through: Some("velocity"),
        holds: &["lead", "joint_position", "joint_speed", "joint_acceleration"],
        fails: Some("stuck"),
        ..Limits::NONE
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let InputsShapes { velocity, position, equilibrium } = &setup.inputs;
        let velocity = velocity.as_ref().expect("the check of a graph reports an input without a wire");
        let joints = joints(&params, velocity, position, equilibrium)?;
        setup.outputs.velocity = JointsShape { joints: joints.clone(), unit: Unit::RADIAN.per_second() };
        (setup.outputs.lead, setup.outputs.joint_position) = (fraction(), fraction());
        (setup.outputs.joint_speed, setup.outputs.joint_acceleration) = (fraction(), fraction());
        let max_age = |input| max_age(params.max_age_ms, setup.sample_period(input));
        let max_age_of_arm = max_age("position").max(max_age("equilibrium"));
        Ok(Self { joints, lead: params.lead_rad, max_age: max_age("velocity"), max_age_of_arm })
    }

    fn state(&self) -> State {
        let count = self.joints.len();
        State { limiter: Limiter::new(count), following: Following::new(count) }
    }

    fn found(&self, state: &State) -> Option<String> {
        let (joint, [commanded, way]) = state.following.stuck()?;
        let name = &self.joints[joint].name;
        Some(format!(
            "joint `{name}` does not follow its commands: it was commanded by {commanded:.4} and has moved by {way:.4} (rad, \
             or m if prismatic); check its brake and its drive, and that the device states the equilibrium"
        ))
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, State { limiter, following }: &mut State) {
        let arm = inputs.position.stamp().oldest(inputs.equilibrium.stamp());
        let is_fresh = |stamp: Stamp, max_age: i64| stamp.age(tick.now) <= max_age && !tick.is_halted;
        let is_arm_fresh = is_fresh(arm, self.max_age_of_arm);
        let wanted = inputs.velocity.filter(|velocity| is_arm_fresh && is_fresh(velocity.stamp(), self.max_age));
        let wanted = wanted.map(|velocity| &*velocity.value().0);
        let (position, equilibrium) = (&inputs.position.0, &inputs.equilibrium.0);
        if is_arm_fresh && !tick.is_overruled {
            out.stuck.set(following.note(tick, limiter.velocities(), equilibrium));
        } else {
            following.pause();
            // An arm that does not get the commands has still not failed to follow them.
            if is_arm_fresh {
                out.stuck.set(following.stuck().is_some());
            }
        }
        let Some([lead, position, speed, acceleration]) =
            limiter.limit(&self.joints, self.lead, tick, wanted, position, equilibrium)
        else {
            return;
        };
        out.velocity.write().0.copy_from_slice(limiter.velocities());
        out.lead.set(lead);
        out.joint_position.set(position);
        out.joint_speed.set(speed);
        out.joint_acceleration.set(acceleration);
    }
}

#[cfg(test)]
mod tests;
