//! Where the commands of an arm go.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::course::Course;
use super::domain::{Domain, Writer};
use super::message::{Float64MultiArray, JointTrajectory};

/// How an arm is commanded.
#[derive(Debug, Clone, Copy)]
pub(super) struct Commanded {
    /// How far a trajectory goes on [s]; `None` for velocities.
    pub(super) horizon: Option<f64>,
    /// Age from which on a message is worth nothing [s].
    pub(super) lifespan: f64,
    /// Largest difference of the clocks [ns].
    pub(super) clock_bound: i64,
    /// Longest time until the arm rests without a message [s].
    pub(super) silence: f64,
}

/// The topic of the commands.
pub(super) enum Output {
    /// Trajectories that go on for a time [s].
    Trajectory(Writer<JointTrajectory>, f64),
    Velocity(Writer<Float64MultiArray>),
}

impl Output {
    pub(super) fn open(domain: &Domain, topic: &str, commanded: &Commanded) -> Result<Self, String> {
        let lifespan = Duration::from_secs_f64(commanded.lifespan);
        Ok(match commanded.horizon {
            Some(horizon) => Self::Trajectory(domain.write(topic, lifespan)?, horizon),
            None => Self::Velocity(domain.write(topic, lifespan)?),
        })
    }

    /// Whether each message says when the arm is at rest again.
    pub(super) const fn ends_at_rest(&self) -> bool {
        matches!(self, Self::Trajectory(..))
    }

    /// Says why nobody, or too many, command the arm over a topic. `None` if all is well.
    pub(super) fn trouble(&mut self, domain: &Domain, topic: &str) -> Option<String> {
        if !domain.writers(topic).is_empty() {
            return Some(format!("somebody else publishes on `{topic}` too: only one program may command an arm"));
        }
        match self {
            Self::Trajectory(writer, _) => writer.why_unread(domain, topic),
            Self::Velocity(writer) => writer.why_unread(domain, topic),
        }
    }

    /// Sends what an arm is to do, as it was made at a time [ns, wall clock]. Returns whether it was taken.
    pub(super) fn say(&self, course: &Course, names: &[String], made: i64) -> bool {
        match self {
            Self::Trajectory(writer, horizon) => writer.send(course.trajectory(names, made, *horizon)),
            Self::Velocity(writer) => writer.send(course.velocities()),
        }
    }
}

/// Returns the wall clock [ns since 1970].
pub(super) fn wall_clock() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64)
}
