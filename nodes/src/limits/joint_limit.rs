//! `joint_limit`: joint velocities within what every joint bears, at the very end before the arm.
//!
//! Each joint has an interval of velocities: at most its speed, and toward whatever must not be crossed, at a distance
//! d, at most the v that a stop within d allows: v τ + v²/(2a) <= d, with τ = 2h, and with what the last command may
//! still travel, v_last h, taken off d. h is the longest tick that counts as one (`max_gap_ms`), so the stop is sure
//! however the ticks fall, also when a command acts a tick late: the speed at time t is then at most what braking left
//! of it at t - 2h. What must not be crossed: the joint's range, by the position and by the equilibrium, and the lead
//! of the equilibrium before the position.
//!
//! 1. One factor brings the wanted velocities into all intervals: the direction stays.
//! 2. The output moves toward that on a straight line, by as much as the slowest joint's acceleration allows.
//! 3. A joint that is then still too fast brakes by itself, with its own acceleration: the guarantee goes before the
//!    direction.
//!
//! Invariants: no joint ever changes its velocity by more than a dt, nor exceeds its speed; one that starts within its
//! range never leaves it, and the lead never grows past its bound by a command, while no tick takes longer than h.

use tactflow_runtime::node::{At, Limits, Mistake, Mistakes, Node, Positive, Ratio, Setup, Tick};
use tactflow_runtime::signal::line::{scale_to, step_toward};
use tactflow_runtime::signal::{Joint, JointsShape, ScalarShape, Stamp, Unit};
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::bounds::scale_into;
use crate::motion::braking::stopping_speed;

params! {
    /// Greatest acceleration of every joint; what the arm states holds where that is less [rad/s²; m/s² if prismatic].
    acceleration: Option<Positive>,
    /// Greatest lead of the equilibrium before the position [rad; m for a prismatic joint].
    lead_rad: Positive,
    /// Share of each joint's greatest speed that is used [1].
    speed: Ratio = Ratio(1.0),
    /// Greatest age of the velocities and of the arm's state; five periods of the graph unless given [ms].
    max_age_ms: Option<Positive>,
}

inputs! {
    /// Wanted joint velocities [rad/s; m/s for a prismatic joint].
    velocity: Trigger<Joints["rad/s", "R"]>,
    /// Measured joint positions [rad; m for a prismatic joint].
    position: Joints["rad", "R"],
    /// Posture that the commands have moved to [rad; m for a prismatic joint].
    equilibrium: Joints["rad", "R"],
}

outputs! {
    /// Joint velocities that an arm can be given [rad/s; m/s for a prismatic joint].
    velocity: Joints["rad/s", "R"],
    /// Share of what was wanted that the bound on the lead lets pass [1].
    lead: Scalar["1"],
    /// Share of what was wanted that the ranges of the joints let pass [1].
    joint_position: Scalar["1"],
    /// Share of what was wanted that the speeds of the joints let pass [1].
    joint_speed: Scalar["1"],
    /// Share of the wanted change that the accelerations of the joints let pass in this tick [1].
    joint_acceleration: Scalar["1"],
}

state! {
    /// The last velocities that were given [rad/s].
    last: Vec<f64>,
    /// What is wanted within the intervals [rad/s].
    target: Vec<f64>,
    /// What each joint may do.
    room: Vec<Room>,
}

/// Least and greatest velocity of a joint [rad/s].
type Interval = (f64, f64);

/// What a joint may do in this tick, and because of what.
#[derive(Debug, Clone, Copy, Default)]
pub struct Room {
    speed: Interval,
    position: Interval,
    lead: Interval,
}

/// The joints with the speeds and accelerations that hold, and the bounds of all.
pub struct JointLimit {
    joints: Vec<Joint>,
    lead: f64,
    max_age: i64,
}

