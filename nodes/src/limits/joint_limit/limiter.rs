//! The velocities of joints within their speeds, positions, lead and accelerations.
//!
//! Each joint has a range of allowed velocities. Its limit is the speed of the joint and, toward a bound at distance d,
//! the largest v from which a stop within d is possible: v τ + v²/(2a) <= d. The bounds are the joint's range, for the
//! position and for the equilibrium, and the lead of the equilibrium over the position.
//!
//! τ = 2h, where h is the longest tick that counts as one (`max_gap_ms`). The distance that the last command may still
//! travel, v_last h, is subtracted from d. So the stop is certain for any sequence of ticks, also when a command acts
//! one tick late: the speed at time t is then at most the braked speed at t - 2h.
//!
//! 1. One factor brings the wanted velocities into all ranges: the direction stays.
//! 2. The output moves toward the result on a straight line, as far as the slowest joint's acceleration allows.
//! 3. A joint that is then still too fast brakes by itself, with its own acceleration: the guarantee has priority over the
//!    direction.
//!
//! Invariants, while no tick takes longer than h: no joint changes its velocity by more than a dt, nor exceeds its
//! speed; a joint that starts within its range never leaves it; no command makes the lead exceed its bound.

use tactflow_runtime::node::{State, Tick};
use tactflow_runtime::signal::Joint;
use tactflow_runtime::signal::line::{scale_to, step_toward};

use crate::motion::bounds::scale_into;
use crate::motion::braking::stopping_speed;

/// The velocities of all joints, one tick after the other within all limits.
#[derive(State)]
pub struct Limiter {
    /// The velocities of the last tick [rad/s].
    last: Vec<f64>,
    /// The wanted velocities within their ranges [rad/s].
    target: Vec<f64>,
    /// The allowed velocities of each joint.
    room: Vec<Room>,
}

/// Smallest and largest allowed velocity of a joint [rad/s].
type VelocityRange = (f64, f64);

/// The velocities that each limit allows a joint in this tick.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Room {
    pub(super) speed: VelocityRange,
    pub(super) position: VelocityRange,
    pub(super) lead: VelocityRange,
}

impl Limiter {
    /// Returns `count` joints at rest.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { last: vec![0.0; count], target: vec![0.0; count], room: vec![Room::default(); count] }
    }

    /// Returns the velocities of the last tick [rad/s].
    #[must_use]
    pub fn velocities(&self) -> &[f64] {
        &self.last
    }

    /// Moves the velocities one tick toward the wanted ones, within all limits.
    ///
    /// Returns the fractions that the lead, the positions, the speeds and the accelerations let pass, or `None` if
    /// there are no wanted velocities and all joints are at rest.
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
        let mut scales = [1.0; 4];
        self.target.fill(0.0);
        if let Some(wanted) = wanted {
            scales[0] = scale_into(wanted, rooms().map(|room| room.lead));
            scales[1] = scale_into(wanted, rooms().map(|room| room.position));
            scales[2] = scale_into(wanted, rooms().map(|room| room.speed));
            let scale = scales[0].min(scales[1]).min(scales[2]);
            for ((target, wanted), room) in self.target.iter_mut().zip(wanted).zip(&self.room) {
                let (min, max) = room.all();
                *target = (wanted * scale).clamp(min, max);
            }
        }
        let dt = tick.dt.min(tick.max_gap);
        scales[3] = follow(joints, dt, &self.target, &self.room, &mut self.last);
        Some(scales)
    }
}

impl Room {
    /// Returns the velocities that all limits allow; 0 is always among them.
    pub(super) fn all(&self) -> VelocityRange {
        let both = |a: VelocityRange, b: VelocityRange| (a.0.max(b.0), a.1.min(b.1));
        both(self.speed, both(self.position, self.lead))
    }
}

/// Returns the allowed velocities of a joint whose last command was `last` [rad/s], if no tick takes longer than `gap`
/// [s].
pub(super) fn room(joint: &Joint, q: f64, equilibrium: f64, lead: f64, last: f64, gap: f64) -> Room {
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

/// Moves `last` toward `target` on a straight line, except for the joints that have to brake by themselves. Returns the
/// fraction of the change that it made.
pub(super) fn follow(joints: &[Joint], dt: f64, target: &[f64], room: &[Room], last: &mut [f64]) -> f64 {
    let mut scale = 1.0f64;
    for ((joint, target), last) in joints.iter().zip(target).zip(&*last) {
        scale = scale.min(scale_to((target - last).abs(), joint.acceleration * dt));
    }
    for (((joint, target), room), last) in joints.iter().zip(target).zip(room).zip(last) {
        let change = joint.acceleration * dt;
        let next = step_toward(*last, *target, scale);
        let (min, max) = room.all();
        *last = next.clamp(min, max).clamp(*last - change, *last + change);
    }
    scale
}
