//! Limits of joint velocities that keep the direction of the motion.
//!
//! Every joint has an interval of velocities: at most its largest speed, and toward a position limit at most `gain`
//! times the distance to it, so that the limit is approached exponentially and never crossed. One factor scales the
//! velocities of the task until all joints are within their intervals. The posture gets the velocity that is left.

use tactflow_runtime::signal::Joint;

use crate::motion::bounds::scale_into;

/// Returns the smallest and the largest velocity of a joint at position `q`, for a `gain` [1/s].
///
/// A joint outside its range may only move back.
#[must_use]
pub fn interval(joint: &Joint, q: f64, gain: f64) -> (f64, f64) {
    // Not `clamp`, which keeps a value that is not a number: such a position leaves no room.
    let within = |room: f64| (gain * room).max(0.0).min(joint.speed);
    (-within(q - joint.lower), within(joint.upper - q))
}

/// Scales `velocity` until every joint is within its limits. Returns the factor.
pub fn limit(joints: &[Joint], q: &[f64], gain: f64, velocity: &mut [f64]) -> f64 {
    let bounds = || joints.iter().zip(q).map(|(joint, q)| interval(joint, *q, gain));
    let scale = scale_into(velocity, bounds());
    for (velocity, (min, max)) in velocity.iter_mut().zip(bounds()) {
        *velocity = (*velocity * scale).clamp(min, max);
    }
    scale
}

/// Adds as much of `extra` to a `velocity` within the limits as stays within them.
pub fn add_within(joints: &[Joint], q: &[f64], gain: f64, velocity: &mut [f64], extra: &[f64]) {
    let bounds = || joints.iter().zip(q).map(|(joint, q)| interval(joint, *q, gain));
    let left = bounds().zip(&*velocity).map(|((min, max), v)| (min - v, max - v));
    let scale = scale_into(extra, left);
    for ((velocity, extra), (min, max)) in velocity.iter_mut().zip(extra).zip(bounds()) {
        *velocity = (*velocity + *extra * scale).clamp(min, max);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn joint(lower: f64, upper: f64, speed: f64) -> Joint {
        Joint { name: String::new(), lower, upper, speed, ..Joint::default() }
    }

    #[test]
    fn the_interval_of_a_joint_depends_on_its_position() {
        let joint = joint(-1.0, 2.0, 3.0);
        let cases = [
            (0.5, (-3.0, 3.0), "in the middle"),
            (1.9, (-3.0, 0.4), "near its upper limit"),
            (-0.75, (-1.0, 3.0), "near its lower limit"),
            (2.0, (-3.0, 0.0), "at its limit"),
            (2.5, (-3.0, 0.0), "past its upper limit"),
            (-9.0, (0.0, 3.0), "past its lower limit"),
            (f64::NAN, (0.0, 0.0), "not a number"),
        ];
        for (q, (min, max), what) in cases {
            let got = interval(&joint, q, 4.0);
            assert!((got.0 - min).abs() < 1e-12 && (got.1 - max).abs() < 1e-12, "{what}: {got:?}");
        }
    }

    #[test]
    fn the_slowest_joint_scales_the_task_and_the_posture_gets_the_rest() {
        let joints = [joint(-9.0, 9.0, 1.0), joint(-9.0, 9.0, 2.0)];
        let mut velocity = [2.0, -1.0];
        assert_eq!(limit(&joints, &[0.0; 2], 1.0, &mut velocity), 0.5);
        assert_eq!(velocity, [1.0, -0.5]);
        add_within(&joints, &[0.0; 2], 1.0, &mut velocity, &[-1.0, -6.0]);
        assert_eq!(velocity, [0.75, -2.0]);
        add_within(&joints, &[0.0; 2], 1.0, &mut velocity, &[1.0, -1.0]);
        assert_eq!(velocity, [0.75, -2.0], "there is no room left");
    }

    #[test]
    fn rounding_at_a_limit_does_not_stop_the_arm() {
        let joints = [joint(-1.0, 1.0, 2.0), joint(-1.0, 1.0, 2.0)];
        let mut velocity = [1e-13, 1.0];
        limit(&joints, &[1.0, 0.0], 5.0, &mut velocity);
        assert_eq!(velocity, [0.0, 1.0]);
        let mut velocity = [1e-3, 1.0];
        limit(&joints, &[1.0, 0.0], 5.0, &mut velocity);
        assert_eq!(velocity, [0.0, 0.0], "a velocity above the threshold stops the whole motion");
    }

    proptest! {
        #[test]
        fn the_result_is_within_the_limits_and_keeps_its_direction(
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
                let (min, max) = interval(joint, q, 4.0);
                prop_assert!((min..=max).contains(v), "{} not in {}..{}", v, min, max);
            }
        }
    }
}