impl tactflow_runtime::node::Describe for JointLimit {
    const NAME: &'static str = "joint_limit";
    const SUMMARY: &'static str = "keeps joint velocities within ranges, speeds, accelerations and the lead of an arm";
    const DOC: &'static str = "The last node before an arm. Near the end of its range a joint goes only as fast as it \
        can stop, v τ + v²/(2a) <= d, and the same holds for the lead: a compliant arm that is held runs ahead with \
        its equilibrium, and springs when it is let go, by `lead_rad` at most. Ranges hold for the position and for \
        the equilibrium. A joint that is outside may only move back.\n\n\
        What is too fast is slowed down as a whole and keeps its direction; then the output follows on a straight \
        line, by what the accelerations allow. Only where another joint's acceleration leaves a joint no room to \
        brake, it brakes by itself.\n\n\
        When the velocities are absent, or they or the arm's state are older than `max_age_ms`, the output goes to \
        zero in a straight line, with the accelerations that hold, and is absent once it stands. When the arm's \
        state is *absent*, so is the output, at once, and the runtime ramps the command with the same \
        accelerations.\n\n\
        The delay τ is two times the graph's `max_gap_ms`, and what the last command may travel in such a gap is \
        taken off d: nothing is crossed as long as no tick takes longer, also by an arm that acts a tick late. In a \
        slow graph that is a lot: a shorter `max_gap_ms` makes it quicker. What moves the arm by hand is nobody's \
        command and can move a joint past anything.\n\n\
        The outputs beside the velocity are 1 where the limit of that name does nothing.";
    const EXAMPLE: &'static str = r#"
[nodes.joint_limit]
type = "joint_limit"
in.velocity = "ik.velocity"
in.position = "arm.position"
in.equilibrium = "arm.equilibrium"
acceleration = 5.0                  # [rad/s²]
lead_rad = 0.1
"#;
    const EVERY_TICK: bool = true;
}

impl Node for JointLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits {
        through: Some("velocity"),
        holds: &["lead", "joint_position", "joint_speed", "joint_acceleration"],
        breaks: &[],
    };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let Some(velocity) = &setup.inputs.velocity else {
            return Err(crate::unwired(
                <Self as tactflow_runtime::node::Describe>::NAME,
                "velocity",
                "joint velocities",
                "ik.velocity",
            )
            .into());
        };
        let joints = joints(&params, velocity, &setup.inputs.position, &setup.inputs.equilibrium)?;
        setup.outputs.velocity = JointsShape { joints: joints.clone(), unit: Unit::RADIAN.per_second() };
        let share = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        setup.outputs.lead = share.clone();
        setup.outputs.joint_position = share.clone();
        setup.outputs.joint_speed = share.clone();
        setup.outputs.joint_acceleration = share;
        let max_age = params.max_age_ms.map_or(5.0 * setup.period, |age| *age * 1e-3);
        Ok(Self { joints, lead: *params.lead_rad, max_age: (max_age * 1e9) as i64 })
    }

    fn state(&self) -> State {
        State::of(self.joints.len())
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let arm = inputs.position.stamp().oldest(inputs.equilibrium.stamp());
        let is_fresh = |stamp: Stamp| stamp.age(tick.now) <= self.max_age && !tick.is_halted;
        let wanted = inputs.velocity.filter(|velocity| is_fresh(velocity.stamp()) && is_fresh(arm));
        let wanted = wanted.map(|velocity| &*velocity.value().0);
        let (position, equilibrium) = (&inputs.position.0, &inputs.equilibrium.0);
        let Some([lead, position, speed, acceleration]) =
            state.limit(&self.joints, self.lead, tick, wanted, position, equilibrium)
        else {
            return;
        };
        out.velocity.write().0.copy_from_slice(&state.last);
        out.lead.set(lead);
        out.joint_position.set(position);
        out.joint_speed.set(speed);
        out.joint_acceleration.set(acceleration);
    }
}

impl State {
    /// A fresh state for so many joints.
    #[must_use]
    pub fn of(count: usize) -> Self {
        Self { last: vec![0.0; count], target: vec![0.0; count], room: vec![Room::default(); count] }
    }

    /// The velocities that were given last [rad/s].
    #[must_use]
    pub fn velocities(&self) -> &[f64] {
        &self.last
    }

