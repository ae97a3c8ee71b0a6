//! The time and the way that a motion without a contact may still take.

use nalgebra::Vector3;
use tactflow_runtime::signal::Twist;

use crate::motion::braking::stopping_speed;

/// How long a contact must last to refill the budgets [ns].
const MIN_CONTACT_NS: i64 = 40_000_000;
/// A slower motion is rest [m/s].
const MIN_SPEED: f64 = 1e-6;
/// A budget is spent once it allows no more than this speed [m/s].
const STOPPED_SPEED: f64 = 1e-4;

/// The budgets of a motion without a contact, and how fast it can stop.
#[derive(Debug, Clone, Copy)]
pub struct Bounds {
    /// Longest time [s].
    pub time: f64,
    /// Longest way [m].
    pub way: f64,
    /// Linear deceleration [m/s²].
    pub linear: f64,
    /// Angular deceleration [rad/s²].
    pub angular: f64,
}

/// The motion that is wanted.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Speed of the fastest corner of the pad [m/s].
    pub speed: f64,
    /// Deceleration of that corner if the whole motion stops as fast as it can [m/s²].
    deceleration: f64,
}

impl Motion {
    /// Returns the motion of pads with these corners [m].
    #[must_use]
    pub fn of(twist: &Twist, corners: &[Vector3<f64>], bounds: &Bounds) -> Self {
        let (linear, angular) = (twist.linear(), twist.angular());
        let speeds = corners.iter().map(|corner| (linear + angular.cross(corner)).norm());
        // The centre is slower than a corner, unless rounding says otherwise.
        let speed = speeds.fold(linear.norm(), f64::max);
        let stop = (linear.norm() / bounds.linear).max(angular.norm() / bounds.angular);
        Self { speed, deceleration: if stop > 0.0 { speed / stop } else { bounds.linear } }
    }
}

/// What has been spent since the last contact.
#[derive(Debug, Clone, Copy, Default)]
pub struct Budget {
    /// Stamp of the first sample of the contact that lasts, of each pad [ns].
    contact_since: [Option<i64>; 2],
    /// Time of motion [s].
    time: f64,
    /// Way [m].
    way: f64,
    is_spent: bool,
}

impl Budget {
    /// Notes for each pad the stamp of a sample with a contact [ns], or that there is none. A contact of one pad that
    /// lasts refills the budgets, and so does the operator.
    pub fn touch(&mut self, contacts: [Option<i64>; 2], is_resumed: bool) {
        let mut lasts = false;
        for (contact, since) in contacts.into_iter().zip(&mut self.contact_since) {
            *since = contact.map(|stamp| since.unwrap_or(stamp));
            lasts |= contact.zip(*since).is_some_and(|(stamp, since)| stamp - since >= MIN_CONTACT_NS);
        }
        if lasts || is_resumed {
            *self = Self { contact_since: self.contact_since, ..Self::default() };
        }
    }

    /// Spends the motion of one tick: the speed of the fastest corner [m/s], and the time [s].
    pub fn spend(&mut self, speed: f64, dt: f64) {
        if speed > MIN_SPEED {
            (self.time, self.way) = (self.time + dt, self.way + speed * dt);
        }
    }

    /// Returns the fraction of a motion that can still stop within both budgets, if it goes on for `delay` [s] before it
    /// brakes. `room` is the distance within the clear box, in which nothing counts [m].
    pub fn scale(&mut self, motion: &Motion, bounds: &Bounds, room: f64, delay: f64) -> f64 {
        let Motion { speed, deceleration } = *motion;
        let way = (bounds.way - self.way).max(0.0) + room;
        let time = (bounds.time - self.time - delay).max(0.0);
        let in_time = (deceleration * time).max(stopping_speed(room, deceleration, delay));
        let allowed = in_time.min(stopping_speed(way, deceleration, delay));
        self.is_spent |= allowed < speed && allowed <= STOPPED_SPEED;
        if self.is_spent {
            return 0.0;
        }
        if speed > allowed { allowed / speed } else { 1.0 }
    }

    /// Whether a budget is spent.
    #[must_use]
    pub const fn is_spent(&self) -> bool {
        self.is_spent
    }

    /// Returns the fraction that is left, of the budget of which less is left.
    #[must_use]
    pub fn left(&self, bounds: &Bounds) -> f64 {
        let (time, way) = (self.time / bounds.time, self.way / bounds.way);
        if self.is_spent { 0.0 } else { (1.0 - time.max(way)).max(0.0) }
    }
}
