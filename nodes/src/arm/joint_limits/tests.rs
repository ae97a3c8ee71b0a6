//! The intervals of joints, and the largest share against a search over all motions of the elbow.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;

fn joint(lower: f64, upper: f64, speed: f64) -> Joint {
    Joint { name: String::new(), lower, upper, speed, ..Joint::default() }
}

/// Six joints that each move one component of the twist, and more that move the first two as well.
fn columns(more: &[[f64; 2]]) -> Vec<[f64; 6]> {
    let own = (0..6).map(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    own.chain(more.iter().map(|[a, b]| [*a, *b, 0.0, 0.0, 0.0, 0.0])).collect()
}

struct Fitted {
    share: f64,
    velocity: Vec<f64>,
}

fn fit(columns: &[[f64; 6]], intervals: &[Interval], velocity: &[f64], drift: &[f64]) -> Fitted {
    let mut elbow = Elbow { intervals: intervals.to_vec(), ..Elbow::new(columns.len()) };
    let mut velocity = velocity.to_vec();
    let share = elbow.keep_direction(columns, &mut velocity);
    elbow.add_drift(columns, &mut velocity, drift);
    Fitted { share, velocity }
}

fn moved(columns: &[[f64; 6]], velocity: &[f64]) -> DVector<f64> {
    DMatrix::from_fn(6, columns.len(), |i, j| columns[j][i]) * DVector::from_column_slice(velocity)
}

#[test]
fn the_interval_of_a_joint_depends_on_its_position() {
    let unknown = joint(-1.0, 2.0, 3.0);
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
        let got = interval(&unknown, [q; 2], 0.25);
        assert!((got.0 - min).abs() < 1e-12 && (got.1 - max).abs() < 1e-12, "{what}: {got:?}");
    }
    // A stop from v takes v τ + v²/(2a) = v/4 + v²/8 with 4 rad/s².
    let slow = Joint { acceleration: 4.0, ..unknown };
    for (distance, speed) in [(0.12, 0.4), (0.375, 1.0), (1.0, 2.0), (1.875, 3.0), (2.5, 3.0)] {
        let got = interval(&slow, [2.0 - distance; 2], 0.25).1;
        assert!((got - speed).abs() < 1e-12, "at {distance}: {got}");
    }
}

#[test]
fn a_sum_is_added_if_each_joint_can_stop() {
    // A stop from 1 rad/s takes 0.25 rad + 0.125 rad.
    let joints = [Joint { acceleration: 4.0, ..joint(-1.0, 1.0, 1.5) }, joint(-9.0, 9.0, 2.0)];
    let cases = [
        ([0.62, 0.0], [0.5, 0.0], [0.5, 0.0], true, "there is room"),
        ([0.63, 0.0], [0.5, 0.0], [0.5, 0.0], false, "there is none"),
        ([-0.63, 0.0], [-0.5, 0.0], [-0.5, 0.0], false, "nor at the other end"),
        ([0.63, 0.0], [-0.5, 0.0], [-0.5, 0.0], true, "away from the limit"),
        ([1.5, 0.0], [-1.0, 0.0], [0.0, 0.0], true, "from outside"),
        ([0.0, 0.0], [1.0, 0.0], [0.6, 0.0], false, "too fast"),
        ([0.0, 0.0], [0.0, 1.0], [0.0, 1.0], true, "as fast as possible"),
        ([f64::NAN, 0.0], [0.1, 0.0], [0.0, 0.0], false, "not a number"),
    ];
    let ahead = add_within(&joints, [[0.0, 0.62], [0.0; 2]].into_iter(), 0.25, &mut [0.5, 0.0], &[0.5, 0.0]);
    let too_far = add_within(&joints, [[0.0, 0.63], [0.0; 2]].into_iter(), 0.25, &mut [0.5, 0.0], &[0.5, 0.0]);
    assert_eq!((ahead, too_far), (true, false), "the equilibrium counts too");
    for (q, mut velocity, drift, is_within, what) in cases {
        let before = velocity;
        assert_eq!(add_within(&joints, q.iter().map(|q| [*q; 2]), 0.25, &mut velocity, &drift), is_within, "{what}");
        let part = f64::from(u8::from(is_within));
        assert_eq!(velocity, [before[0] + part * drift[0], before[1] + part * drift[1]], "{what}");
    }
}

