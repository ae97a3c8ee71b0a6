//! A brake for a contact that slides faster than its controller asks for, as dry friction lets it do.

use crate::servo::integral::flush_subnormal;

/// Time constant of the low-pass filter of the error's rate [s].
const SMOOTH_S: f64 = 0.03;
/// Part of the excess of speed that brakes the contact. With 0.3, a loop with 60 ms of delay can hunt [1].
const PART: f64 = 0.2;

/// Returns the smooth rate of an error after its next slope, `dt` after the last one [s].
pub(super) fn smoothed(rate: f64, slope: f64, dt: f64) -> f64 {
    flush_subnormal(rate + (slope - rate) * -libm::expm1(-dt / SMOOTH_S))
}

/// Returns the control, less a fifth of the speed by which the contact slides faster than the control asks for, beyond
/// `above`. All are in the unit of the feature per second.
pub(super) fn braked(control: f64, rate: f64, above: f64) -> f64 {
    // A contact that slides as the control asks reduces the error by it.
    let slides = -rate;
    let faster = slides - control.clamp(slides.min(0.0), slides.max(0.0));
    control - PART * (faster - faster.clamp(-above, above))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_contact_that_slides_no_faster_than_it_may_is_left_alone() {
        for control in [0.0, 0.007, -0.02, 0.3] {
            for rate in [0.0, -0.5 * control, -control, -control - 0.009, -control + 0.009] {
                assert_eq!(braked(control, rate, 0.01), control, "{control}, {rate}");
            }
        }
    }

    #[test]
    fn a_contact_that_slides_faster_is_braked() {
        for side in [1.0, -1.0] {
            let found = |control: f64, rate: f64| side * braked(side * control, side * rate, 0.01);
            assert!(
                (found(0.01, -0.035) - (0.01 - 0.2 * 0.015)).abs() < 1e-12,
                "25 mm/s too fast, and 10 are left alone"
            );
            assert!((found(0.0, -0.035) + 0.2 * 0.025).abs() < 1e-12, "at the setpoint");
            assert!((found(-0.01, -0.035) - (-0.01 - 0.2 * 0.025)).abs() < 1e-12, "beyond it");
        }
    }

    #[test]
    fn the_rate_of_a_ramp_is_its_slope_whatever_the_period() {
        for dt in [0.001, 0.004, 0.02] {
            let steps = (0.12_f64 / dt).round() as u32;
            let rate = (0..steps).fold(0.0, |rate, _| smoothed(rate, 2.0, dt));
            assert!((rate - 2.0 * (1.0 - (-4.0_f64).exp())).abs() < 1e-9, "{dt}: {rate}");
        }
        assert_eq!((0..10_000).fold(1.0, |rate, _| smoothed(rate, 0.0, 0.004)), 0.0, "it ends at zero");
    }

    /// A simulated loop with 4 1/s and a delay of some samples of 4 ms. The arm has this resonance [Hz] and damping ratio,
    /// and the contact follows it with a play [m].
    struct Loop {
        hertz: f64,
        damping: f64,
        late: usize,
        play: f64,
    }

    impl Loop {
        /// Returns the largest error in the last 2 s of 10 s that begin with 10 mm [m].
        fn left(&self, above: f64) -> f64 {
            let (dt, resonance) = (0.004, self.hertz * TAU);
            let mut errors = vec![0.01; self.late + 2];
            let (mut rate, mut control, mut wanted, mut place, mut speed, mut contact) =
                (0.0, 0.0_f64, 0.0, 0.0, 0.0, 0.0);
            for _ in 0..2500 {
                let [last, error] = [2, 1].map(|back| errors[errors.len() - self.late - back]);
                rate = smoothed(rate, (error - last) / dt, dt);
                let most = (control.abs() + 0.25 * dt).max(0.005);
                control = braked(4.0 * error, rate, above).clamp(-most, most);
                for _ in 0..4 {
                    wanted += control * dt / 4.0;
                    speed += resonance * (resonance * (wanted - place) - 2.0 * self.damping * speed) * dt / 4.0;
                    place += speed * dt / 4.0;
                }
                contact = f64::clamp(contact, place - self.play / 2.0, place + self.play / 2.0);
                errors.push(0.01 - contact);
            }
            errors[errors.len() - 500..].iter().fold(0.0, |most, error| most.max(error.abs()))
        }
    }

    #[test]
    fn it_makes_no_loop_hunt_that_has_a_gain_margin_of_8_db() {
        let mut calmer = 0;
        for (hertz, damping, late) in [
            (1.2, 0.8, 2),
            (1.5, 0.63, 2),
            (1.5, 1.3, 15),
            (2.0, 0.44, 2),
            (2.5, 0.64, 15),
            (3.0, 0.3, 2),
            (6.0, 0.15, 2),
        ] {
            for play in [0.0, 0.0005, 0.001, 0.002, 0.004, 0.0075] {
                let run = Loop { hertz, damping, late, play };
                let without = run.left(f64::INFINITY);
                for above in [0.0, 0.003, 0.01] {
                    let with = run.left(above);
                    let what = format!("{hertz} Hz, {damping}, {late}, {play} m, {above} m/s: {with} and {without} m");
                    assert!(with < (2.0 * without).max(3e-4), "{what}");
                    calmer += usize::from(without > 3e-4 && with < 3e-4);
                }
            }
        }
        assert!(calmer > 0, "it ends no hunting");
    }

    proptest! {
        #[test]
        fn the_control_is_bounded_and_does_not_jump(control in -0.1..0.1_f64, rate in -0.1..0.1_f64) {
            let found = braked(control, rate, 0.01);
            prop_assert!((found - control).abs() <= 0.2 * rate.abs() + 1e-15);
            for (more, faster) in [(1e-9, 0.0), (0.0, 1e-9)] {
                prop_assert!((braked(control + more, rate + faster, 0.01) - found).abs() < 2e-9);
            }
        }
    }
}
