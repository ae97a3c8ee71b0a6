//! The play of a contact that sticks: after a turn of the motion, its place or angle follows only once the sensor has moved
//! so far.
//!
//! Dry friction at the pad holds the contact until the springs of the arm and the foam have taken up the friction. What is
//! left of a sine with the amplitude A is then, for a play p and x = p / (2 A),
//! N = 1/2 + (asin u + u √(1 - u²)) / π - j 4 x (1 - x) / π, with u = 1 - 2 x (the describing function of backlash;
//! Gelb and Vander Velde, Multiple-Input Describing Functions, 1968).

use std::f64::consts::PI;
use std::ops::RangeInclusive;

use super::experiment::known;
use super::spectrum::Line;
use crate::tool::control::contacts::Answer;
use crate::tool::control::law::Feature;

/// Largest frequency of the sines that count [Hz]. Near a resonance, the feature moves further than the sensor.
const SLOW_HZ: f64 = 0.75;
/// Share of a sine that is left if it counts [1]. With a smaller share, the contact may stick and only the foam moves. With
/// a larger one, the loss is as small as the noise.
const COUNTS: RangeInclusive<f64> = 0.4..=0.85;
/// The same for a contact that hardly slides with any sine: the play is then at least that of these sines [1].
const STICKS: RangeInclusive<f64> = 0.1..=0.4;
/// Number of sines that must count.
const ENOUGH: usize = 2;
/// Steps with which the play of a sine is found.
const STEPS: usize = 50;

/// Returns the play of a place [m] or an angle [rad]: the median of the sines that count, or else the largest one of those
/// that hardly slide the contact. `None` if too few sines count, or if the feature is of another kind.
pub(super) fn play<'a>(feature: &Feature, component: usize, lines: impl Iterator<Item = &'a Line>) -> Option<f64> {
    let whole = Answer::of_geometry(feature.quantity()?)?.row()[component].abs();
    let known = known(feature, component);
    let slow = lines.filter(|line| line.counts() && line.omega <= 2.0 * PI * SLOW_HZ);
    let left: Vec<(f64, f64)> =
        slow.map(|line| ((line.open / known(line.omega)).norm() / whole, line.amplitude)).collect();
    let of = |counts: RangeInclusive<f64>| {
        let counted = left.iter().filter(|(left, _)| counts.contains(left));
        let mut found: Vec<f64> = counted.map(|(left, amplitude)| 2.0 * amplitude * inverse(*left)).collect();
        found.sort_by(f64::total_cmp);
        (found.len() >= ENOUGH).then_some(found)
    };
    let at_least = || of(STICKS)?.last().copied();
    of(COUNTS).map(|found| found[found.len() / 2]).or_else(at_least)
}

/// Returns what is left of a sine, for a play of so many times twice its amplitude.
fn left(share: f64) -> f64 {
    let u = 1.0 - 2.0 * share;
    let real = 0.5 + (libm::asin(u) + u * libm::sqrt(1.0 - u * u)) / PI;
    libm::hypot(real, 4.0 * share * (1.0 - share) / PI)
}

/// Returns the play, as a multiple of twice the amplitude, that leaves so much of a sine.
fn inverse(wanted: f64) -> f64 {
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..STEPS {
        let middle = 0.5 * (low + high);
        *(if left(middle) > wanted { &mut low } else { &mut high }) = middle;
    }
    low
}

#[cfg(test)]
mod tests {
    use nalgebra::Complex;

    use super::*;
    use crate::tool::control::shape::turn;

    /// Runs a play in time, and returns what it leaves of a sine.
    fn in_time(play: f64, amplitude: f64) -> f64 {
        let samples = 2000;
        let (mut place, mut sum) = (0.0_f64, Complex::from(0.0));
        for tick in 0..2 * samples {
            let angle = 2.0 * PI * f64::from(tick) / f64::from(samples);
            let motion = amplitude * libm::sin(angle);
            place = place.clamp(motion - play / 2.0, motion + play / 2.0);
            if tick >= samples {
                sum += turn(angle) * place;
            }
        }
        sum.norm() * 2.0 / f64::from(samples) / amplitude
    }

    #[test]
    fn what_is_left_of_a_sine_is_what_a_play_leaves_in_time() {
        for play in [0.1, 0.5, 1.0, 1.6] {
            let ran = in_time(play, 1.0);
            assert!((left(play / 2.0) - ran).abs() < 2e-3, "{play}: {} and {ran}", left(play / 2.0));
            assert!((2.0 * inverse(ran) - play).abs() < 0.01, "{play}: {}", 2.0 * inverse(ran));
        }
    }

    /// The play of `y` with the responses of a contact with a play of 3 mm to these amplitudes [mm].
    fn found(amplitudes: &[f64]) -> Option<f64> {
        let feature = Feature {
            name: "y".into(),
            measured: Some("touch.moments.y".into()),
            column: [0.0, -1.0, 0.0, 0.0, 0.0, 0.0],
            kp: 2.0,
            period_s: 0.004,
            ..Feature::default()
        };
        let known = known(&feature, 1);
        let line = |amplitude: &f64| {
            let omega = 2.0 * PI * 0.5;
            let open = known(omega) * -in_time(3.0, *amplitude);
            Line { omega, open, amplitude: amplitude * 1e-3, error: 0.01 }
        };
        let lines: Vec<Line> = amplitudes.iter().map(line).collect();
        play(&feature, 1, lines.iter())
    }

    #[test]
    fn two_sines_that_count_give_the_play_and_one_does_not() {
        let play = found(&[0.3, 1.2, 2.4, 3.6, 30.0]).unwrap();
        assert!((play - 0.003).abs() < 2e-5, "{play}");
        assert_eq!(found(&[0.3, 1.2, 3.6, 30.0]), None);
        // Only 13 and 30 % of these are left.
        let play = found(&[0.3, 1.2, 1.8, 2.1]).unwrap();
        assert!((play - 0.003).abs() < 2e-5, "{play}");
    }
}