proptest! {
    // The speed falls with v dv/dd, which is below the acceleration.
    #[test]
    fn a_joint_can_brake_as_its_interval_asks(
        distance in 1e-3..3.0f64, gain in 0.5..20.0f64, acceleration in 0.5..40.0f64,
    ) {
        let joint = Joint { acceleration, ..joint(-9.0, 9.0, 50.0) };
        let speed = |distance: f64| interval(&joint, [9.0 - distance; 2], 1.0 / gain).1;
        let step = 1e-6;
        let braking = speed(distance) * (speed(distance + step) - speed(distance - step)) / (2.0 * step);
        prop_assert!(braking <= acceleration * (1.0 + 1e-6), "{} at {}", braking, distance);
        prop_assert!(speed(distance) <= gain * distance * (1.0 + 1e-9));
    }
}

#[test]
fn a_motion_within_all_intervals_is_not_changed() {
    let fitted = fit(&columns(&[[1.0, 0.0]]), &[(-1.0, 1.0); 7], &[0.5; 7], &[0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5]);
    assert_eq!(fitted.share, 1.0);
    let wanted = [1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.0];
    assert!(
        fitted.velocity.iter().zip(wanted).all(|(got, wanted)| (got - wanted).abs() < 1e-15),
        "{:?}",
        fitted.velocity
    );
}

#[test]
fn the_elbow_gives_way_before_the_task() {
    // The first and the last joint move the sensor alike, so the last one can do what the first one cannot.
    let columns = columns(&[[1.0, 0.0]]);
    let mut intervals = [(-1.0, 1.0); 7];
    intervals[0] = (-1.0, 0.0);
    let fitted = fit(&columns, &intervals, &[0.5, 0.2, 0.0, 0.0, 0.0, 0.0, 0.3], &[0.0; 7]);
    assert_eq!(fitted.share, 1.0);
    let wanted = [0.0, 0.2, 0.0, 0.0, 0.0, 0.0, 0.8];
    assert!(
        fitted.velocity.iter().zip(wanted).all(|(got, wanted)| (got - wanted).abs() < 1e-9),
        "{:?}",
        fitted.velocity
    );
    // Both together do 1 of the 2 that are asked, so half of the task is left.
    let fitted = fit(&columns, &intervals, &[1.0, 0.2, 0.0, 0.0, 0.0, 0.0, 1.0], &[0.0; 7]);
    assert!((fitted.share - 0.5).abs() < 1e-9, "{}", fitted.share);
    let wanted = [0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 1.0];
    assert!(
        fitted.velocity.iter().zip(wanted).all(|(got, wanted)| (got - wanted).abs() < 1e-9),
        "{:?}",
        fitted.velocity
    );
    // Without an elbow that moves the joint the task stops.
    intervals[1] = (0.0, 0.0);
    let fitted = fit(&columns, &intervals, &[1.0, 0.2, 0.0, 0.0, 0.0, 0.0, 1.0], &[0.0; 7]);
    assert_eq!((fitted.share, fitted.velocity.as_slice()), (0.0, [0.0; 7].as_slice()));
}

#[test]
fn an_arm_without_an_elbow_is_slowed_down_as_a_whole() {
    let intervals = [(-1.0, 1.0), (-2.0, 2.0), (-2.0, 2.0), (-2.0, 2.0), (-2.0, 2.0), (-2.0, 2.0)];
    let fitted = fit(&columns(&[]), &intervals, &[2.0, -1.0, 0.0, 0.0, 0.0, 0.0], &[0.0; 6]);
    assert!((fitted.share - 0.5).abs() < 1e-9);
    assert!((fitted.velocity[0] - 1.0).abs() < 1e-9 && (fitted.velocity[1] + 0.5).abs() < 1e-9);
}

