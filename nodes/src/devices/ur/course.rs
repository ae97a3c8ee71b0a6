//! What the driver waits for, and which velocity the robot gets meanwhile.

use std::time::Instant;

use super::recipe::JOINTS;

/// What the driver waits for.
#[derive(Debug, Clone, Copy)]
pub(super) enum Phase {
    /// The program on the robot starts.
    Starting { since: Instant, has_sent: bool },
    /// The robot follows velocities.
    Ready,
    /// The robot must not move, until the operator resumes.
    Refused,
}

impl Phase {
    /// The program is to start now.
    pub(super) fn start() -> Self {
        Self::Starting { since: Instant::now(), has_sent: false }
    }
}

/// What becomes of the commands of a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Course {
    /// The robot follows them.
    Follow,
    /// It follows them as far as no joint gets faster: they are refused, and ramp to zero.
    Lower,
    /// It slows down, whatever they are.
    Slow,
}

impl Course {
    /// Returns what becomes of commands for which the robot was checked, or not, and that are refused, or not.
    pub(super) const fn of(phase: Phase, is_checked: bool, is_refused: bool) -> Self {
        match phase {
            Phase::Ready if is_checked => Self::Follow,
            Phase::Ready | Phase::Refused if is_refused => Self::Lower,
            _ => Self::Slow,
        }
    }

    /// Returns the velocity after the last one [rad/s].
    pub(super) fn next(
        self,
        last: &[f64; JOINTS],
        commands: &[f64; JOINTS],
        acceleration: f64,
        dt: f64,
    ) -> [f64; JOINTS] {
        match self {
            Self::Follow => approached(last, commands, acceleration, dt),
            Self::Lower => approached(last, &lowered(last, commands), acceleration, dt),
            Self::Slow => slowed(last, acceleration, dt),
        }
    }
}

/// Returns the next velocity on the way from the last one to a target [rad/s].
///
/// The commands themselves are within the acceleration of the joints. This one matters when the robot joins in while the
/// graph already moves. A target of zero holds at once: the lease commands it without a ramp only to a robot that has
/// stopped by itself.
fn approached(last: &[f64; JOINTS], target: &[f64; JOINTS], acceleration: f64, dt: f64) -> [f64; JOINTS] {
    let step = 2.0 * acceleration * dt;
    std::array::from_fn(|i| match target[i] {
        0.0 => 0.0,
        target => last[i] + (target - last[i]).clamp(-step, step),
    })
}

/// Returns the part of a target that is between rest and the last velocity [rad/s]: no joint gets faster.
fn lowered(last: &[f64; JOINTS], target: &[f64; JOINTS]) -> [f64; JOINTS] {
    std::array::from_fn(|i| target[i].clamp(last[i].min(0.0), last[i].max(0.0)))
}

/// Returns the next velocity on the way from the last one to rest [rad/s].
fn slowed(last: &[f64; JOINTS], acceleration: f64, dt: f64) -> [f64; JOINTS] {
    let step = acceleration * dt;
    last.map(|v| v - v.clamp(-step, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The operator can resume at any moment of a cycle, also between the checks and the message.
    #[test]
    fn commands_that_were_resumed_since_the_checks_move_nothing() {
        let (rest, commands) = ([0.0; JOINTS], [0.1; JOINTS]);
        for (phase, is_checked, is_refused, expected) in [
            (Phase::Ready, true, false, Course::Follow),
            (Phase::Ready, true, true, Course::Follow),
            (Phase::Ready, false, false, Course::Slow),
            (Phase::Ready, false, true, Course::Lower),
            (Phase::Refused, true, true, Course::Lower),
            (Phase::Refused, true, false, Course::Slow),
            (Phase::start(), true, false, Course::Slow),
        ] {
            let course = Course::of(phase, is_checked, is_refused);
            assert_eq!(course, expected, "{phase:?}, {is_checked}, {is_refused}");
            let moves = course.next(&rest, &commands, 10.0, 0.002) != rest;
            assert_eq!(moves, expected == Course::Follow, "{phase:?}, {is_checked}, {is_refused}");
        }
    }

    #[test]
    fn the_velocity_joins_in_without_a_jump_and_stops_at_once() {
        let target = [1.0, -1.0, 0.01, 0.0, 0.0, 0.0];
        let first = approached(&[0.0; JOINTS], &target, 10.0, 0.002);
        assert_eq!(first, [0.04, -0.04, 0.01, 0.0, 0.0, 0.0]);
        let many = (0..100).fold([0.0; JOINTS], |last, _| approached(&last, &target, 10.0, 0.002));
        assert_eq!(many, target);
        assert_eq!(approached(&many, &[0.0; JOINTS], 10.0, 0.002), [0.0; JOINTS]);
    }

    #[test]
    fn a_robot_that_may_not_move_only_gets_slower() {
        let last = [1.0, -1.0, 0.01, 0.0, 0.0, 0.5];
        assert_eq!(slowed(&last, 10.0, 0.002), [0.98, -0.98, 0.0, 0.0, 0.0, 0.48]);
        let target = [0.5, -2.0, -0.01, 0.3, -0.3, 0.5];
        assert_eq!(lowered(&last, &target), [0.5, -1.0, 0.0, 0.0, 0.0, 0.5]);
    }
}
