//! Joint velocities within the speeds and the ranges of the joints, that keep the direction of the task.
//!
//! Every joint has an interval of velocities: at most its largest speed, and toward a position limit at most as fast as
//! it can still brake. A motion that leaves an interval is first given another motion of the elbow, which leaves the
//! sensor where it is. Only what the elbow cannot give slows the task down, as a whole.

use tactflow_runtime::node::State;
use tactflow_runtime::signal::Joint;

use super::null_space::{self, Row};
use crate::motion::bounds::scale_into;
use crate::motion::braking::stopping_speed;

/// Smallest and largest velocity of a joint [rad/s]. The first is at most 0, the second at least 0.
pub type Interval = (f64, f64);

/// A velocity below this fraction of the fastest joint is not counted: otherwise rounding alone would stop a motion
/// along a limit [1].
const NEGLIGIBLE: f64 = 1e-9;

/// Where a joint is and where its equilibrium is [rad]. The limits hold for both.
pub type Place = [f64; 2];

/// Returns the smallest and the largest velocity of a joint at a place.
///
/// Toward a limit at distance d it is the v of v τ + v²/(2a) = d, with the `delay` τ [s] and the acceleration a of the
/// joint. Near the limit that is d/τ, with which it is approached exponentially and never crossed. It brakes with
/// v dv/dd = a v/(a τ + v), which is less than a at any distance. A joint outside its range can only move back.
#[must_use]
pub fn interval(joint: &Joint, [q, equilibrium]: Place, delay: f64) -> Interval {
    let toward = |distance: f64| stopping_speed(distance, joint.acceleration, delay).min(joint.speed);
    (-toward(q.min(equilibrium) - joint.lower), toward(joint.upper - q.max(equilibrium)))
}

/// Adds `drift` to `velocity` [rad/s] if the sum is within the intervals of all joints at their places. Returns
/// whether it is.
///
/// It asks whether a stop is possible, v τ + v²/(2a) <= d, which is cheaper than the largest speed from which one is.
pub fn add_within(
    joints: &[Joint],
    places: impl Iterator<Item = Place>,
    delay: f64,
    velocity: &mut [f64],
    drift: &[f64],
) -> bool {
    let mut is_within = true;
    for (((joint, [q, equilibrium]), v), drift) in joints.iter().zip(places).zip(&*velocity).zip(drift) {
        let sum = v + drift;
        let (speed, room) =
            (sum.abs(), if sum > 0.0 { joint.upper - q.max(equilibrium) } else { q.min(equilibrium) - joint.lower });
        is_within &= speed <= joint.speed && speed * (delay + speed / (2.0 * joint.acceleration)) <= room;
    }
    if is_within {
        velocity.iter_mut().zip(drift).for_each(|(v, drift)| *v += drift);
    }
    is_within
}

/// Working memory for the joints of an arm.
#[derive(Debug, State)]
pub struct Elbow {
    /// Working memory of the null space.
    pub rows: Vec<Row>,
    /// The interval of each joint.
    pub intervals: Vec<Interval>,
    /// A motion that leaves the sensor where it is [rad/s].
    motion: Vec<f64>,
}

impl Elbow {
    /// Returns the working memory for `count` joints.
    #[must_use]
    pub fn new(count: usize) -> Self {
        Self { rows: vec![[0.0; 8]; count], intervals: vec![(0.0, 0.0); count], motion: vec![0.0; count] }
    }

    /// Moves the `velocity` [rad/s] of the task into the intervals, with a motion of the elbow and, where this does not
    /// suffice, slower. Returns the fraction of the task that is left.
    ///
    /// `columns` are those of the Jacobian at the sensor.
    pub fn keep_direction(&mut self, columns: &[[f64; 6]], velocity: &mut [f64]) -> f64 {
        let slack = NEGLIGIBLE * velocity.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let mut share = 1.0;
        if self.aside(columns, velocity, slack) {
            let lines = || {
                let joints = velocity.iter().zip(&self.motion).zip(&self.intervals);
                joints.map(|((v, motion), interval)| Line::new(*v, *motion, *interval, slack))
            };
            share = lines().fold(1.0, |share: f64, line| share.min(line.alone));
            share = lines().fold(share, |share, line| lines().fold(share, |share, other| line.meet(&other, share)));
            let (least, most) = lines().fold((f64::NEG_INFINITY, f64::INFINITY), |(least, most), line| {
                (least.max(line.least.at(share)), most.min(line.most.at(share)))
            });
            // The smallest motion of the elbow within all intervals.
            let amount = 0.0_f64.max(least).min(most);
            for (v, motion) in velocity.iter_mut().zip(&self.motion) {
                *v = share * *v + amount * motion;
            }
        }
        self.clamp(velocity);
        share
    }