#[test]
fn rounding_at_a_limit_does_not_stop_the_arm() {
    let mut intervals = [(-2.0, 2.0); 6];
    intervals[0] = (-2.0, 0.0);
    let fitted = fit(&columns(&[]), &intervals, &[1e-13, 1.0, 0.0, 0.0, 0.0, 0.0], &[0.0; 6]);
    assert_eq!(fitted.velocity, [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let fitted = fit(&columns(&[]), &intervals, &[1e-3, 1.0, 0.0, 0.0, 0.0, 0.0], &[0.0; 6]);
    assert_eq!(fitted.velocity, [0.0; 6], "a velocity above the threshold stops the whole motion");
}

proptest! {
    #[test]
    fn the_limits_hold_and_the_share_is_the_largest(
        extra in prop::array::uniform2(-1.0..1.0f64), task in prop::array::uniform7(-3.0..3.0f64),
        least in prop::array::uniform7(0.0..2.0f64), most in prop::array::uniform7(0.0..2.0f64),
        drift in -3.0..3.0f64,
    ) {
        let columns = columns(&[extra]);
        let intervals: [Interval; 7] = std::array::from_fn(|i| (-least[i], most[i]));
        // J n = 0 by construction.
        let elbow = [extra[0], extra[1], 0.0, 0.0, 0.0, 0.0, -1.0];
        let drift = elbow.map(|n| drift * n);
        let fitted = fit(&columns, &intervals, &task, &drift);
        for (v, (min, max)) in fitted.velocity.iter().zip(intervals) {
            prop_assert!((min..=max).contains(v), "{} not in {}..{}", v, min, max);
        }
        let off = moved(&columns, &fitted.velocity) - moved(&columns, &task) * fitted.share;
        prop_assert!(off.norm() < 1e-8, "the direction is kept: {}", off);
        // No amount of the elbow's motion allows a larger share. At one amount the shares that a joint allows are an
        // interval, and so are those that all joints allow.
        let allowed = |amount: f64| {
            let (mut least, mut most) = (0.0_f64, 1.0_f64);
            for (i, (min, max)) in intervals.iter().enumerate() {
                let ends = [(min - amount * elbow[i]) / task[i], (max - amount * elbow[i]) / task[i]];
                (least, most) = (least.max(ends[0].min(ends[1])), most.min(ends[0].max(ends[1])));
            }
            if least <= most { most } else { 0.0 }
        };
        for i in -400..=400 {
            let amount = f64::from(i) * 0.01;
            prop_assert!(allowed(amount) <= fitted.share + 1e-8, "{} at {}, not {}", allowed(amount), amount, fitted.share);
        }
    }

    #[test]
    fn a_small_change_changes_the_velocities_little(
        extra in prop::array::uniform2(0.2..1.0f64), task in prop::array::uniform7(-3.0..3.0f64),
        change in prop::array::uniform7(-1e-7..1e-7f64), room in prop::array::uniform7(0.0..2.0f64),
        drift in -3.0..3.0f64,
    ) {
        let columns = columns(&[extra]);
        let drift = [extra[0], extra[1], 0.0, 0.0, 0.0, 0.0, -1.0].map(|n| drift * n);
        let near: [f64; 7] = std::array::from_fn(|i| task[i] + change[i]);
        let [one, other] = [task, near].map(|task| fit(&columns, &room.map(|room| (-room, room)), &task, &drift));
        for (one, other) in one.velocity.iter().zip(&other.velocity) {
            prop_assert!((one - other).abs() < 1e-4, "{} and {}", one, other);
        }
    }
}