    /// One step toward what is wanted, within all limits. Gives the shares that the lead, the positions, the speeds and
    /// the accelerations let pass; nothing if nothing is wanted and all joints stand.
    pub fn limit(
        &mut self,
        joints: &[Joint],
        lead: f64,
        tick: &Tick,
        wanted: Option<&[f64]>,
        position: &[f64],
        equilibrium: &[f64],
    ) -> Option<[f64; 4]> {
        if wanted.is_none() && self.last.iter().all(|v| *v == 0.0) {
            return None;
        }
        for (i, joint) in joints.iter().enumerate() {
            self.room[i] = room(joint, position[i], equilibrium[i], lead, self.last[i], tick.max_gap);
        }
        let rooms = || self.room.iter();
        let mut shares = [1.0; 4];
        self.target.fill(0.0);
        if let Some(wanted) = wanted {
            shares[0] = scale_into(wanted, rooms().map(|room| room.lead));
            shares[1] = scale_into(wanted, rooms().map(|room| room.position));
            shares[2] = scale_into(wanted, rooms().map(|room| room.speed));
            let share = shares[0].min(shares[1]).min(shares[2]);
            for ((target, wanted), room) in self.target.iter_mut().zip(wanted).zip(&self.room) {
                let (least, greatest) = room.all();
                *target = (wanted * share).clamp(least, greatest);
            }
        }
        let dt = tick.dt.min(tick.max_gap);
        shares[3] = follow(joints, dt, &self.target, &self.room, &mut self.last);
        Some(shares)
    }
}

impl Room {
    /// What it may do at all; zero always belongs to it.
    fn all(&self) -> Interval {
        let both = |a: Interval, b: Interval| (a.0.max(b.0), a.1.min(b.1));
        both(self.speed, both(self.position, self.lead))
    }
}

/// What a joint may do that was last told to go with `last`, if no tick takes longer than `gap` [s].
fn room(joint: &Joint, q: f64, equilibrium: f64, lead: f64, last: f64, gap: f64) -> Room {
    let both = |down: f64, up: f64| {
        let toward =
            |distance: f64, last: f64| stopping_speed(distance - last.max(0.0) * gap, joint.acceleration, 2.0 * gap);
        (-toward(down, -last), toward(up, last))
    };
    let ahead = equilibrium - q;
    Room {
        speed: (-joint.speed, joint.speed),
        position: both(q.min(equilibrium) - joint.lower, joint.upper - q.max(equilibrium)),
        lead: both(lead + ahead, lead - ahead),
    }
}

/// Moves `last` toward `target`, on a straight line but for the joints that have to brake by themselves. Gives the
/// share of the way that it went.
fn follow(joints: &[Joint], dt: f64, target: &[f64], room: &[Room], last: &mut [f64]) -> f64 {
    let mut share = 1.0f64;
    for ((joint, target), last) in joints.iter().zip(target).zip(&*last) {
        share = share.min(scale_to((target - last).abs(), joint.acceleration * dt));
    }
    for (((joint, target), room), last) in joints.iter().zip(target).zip(room).zip(last) {
        let most = joint.acceleration * dt;
        let next = step_toward(*last, *target, share);
        let (least, greatest) = room.all();
        *last = next.clamp(least, greatest).clamp(*last - most, *last + most);
    }
    share
}

/// The joints with the limits that hold: of all that is said about a joint, the narrowest.
fn joints(
    params: &Params,
    velocity: &JointsShape,
    position: &JointsShape,
    equilibrium: &JointsShape,
) -> Result<Vec<Joint>, Mistakes> {
    let names = |shape: &JointsShape| shape.joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
    for (input, shape) in [("position", position), ("equilibrium", equilibrium)] {
        if names(shape) != names(velocity) {
            let message = format!("`{input}` has the joints {:?}, but `velocity` {:?}", names(shape), names(velocity));
            return Err(Mistake::input(input, message).help("take all of them from one arm").into());
        }
    }
    let most = params.acceleration.map_or(f64::INFINITY, |acceleration| *acceleration);
    let joints: Vec<Joint> = velocity
        .joints
        .iter()
        .zip(&position.joints)
        .map(|(wanted, has)| Joint {
            name: has.name.clone(),
            lower: has.lower.max(wanted.lower),
            upper: has.upper.min(wanted.upper),
            speed: has.speed.min(wanted.speed) * *params.speed,
            acceleration: has.acceleration.min(wanted.acceleration).min(most),
        })
        .collect();
    if let Some(joint) = joints.iter().find(|joint| !joint.acceleration.is_finite()) {
        let message = format!("the arm states no greatest acceleration of joint `{}`", joint.name);
        let mistake = Mistake::new(Code::MissingKey, At::Node, message);
        return Err(mistake.help("add `acceleration = 5.0`, in rad/s²").into());
    }
    match joints.iter().find(|joint| !joint.speed.is_finite()) {
        Some(joint) => {
            let message = format!("the arm states no greatest speed of joint `{}`", joint.name);
            Err(Mistake::input("position", message).help("its model has to state one").into())
        }
        None => Ok(joints),
    }
}

#[cfg(test)]
mod tests;
