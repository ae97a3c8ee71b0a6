//! Where the commands of an arm go.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use nalgebra::Vector3;
use tactflow_runtime::signal::Twist;

use super::course::Course;
use super::domain::{Domain, Writer};
use super::message::{Float64MultiArray, Header, JointTrajectory, Time, TwistStamped};
use crate::arm::chain::Chain;

/// The type of the commands.
#[derive(Debug, Clone)]
pub(super) enum Form {
    /// Trajectories that go on for `horizon` [s], and then come to rest.
    Trajectory { horizon: f64 },
    /// Velocities of the joints.
    Velocity,
    /// The twist of the tip that the velocities of the joints of `chain` amount to, in the axes of its base, whose name on
    /// the robot is `frame`.
    Twist { chain: Box<Chain>, frame: String },
}

/// How an arm is commanded.
#[derive(Debug, Clone)]
pub(super) struct Commanded {
    pub(super) form: Form,
    /// Age from which on a message is worth nothing [s].
    pub(super) lifespan: f64,
    /// Largest difference of the clocks [ns].
    pub(super) clock_bound: i64,
    /// Longest time until the arm rests without a message [s].
    pub(super) silence: f64,
}

impl Commanded {
    /// Whether each message says when the arm is at rest again.
    pub(super) const fn ends_at_rest(&self) -> bool {
        matches!(self.form, Form::Trajectory { .. })
    }

    /// Whether each message says when it was made, so that its reader can drop an old one.
    pub(super) const fn has_time(&self) -> bool {
        !matches!(self.form, Form::Velocity)
    }

    /// Whether another program computes the velocities of the joints.
    pub(super) const fn is_of_tip(&self) -> bool {
        matches!(self.form, Form::Twist { .. })
    }
}

/// What is sent.
pub(super) struct Said<'s> {
    pub(super) course: &'s Course,
    /// The names of the joints on the robot.
    pub(super) names: &'s [String],
    /// The measured posture [rad].
    pub(super) position: &'s [f64],
    /// When it was made [ns, wall clock].
    pub(super) made: i64,
}

/// The topic of the commands.
pub(super) enum Output {
    Trajectory(Writer<JointTrajectory>, f64),
    Velocity(Writer<Float64MultiArray>),
    Twist(Writer<TwistStamped>, Box<Chain>, String),
}

impl Output {
    pub(super) fn open(domain: &Domain, topic: &str, commanded: &Commanded) -> Result<Self, String> {
        let lifespan = Duration::from_secs_f64(commanded.lifespan);
        Ok(match &commanded.form {
            Form::Trajectory { horizon } => Self::Trajectory(domain.write(topic, lifespan)?, *horizon),
            Form::Velocity => Self::Velocity(domain.write(topic, lifespan)?),
            Form::Twist { chain, frame } => Self::Twist(domain.write(topic, lifespan)?, chain.clone(), frame.clone()),
        })
    }

    /// Says why nobody, or too many, command the arm over a topic. `None` if all is well.
    pub(super) fn trouble(&mut self, domain: &Domain, topic: &str) -> Option<String> {
        if !domain.writers(topic).is_empty() {
            return Some(format!("somebody else publishes on `{topic}` too: only one program may command an arm"));
        }
        match self {
            Self::Trajectory(writer, _) => writer.why_unread(domain, topic),
            Self::Velocity(writer) => writer.why_unread(domain, topic),
            Self::Twist(writer, ..) => writer.why_unread(domain, topic),
        }
    }

    /// Sends what an arm is to do. Returns whether it was taken.
    pub(super) fn say(&self, said: &Said<'_>) -> bool {
        match self {
            Self::Trajectory(writer, horizon) => writer.send(said.course.trajectory(said.names, said.made, *horizon)),
            Self::Velocity(writer) => writer.send(said.course.velocities()),
            Self::Twist(writer, chain, frame) => writer.send(twist(chain, frame, said)),
        }
    }
}

/// Returns the velocity of the origin of the tip and the angular velocity of the tip, both in the axes of the base. This is
/// what MoveIt Servo takes in its planning frame.
fn twist(chain: &Chain, frame: &str, said: &Said<'_>) -> TwistStamped {
    let mut columns = vec![Twist::default(); said.position.len()];
    let tip = chain.forward(said.position, &mut columns).0.translation.vector;
    let (mut at_base, mut angular) = (Vector3::zeros(), Vector3::zeros());
    for (column, velocity) in columns.iter().zip(&said.course.velocity) {
        at_base += column.linear() * *velocity;
        angular += column.angular() * *velocity;
    }
    let linear = at_base + angular.cross(&tip);
    let header = Header { stamp: Time::of_nanos(said.made), frame_id: frame.to_owned() };
    TwistStamped { header, linear: linear.into(), angular: angular.into() }
}

/// Returns the wall clock [ns since 1970].
pub(super) fn wall_clock() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64)
}

#[cfg(test)]
mod tests {
    use nalgebra::{IsometryMatrix3, Rotation3, Translation3};
    use tactflow_runtime::signal::Joint;

    use super::*;
    use crate::arm::chain::{ChainSegment, JointKind};

    #[test]
    fn a_twist_is_that_of_the_origin_of_the_tip_in_the_axes_of_the_base() {
        // A joint about z at (1, 0, 0), and the tip 0.5 m along its own y, which is turned by a right angle at q = pi/2.
        let fixed = IsometryMatrix3::from_parts(Translation3::new(1.0, 0.0, 0.0), Rotation3::identity());
        let (axis, motion) = (Vector3::z(), JointKind::Revolute);
        let tip = IsometryMatrix3::from_parts(Translation3::new(0.0, 0.5, 0.0), Rotation3::identity());
        let chain = Chain::new(vec![ChainSegment { fixed, axis, motion, joint: Joint::default() }], tip);
        let mut course = Course::new(1, 10.0);
        course.velocity = vec![2.0];
        let (names, position) = (["a".to_owned()], [std::f64::consts::FRAC_PI_2]);
        let made = twist(&chain, "base", &Said { course: &course, names: &names, position: &position, made: 7 });
        // The tip is at (0.5, 0, 0), so it moves along -y with 2 rad/s times 0.5 m.
        let expected = [0.0, -1.0, 0.0, 0.0, 0.0, 2.0];
        let found = [made.linear, made.angular].concat();
        assert!(found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12), "{made:?}");
        assert_eq!((made.header.frame_id.as_str(), made.header.stamp.nanos()), ("base", 7));
    }
}
