//! The posture that the driver commands: it mirrors the controller's, or integrates velocities from it.
//!
//! q += v dt, with the time between two measurements that the controller states. A step is shortened as a whole, so that
//! its direction holds. Nothing is ever added for datagrams that were lost: the target goes on where it was.

use std::time::Instant;

use tactflow_runtime::signal::Joint;
use tactflow_runtime::signal::line::{approach, scale_to};

use super::wire::{JOINTS, Joints};

/// Steps that may follow each other at once, after datagrams that came late together. A process that was stopped finds
/// more of them, and must not run through all.
const MAX_BURST: f64 = 3.0;
/// How far the controller may be from the target, in steps at maximum speed. Answers are some cycles on their way, and
/// some are lost.
const MAX_STEPS_APART: f64 = 10.0;
/// What the precision of the wire adds to a difference between two postures [rad].
const ROUNDING: f64 = 1e-5;

/// The commanded posture, and the velocity with which it moves.
#[derive(Debug, Clone)]
pub(super) struct Target {
    position: Joints,
    /// The velocity of the last step [rad/s].
    velocity: Joints,
    /// Whether the velocity has reached the commanded one since it last rested.
    follows: bool,
    /// Real time that is not stepped yet [s], and when it was counted.
    credit: f64,
    counted: Option<Instant>,
    bounds: Bounds,
}

/// Bounds of the motion of each joint.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    /// Lower and upper end [rad].
    ends: [(f64, f64); JOINTS],
    /// Maximum speed [rad/s].
    speed: Joints,
    /// Maximum acceleration [rad/s²].
    acceleration: Joints,
    /// Maximum step [rad].
    step: f64,
}

impl Bounds {
    /// The bounds of seven joints, with a maximum `step` [rad].
    pub(super) fn new(joints: &[Joint], step: f64) -> Self {
        Self {
            ends: std::array::from_fn(|i| (joints[i].lower, joints[i].upper)),
            speed: std::array::from_fn(|i| joints[i].speed),
            acceleration: std::array::from_fn(|i| joints[i].acceleration),
            step,
        }
    }
}

impl Target {
    /// A target at rest.
    pub(super) const fn new(bounds: Bounds) -> Self {
        let (position, velocity) = ([0.0; JOINTS], [0.0; JOINTS]);
        Self { position, velocity, follows: false, credit: 0.0, counted: None, bounds }
    }

    /// Returns the commanded posture [rad].
    pub(super) const fn position(&self) -> &Joints {
        &self.position
    }

    /// Takes over the posture that the controller commands [rad], at rest.
    pub(super) const fn mirror(&mut self, posture: &Joints) {
        self.position = *posture;
        self.velocity = [0.0; JOINTS];
        self.follows = false;
        (self.credit, self.counted) = (0.0, None);
    }

    /// Returns why the controller, which commands a `posture` [rad], does not follow the target; `None` if it does. `dt` is
    /// the sample time [s].
    pub(super) fn fault_of_following(&self, posture: &Joints, dt: f64) -> Option<String> {
        let room = |i: usize| MAX_STEPS_APART * self.room(i, dt) + ROUNDING;
        let apart = |i: usize| (posture[i] - self.position[i]).abs();
        let joint = (0..JOINTS).find(|i| apart(*i) > room(*i))?;
        let (number, apart, room) = (joint + 1, apart(joint), room(joint));
        Some(format!(
            "its controller does not follow: it commands joint {number} from the base {apart:.4} rad away from the answers, \
             and {room:.4} rad are allowed"
        ))
    }

    /// Returns the maximum step of a joint in a sample time `dt` [s].
    const fn room(&self, joint: usize, dt: f64) -> f64 {
        self.bounds.step.min(self.bounds.speed[joint] * dt)
    }

