//! A run along a path: the place on it, and the velocity that follows from a pose.
//!
//! With the closest point p(s) ahead of the last one, its direction t and curvature k, and the position p of the
//! sensor, all in the frame of the path:
//!
//! ```text
//! v = u (t + l k) + g e              e = p(s) - p
//! ```
//!
//! An arm that trails behind its command by l, because of friction or a lag, must be commanded to p(s) + l t, whose
//! derivative is the first term. u rises with the acceleration a, and lets the sensor brake to rest at the end. It
//! stays below the speed and the profile of the path, both times 1 - |e| / e_max: far from the path the sensor first
//! comes back. The correction g e stays below the speed. Between the ends of the path, e is at a right angle to t.

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::signal::line::scale_to;

use super::path::{Path, Profile, Station};
use crate::motion::braking::stopping_speed;

/// Distance from the beginning of the path at which a run along it begins [m].
const BEGIN_M: f64 = 0.0005;
/// Rest of the way at which the path is done [m].
const DONE_M: f64 = 0.0001;

/// What does not change during a run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Law {
    pub(super) path: Path,
    pub(super) profile: Profile,
    /// Speed per distance from the path [1/s].
    pub(super) gain: f64,
    /// Largest speed along the path, and of the correction [m/s].
    pub(super) speed: f64,
    /// Largest acceleration along the path [m/s²].
    pub(super) acceleration: f64,
    /// Distance from the path at which the motion along it stops, e_max [m].
    pub(super) wait: f64,
    /// Distance by which the arm trails behind its command, l [m].
    pub(super) trail: f64,
    /// Whether motion and distances along the sensor's z are left out.
    pub(super) is_in_plane: bool,
}

/// A run along a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trace {
    /// Pose of the path in the base.
    frame: IsometryMatrix3<f64>,
    station: Station,
    /// Whether the sensor has been at the beginning of the path.
    has_begun: bool,
    /// Speed along the path in the last step [m/s].
    speed: f64,
    /// Whether the sensor has reached the end.
    pub(super) is_done: bool,
}

/// The motion of one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Step {
    /// Velocity in the base [m/s].
    pub(super) velocity: Vector3<f64>,
    /// Distance from the path, or from its beginning until the sensor has been there [m].
    pub(super) distance: f64,
}

impl Trace {
    /// Returns a run before the beginning of a path whose pose in the base is given.
    pub(super) fn new(frame: IsometryMatrix3<f64>) -> Self {
        Self { frame, station: Station::default(), has_begun: false, speed: 0.0, is_done: false }
    }

    /// Returns the fraction of the path that is behind the sensor.
    pub(super) fn progress(&self, law: &Law) -> f64 {
        if self.is_done { 1.0 } else { (law.path.way(self.station) / law.path.length).clamp(0.0, 1.0) }
    }

    /// Begins from rest after a pause.
    pub(super) fn pause(&mut self) {
        self.speed = 0.0;
    }

    /// Advances to the pose of the sensor in the base, `dt` [s] after the last one.
    pub(super) fn step(&mut self, law: &Law, pose: &IsometryMatrix3<f64>, dt: f64) -> Step {
        let seen = self.frame.inverse() * pose;
        let place = seen.translation.vector;
        let normal = seen.rotation * Vector3::z();
        let flat = |v: Vector3<f64>| if law.is_in_plane { v - normal * normal.dot(&v) } else { v };
        if self.has_begun {
            self.station = law.path.follow(self.station, &place);
        }
        let offset = flat(law.path.point(self.station) - place);
        self.has_begun |= offset.norm() <= BEGIN_M;
        let correction = offset * law.gain;
        let mut velocity = correction * scale_to(correction.norm(), law.speed);
        if self.has_begun {
            let rest = law.path.length - law.path.way(self.station);
            self.is_done |= rest <= DONE_M;
            let share = (1.0 - offset.norm() / law.wait).max(0.0);
            let most = law.profile.speed(&law.path, self.station).min(law.speed) * share;
            let landing = stopping_speed(rest, law.acceleration, 1.0 / law.gain);
            self.speed = most.min(landing).min(self.speed + law.acceleration * dt);
            let along = law.path.direction(self.station) + law.path.curvature(self.station) * law.trail;
            velocity += flat(along) * self.speed;
        }
        Step { velocity: self.frame.rotation * velocity, distance: offset.norm() }
    }
}