    /// Brings the motion of the elbow in `velocity` as near to `drift` as the intervals allow.
    pub fn add_drift(&mut self, columns: &[[f64; 6]], velocity: &mut [f64], drift: &[f64]) {
        for ((motion, v), drift) in self.motion.iter_mut().zip(&*velocity).zip(drift) {
            *motion = drift - v;
        }
        null_space::project(columns, &mut self.rows, &mut self.motion);
        let left = self.intervals.iter().zip(&*velocity).map(|((min, max), v)| (min - v, max - v));
        let part = scale_into(&self.motion, left);
        velocity.iter_mut().zip(&self.motion).for_each(|(velocity, motion)| *velocity += motion * part);
        self.clamp(velocity);
    }

    /// Brings each velocity into its interval.
    pub fn clamp(&self, velocity: &mut [f64]) {
        velocity.iter_mut().zip(&self.intervals).for_each(|(v, (min, max))| *v = v.clamp(*min, *max));
    }

    /// Sets `motion` to the unit motion of the elbow that leads toward the intervals, or to zero if none does. Returns
    /// false if the `velocity` is within them but for the `slack`.
    fn aside(&mut self, columns: &[[f64; 6]], velocity: &[f64], slack: f64) -> bool {
        for ((motion, v), (min, max)) in self.motion.iter_mut().zip(velocity).zip(&self.intervals) {
            *motion = v.clamp(*min, *max) - v;
        }
        let square = |motion: &[f64]| motion.iter().map(|x| x * x).sum::<f64>();
        let outside = square(&self.motion);
        if outside <= slack * slack {
            return false;
        }
        null_space::project(columns, &mut self.rows, &mut self.motion);
        let inside = square(&self.motion);
        // Less than this is rounding of a motion that moves the sensor.
        let scale = if inside > NEGLIGIBLE * NEGLIGIBLE * outside { 1.0 / inside.sqrt() } else { 0.0 };
        self.motion.iter_mut().for_each(|motion| *motion *= scale);
        true
    }
}

/// The interval of one joint as a condition on the share s of the task and the amount w of the elbow's motion: min <=
/// s v + w n <= max, where the joint has the velocities v in the task and n in the motion.
struct Line {
    /// The largest share, if the elbow does not move the joint.
    alone: f64,
    least: Bound,
    most: Bound,
}

/// A bound of the amount, linear in the share.
struct Bound {
    at_zero: f64,
    slope: f64,
}

impl Line {
    /// The condition may be violated by `slack` times the share.
    fn new(v: f64, n: f64, (min, max): Interval, slack: f64) -> Self {
        let bound = |bound: f64, v: f64| Bound { at_zero: bound / n, slope: -v / n };
        if n > NEGLIGIBLE {
            return Self { alone: 1.0, least: bound(min, v + slack), most: bound(max, v - slack) };
        }
        if n < -NEGLIGIBLE {
            return Self { alone: 1.0, least: bound(max, v - slack), most: bound(min, v + slack) };
        }
        let (size, room) = (v.abs() - slack, if v > 0.0 { max } else { -min });
        let free = |at_zero| Bound { at_zero, slope: 0.0 };
        Self {
            alone: if size > room { room / size } else { 1.0 },
            least: free(f64::NEG_INFINITY),
            most: free(f64::INFINITY),
        }
    }

    /// Returns the largest share up to `share` at which some amount is enough for this joint and not too much for the
    /// `other`.
    fn meet(&self, other: &Self, share: f64) -> f64 {
        let (gap, slope) = (other.most.at_zero - self.least.at_zero, self.least.slope - other.most.slope);
        if slope * share > gap { gap / slope } else { share }
    }
}

impl Bound {
    fn at(&self, share: f64) -> f64 {
        self.at_zero + self.slope * share
    }
}

#[cfg(test)]
mod tests;
