//! Limits of joint velocities that keep the direction of the motion.
//!
//! Every joint has an interval of velocities: at most its greatest speed, and toward a position limit at most
//! `gain` times the distance to it, so that the limit is approached exponentially and never crossed. The task's part
//! is scaled by one factor until all joints are inside; what room that leaves is the posture's.

use tactflow_runtime::signal::Joint;

/// Share of the greatest velocity below which a joint's does not slow the others down: it is cut off by itself, which
/// turns the direction by no more. Otherwise rounding alone would freeze an arm with one joint at its limit.
const NEGLIGIBLE: f64 = 1e-9;

/// Least and greatest velocity of a joint at position `q`; a joint that is outside its range may only move back.
#[must_use]
pub fn interval(joint: &Joint, q: f64, gain: f64) -> (f64, f64) {
    // Not `clamp`, which passes on what is no number: such a position leaves no room.
    let within = |room: f64| (gain * room).max(0.0).min(joint.speed);
    (-within(q - joint.lower), within(joint.upper - q))
}

/// Scales `velocity` until every joint is within its limits; gives the factor.
pub fn limit(joints: &[Joint], q: &[f64], gain: f64, velocity: &mut [f64]) -> f64 {
    let bounds = || joints.iter().zip(q).map(|(joint, q)| interval(joint, *q, gain));
    let share = share(velocity, bounds());
    for (velocity, (least, greatest)) in velocity.iter_mut().zip(bounds()) {
        *velocity = (*velocity * share).clamp(least, greatest);
    }
    share
}

/// Adds as much of `extra` to a `velocity` within the limits as stays within them.
pub fn add_within(joints: &[Joint], q: &[f64], gain: f64, velocity: &mut [f64], extra: &[f64]) {
    let bounds = || joints.iter().zip(q).map(|(joint, q)| interval(joint, *q, gain));
    let left = bounds().zip(&*velocity).map(|((least, greatest), v)| (least - v, greatest - v));
    let share = share(extra, left);
    for ((velocity, extra), (least, greatest)) in velocity.iter_mut().zip(extra).zip(bounds()) {
        *velocity = (*velocity + *extra * share).clamp(least, greatest);
    }
}

/// The greatest factor up to 1 that brings every entry within its bounds; the bounds contain 0.
pub(crate) fn share(velocity: &[f64], bounds: impl Iterator<Item = (f64, f64)>) -> f64 {
    let largest = velocity.iter().fold(0.0, |largest: f64, v| largest.max(v.abs()));
    let mut share = 1.0f64;
    for (v, (least, greatest)) in velocity.iter().zip(bounds) {
        let bound = if *v > 0.0 { greatest } else { least };
        if v.abs() > NEGLIGIBLE * largest && v.abs() > bound.abs() {
            share = share.min(bound / v);
        }
    }
    share
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn joint(lower: f64, upper: f64, speed: f64) -> Joint {
        Joint { name: String::new(), lower, upper, speed, ..Joint::default() }
    }

    #[test]
    fn what_a_joint_may_do() {
        let joint = joint(-1.0, 2.0, 3.0);
        let cases = [
            (0.5, (-3.0, 3.0), "in the middle"),
            (1.9, (-3.0, 0.4), "near its upper limit"),
            (-0.75, (-1.0, 3.0), "near its lower limit"),
            (2.0, (-3.0, 0.0), "at its limit"),
            (2.5, (-3.0, 0.0), "past its upper limit"),
            (-9.0, (0.0, 3.0), "past its lower limit"),
            (f64::NAN, (0.0, 0.0), "nowhere"),
        ];
        for (q, (least, greatest), what) in cases {
            let got = interval(&joint, q, 4.0);
            assert!((got.0 - least).abs() < 1e-12 && (got.1 - greatest).abs() < 1e-12, "{what}: {got:?}");
        }
    }

    #[test]
    fn the_slowest_joint_sets_the_pace_and_the_rest_is_for_the_posture() {
        let joints = [joint(-9.0, 9.0, 1.0), joint(-9.0, 9.0, 2.0)];
        let mut velocity = [2.0, -1.0];
        assert_eq!(limit(&joints, &[0.0; 2], 1.0, &mut velocity), 0.5);
        assert_eq!(velocity, [1.0, -0.5]);
        add_within(&joints, &[0.0; 2], 1.0, &mut velocity, &[-1.0, -6.0]);
        assert_eq!(velocity, [0.75, -2.0]);
        add_within(&joints, &[0.0; 2], 1.0, &mut velocity, &[1.0, -1.0]);
        assert_eq!(velocity, [0.75, -2.0], "no room is left");
    }

    #[test]
    fn rounding_at_a_limit_does_not_freeze_the_arm() {
        let joints = [joint(-1.0, 1.0, 2.0), joint(-1.0, 1.0, 2.0)];
        let mut velocity = [1e-13, 1.0];
        limit(&joints, &[1.0, 0.0], 5.0, &mut velocity);
        assert_eq!(velocity, [0.0, 1.0]);
        let mut velocity = [1e-3, 1.0];
        limit(&joints, &[1.0, 0.0], 5.0, &mut velocity);
        assert_eq!(velocity, [0.0, 0.0], "but what is meant stops the motion as a whole");
    }

    proptest! {
        #[test]
        fn within_the_limits_and_in_the_same_direction(
            q in prop::array::uniform4(-1.2..1.2f64), wanted in prop::array::uniform4(-5.0..5.0f64),
            extra in prop::array::uniform4(-5.0..5.0f64), speed in prop::array::uniform4(0.1..3.0f64),
        ) {
            let joints = speed.map(|speed| joint(-1.0, 1.0, speed));
            let mut velocity = wanted;
            limit(&joints, &q, 4.0, &mut velocity);
            for (i, j) in [(0, 1), (1, 2), (2, 3)] {
                prop_assert!((velocity[i] * wanted[j] - velocity[j] * wanted[i]).abs() < 1e-12);
            }
            add_within(&joints, &q, 4.0, &mut velocity, &extra);
            for ((v, joint), q) in velocity.iter().zip(&joints).zip(q) {
                let (least, greatest) = interval(joint, q, 4.0);
                prop_assert!((least..=greatest).contains(v), "{} not in {}..{}", v, least, greatest);
            }
        }
    }
}