    /// Moves at a `velocity` [rad/s] for a sample time `dt` [s], up to the moment `now`. From rest, it reaches the
    /// velocity with the accelerations of the joints. Returns whether the step was shortened.
    pub(super) fn step(&mut self, velocity: &[f64], dt: f64, now: Instant) -> bool {
        let elapsed = self.counted.replace(now).map_or(0.0, |counted| (now - counted).as_secs_f64());
        self.credit = (self.credit + elapsed).min(MAX_BURST * dt);
        let time = dt.min(self.credit);
        self.credit -= time;
        if self.follows {
            self.velocity.copy_from_slice(velocity);
        } else {
            self.follows = approach(&mut self.velocity, |i| velocity[i], &self.bounds.acceleration, dt);
        }
        let scale = |(i, v): (usize, &f64)| scale_to((v * time).abs(), self.room(i, dt));
        let scale = self.velocity.iter().enumerate().map(scale).fold(1.0, f64::min);
        let mut is_shortened = scale < 1.0;
        for ((q, v), (lower, upper)) in self.position.iter_mut().zip(&self.velocity).zip(&self.bounds.ends) {
            let next = *q + v * time * scale;
            // A joint beyond an end moves back only.
            let bounded = next.clamp(lower.min(*q), upper.max(*q));
            is_shortened |= bounded != next;
            *q = bounded;
        }
        is_shortened
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use proptest::prelude::*;

    use super::*;

    const DT: f64 = 0.004;
    const START: Joints = [0.1, 0.5, -0.2, -1.3, 0.3, 1.3, 0.0];

    fn target(acceleration: f64, step: f64) -> Target {
        let joint = Joint { lower: -2.0, upper: 2.0, speed: 2.0, acceleration, ..Joint::default() };
        let mut target = Target::new(Bounds::new(&vec![joint; 7], step));
        target.mirror(&START);
        target
    }

    fn along_first(v: f64) -> Joints {
        [v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    #[test]
    fn it_starts_where_the_controller_is_and_integrates_from_there() {
        let (mut target, now) = (target(f64::INFINITY, 1.0), Instant::now());
        for i in 0..=250 {
            assert!(!target.step(&along_first(0.5), DT, now + Duration::from_millis(4 * i)));
            assert!((target.position()[0] - 0.1 - 0.5 * DT * i as f64).abs() < 1e-12, "{i}");
        }
        assert_eq!(target.position()[1..], START[1..]);
        target.mirror(&[1.0; 7]);
        assert_eq!(target.position(), &[1.0; 7]);
        target.step(&along_first(0.5), DT, now + Duration::from_secs(2));
        assert_eq!(target.position(), &[1.0; 7], "the first step after it was mirrored is none");
    }

    #[test]
    fn from_rest_it_speeds_up_with_the_acceleration() {
        // 10 rad/s² in steps of 4 ms: 0.04, 0.08, 0.1 rad/s.
        let (mut target, now) = (target(10.0, 1.0), Instant::now());
        let mut last = target.position()[0];
        for (i, speed) in [0.0, 0.08, 0.1, 0.1].into_iter().enumerate() {
            target.step(&along_first(0.1), DT, now + Duration::from_millis(4 * i as u64));
            assert!((target.position()[0] - last - speed * DT).abs() < 1e-12, "{i}");
            last = target.position()[0];
        }
        // Then it follows at once.
        target.step(&along_first(0.0), DT, now + Duration::from_millis(16));
        assert_eq!(target.position()[0], last);
    }

    #[test]
    fn after_a_gap_it_goes_on_where_it_was() {
        for lost in [1, 5, 30] {
            let (mut target, now) = (target(f64::INFINITY, 1.0), Instant::now());
            let mut last = START[0];
            for i in 0..20_u64 {
                let at = if i < 10 { i } else { i + lost };
                target.step(&along_first(0.5), DT, now + Duration::from_millis(4 * at));
                let step = target.position()[0] - last;
                assert!(step <= 0.5 * DT + 1e-12, "{step} after {lost} lost ones");
                last = target.position()[0];
            }
        }
    }

    #[test]
    fn datagrams_that_waited_for_a_stopped_process_move_it_by_three_steps_at_most() {
        let (mut target, now) = (target(f64::INFINITY, 1.0), Instant::now());
        (0..10).for_each(|i| _ = target.step(&along_first(0.5), DT, now + Duration::from_millis(4 * i)));
        let (before, late) = (target.position()[0], now + Duration::from_millis(740));
        (0..175).for_each(|_| _ = target.step(&along_first(0.5), DT, late));
        assert!((target.position()[0] - before - 3.0 * 0.5 * DT).abs() < 1e-12);
    }

    #[test]
    fn a_controller_far_from_the_target_does_not_follow() {
        // 2 rad/s for 4 ms are 8 mrad, ten of which are 80 mrad; a shorter step counts instead.
        for (step, most) in [(1.0, 0.08), (0.001, 0.01)] {
            let target = target(10.0, step);
            for (share, follows) in [(0.0, true), (0.99, true), (-0.99, true), (1.01, false), (-1.01, false)] {
                let mut posture = START;
                posture[3] += share * most;
                let fault = target.fault_of_following(&posture, DT);
                assert_eq!(fault.is_none(), follows, "{share} of {most} rad: {fault:?}");
                assert!(fault.is_none_or(|fault| fault.contains("joint 4 ")));
            }
        }
    }

    #[test]
    fn jitter_does_not_slow_it_down() {
        let (mut target, now) = (target(f64::INFINITY, 1.0), Instant::now());
        target.step(&along_first(0.25), DT, now);
        // Each datagram comes up to 3 ms late.
        for i in 1..=1000_u64 {
            target.step(&along_first(0.25), DT, now + Duration::from_millis(4 * i + i * 7 % 4));
        }
        let moved = target.position()[0] - START[0];
        assert!((moved - 1.0).abs() < 0.25 * DT, "{moved}");
    }

    #[test]
    fn a_step_is_shortened_as_a_whole_and_ends_at_the_limits() {
        let (mut target, now) = (target(f64::INFINITY, 0.001), Instant::now());
        target.step(&[0.0; 7], DT, now);
        assert!(target.step(&[0.5, 0.25, 0.0, 0.0, 0.0, 0.0, -1.0], DT, now + Duration::from_millis(4)));
        let moved: Vec<f64> = target.position().iter().zip(START).map(|(q, start)| q - start).collect();
        for (moved, expected) in moved.iter().zip([0.0005, 0.00025, 0.0, 0.0, 0.0, 0.0, -0.001]) {
            assert!((moved - expected).abs() < 1e-12, "{moved:?}");
        }
        // A joint beyond its end does not move on, and comes back.
        target.mirror(&[2.1, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        target.step(&[0.0; 7], DT, now);
        assert!(target.step(&[0.1, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0], DT, now + Duration::from_millis(4)));
        assert_eq!(target.position()[..2], [2.1, 2.0]);
        assert!(!target.step(&[-0.1, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0], DT, now + Duration::from_millis(8)));
        assert!(target.position()[0] < 2.1 && target.position()[1] < 2.0);
    }

    proptest! {
        #[test]
        fn no_velocity_and_no_times_make_a_step_longer_than_allowed(
            steps in prop::collection::vec((prop::array::uniform7(-50.0..50.0_f64), 0_u64..100), 1..60),
            dt in 0.0005..0.1_f64,
            largest in 0.0001..0.1_f64,
        ) {
            let (mut target, mut now) = (target(20.0, largest), Instant::now());
            for (velocity, ms) in steps {
                let last = *target.position();
                now += Duration::from_millis(ms);
                target.step(&velocity, dt, now);
                for (q, last) in target.position().iter().zip(last) {
                    prop_assert!((q - last).abs() <= largest.min(2.0 * dt) + 1e-12);
                    prop_assert!((-2.0..=2.0).contains(q));
                }
            }
        }
    }
}
