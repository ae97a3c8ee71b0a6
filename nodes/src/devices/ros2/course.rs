//! The course of an arm: from joint velocities to messages that end at rest.

use super::message::{Float64MultiArray, Header, JointTrajectory, Point, Time};

/// Where an arm is commanded to be, and how fast.
#[derive(Debug, Clone)]
pub(super) struct Course {
    /// Maximum acceleration of a joint [rad/s²].
    acceleration: f64,
    /// The posture that the velocities add up to [rad].
    pub(super) reference: Vec<f64>,
    /// The velocity that was sent last [rad/s].
    pub(super) velocity: Vec<f64>,
}

impl Course {
    pub(super) fn new(joints: usize, acceleration: f64) -> Self {
        Self { acceleration, reference: vec![0.0; joints], velocity: vec![0.0; joints] }
    }

    /// Whether the last message commands rest.
    pub(super) fn rests(&self) -> bool {
        self.velocity.iter().all(|velocity| *velocity == 0.0)
    }

    /// Goes on for `dt` [s], and approaches `commands`, or rest if there are none [rad/s].
    ///
    /// Commands are within the acceleration of the joints by themselves. The bound matters when the arm joins in while
    /// the graph already moves.
    pub(super) fn advance(&mut self, commands: Option<&[f64]>, dt: f64) {
        for (i, (reference, velocity)) in self.reference.iter_mut().zip(&mut self.velocity).enumerate() {
            *reference += *velocity * dt;
            let target = commands.map_or(0.0, |commands| commands[i]);
            let step = if commands.is_some() { 2.0 } else { 1.0 } * self.acceleration * dt;
            *velocity += (target - *velocity).clamp(-step, step);
        }
    }

    /// Stops without a ramp: an arm that has stopped by itself is not moved again by one.
    pub(super) fn halt(&mut self) {
        self.velocity.fill(0.0);
    }

    /// Returns the trajectory from now on [ns, wall clock]: on at the velocity for `horizon` [s], and then to rest. Without
    /// another one, the arm is at rest where it ends.
    ///
    /// Its first point is where the arm is now. A controller that had to find its way to a later point would begin anew with
    /// each message, and hardly move.
    pub(super) fn trajectory(&self, names: &[String], now: i64, horizon: f64) -> JointTrajectory {
        let fastest = self.velocity.iter().fold(0.0, |most: f64, velocity| most.max(velocity.abs()));
        let stop = fastest / self.acceleration;
        let at = |velocity: f64, way: f64, time: f64| Point {
            positions: self.reference.iter().zip(&self.velocity).map(|(q, v)| q + v * way).collect(),
            velocities: self.velocity.iter().map(|v| v * velocity).collect(),
            time_from_start: Time::of_nanos((time * 1e9).round() as i64),
            ..Point::default()
        };
        let mut points = vec![at(1.0, 0.0, 0.0)];
        if stop > 0.0 {
            points.push(at(1.0, horizon, horizon));
        }
        points.push(at(0.0, horizon + stop / 2.0, horizon + stop));
        let header = Header { stamp: Time::of_nanos(now), frame_id: String::new() };
        JointTrajectory { header, joint_names: names.to_vec(), points }
    }

    /// Returns the velocities alone. They say nothing of an end.
    pub(super) fn velocities(&self) -> Float64MultiArray {
        Float64MultiArray { data: self.velocity.clone(), ..Float64MultiArray::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trajectory_goes_on_and_ends_at_rest_within_the_acceleration() {
        let mut course = Course::new(2, 10.0);
        course.reference = vec![1.0, -1.0];
        course.velocity = vec![0.5, -0.25];
        let made = course.trajectory(&["a".into(), "b".into()], 2_500_000_000, 0.04);
        assert_eq!(made.header.stamp, Time { sec: 2, nanosec: 500_000_000 });
        assert_eq!(made.points.len(), 3);
        assert_eq!((made.points[0].time_from_start.nanos(), &made.points[0].positions), (0, &course.reference));
        // 0.5 rad/s for 40 ms; then to rest at 10 rad/s² in 50 ms, on half of the way.
        let [on, end] = [&made.points[1], &made.points[2]];
        assert_eq!((on.time_from_start.nanos(), end.time_from_start.nanos()), (40_000_000, 90_000_000));
        assert!((on.positions[0] - 1.02).abs() < 1e-12 && (end.positions[0] - 1.0325).abs() < 1e-12, "{made:?}");
        assert!((end.positions[1] + 1.01625).abs() < 1e-12, "{made:?}");
        assert_eq!((on.velocities.as_slice(), end.velocities.as_slice()), (&[0.5, -0.25][..], &[0.0, 0.0][..]));
        // At rest, both points are where the arm is.
        course.halt();
        let rest = course.trajectory(&["a".into(), "b".into()], 0, 0.04);
        assert_eq!(rest.points.len(), 2);
        assert_eq!(
            (rest.points[1].positions.as_slice(), &rest.points[1].velocities[..]),
            (&[1.0, -1.0][..], &[0.0; 2][..])
        );
    }

    #[test]
    fn it_joins_in_and_slows_down_without_a_jump() {
        let mut course = Course::new(1, 10.0);
        course.advance(Some(&[1.0]), 0.01);
        assert_eq!((course.reference[0], course.velocity[0]), (0.0, 0.2));
        course.advance(Some(&[0.1]), 0.01);
        assert!((course.reference[0] - 0.002).abs() < 1e-12 && (course.velocity[0] - 0.1).abs() < 1e-12, "{course:?}");
        course.advance(None, 0.005);
        assert!((course.velocity[0] - 0.05).abs() < 1e-12);
        course.advance(None, 1.0);
        assert!(course.rests());
    }
}
