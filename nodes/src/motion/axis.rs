//! Angles of lines: a line at 0 and a line at pi are the same, so its angle is known modulo pi.
//!
//! Angles of lines cannot be averaged, as 89 and -89 degrees are neighbours. The unit vectors of the doubled angles
//! can.

use std::f64::consts::{FRAC_PI_2, PI};

/// Smallest length of a mean of doubled axes that has a direction: below it the axes cancel each other [1].
const MIN_RESULTANT: f64 = 1e-6;

/// Returns the angle of the same line in (-pi/2, pi/2] [rad], as the paper wraps the angular error (section IV, below
/// eq. 3).
///
/// The result is exact: the remainder and both shifts are free of rounding. An angle in the range is returned
/// unchanged, so wrapping twice changes no bit.
///
/// ```
/// use std::f64::consts::{FRAC_PI_2, PI};
/// use tactflow_nodes::motion::axis::wrap_axial;
///
/// assert_eq!(wrap_axial(0.3), 0.3);
/// assert_eq!(wrap_axial(-FRAC_PI_2), FRAC_PI_2);
/// assert_eq!(wrap_axial(2.0 * PI), 0.0);
/// ```
#[must_use]
pub fn wrap_axial(angle: f64) -> f64 {
    if -FRAC_PI_2 < angle && angle <= FRAC_PI_2 {
        return angle;
    }
    let angle = angle % PI;
    if angle > FRAC_PI_2 {
        angle - PI
    } else if angle <= -FRAC_PI_2 {
        angle + PI
    } else {
        angle
    }
}

/// Returns the angle of a line in (-pi/2, pi/2] [rad] from the sine and the cosine of its doubled angle.
///
/// Both may have a common positive factor.
#[must_use]
pub fn half_angle(sine: f64, cosine: f64) -> f64 {
    let angle = 0.5 * libm::atan2(sine, cosine);
    // A sine of -0, or one too small to count, would give the other name of the same line.
    if angle > -FRAC_PI_2 { angle } else { FRAC_PI_2 }
}

/// Returns the unit vector of a line's doubled angle, `[cosine, sine]`, which can be averaged.
#[must_use]
pub fn doubled(angle: f64) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(2.0 * angle);
    [cosine, sine]
}

/// Returns the line [rad] whose doubled angle is the direction of a mean of [`doubled`] vectors, or `None` if the lines
/// cancel each other.
#[must_use]
pub fn halved([cosine, sine]: [f64; 2]) -> Option<f64> {
    ((cosine * cosine + sine * sine).sqrt() >= MIN_RESULTANT).then(|| half_angle(sine, cosine))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_range_is_open_below_and_closed_above() {
        let above = FRAC_PI_2.next_up();
        let cases = [
            (0.0, 0.0),
            (FRAC_PI_2, FRAC_PI_2),
            (-FRAC_PI_2, FRAC_PI_2),
            (above, above - PI),
            (-above, PI - above),
            (PI, 0.0),
            (-PI, 0.0),
            (1.5 * PI, FRAC_PI_2),
            (-1.5 * PI, FRAC_PI_2),
            (3.0, 3.0 - PI),
            (-3.0, PI - 3.0),
        ];
        for (angle, wrapped) in cases {
            assert_eq!(wrap_axial(angle), wrapped, "{angle}");
        }
        assert!(wrap_axial(f64::NAN).is_nan() && wrap_axial(f64::INFINITY).is_nan());
    }

    #[test]
    fn a_line_has_one_angle() {
        let cases = [
            (0.0, 1.0, 0.0),
            (-0.0, 1.0, 0.0),
            (1.0, 0.0, FRAC_PI_2 / 2.0),
            (-1.0, 0.0, -FRAC_PI_2 / 2.0),
            (0.0, -1.0, FRAC_PI_2),
            (-0.0, -1.0, FRAC_PI_2),
            (-1e-300, -1.0, FRAC_PI_2),
        ];
        for (sine, cosine, angle) in cases {
            let found = half_angle(sine, cosine);
            assert!((found - angle).abs() < 1e-15, "{sine}, {cosine}: {found}");
        }
    }

    proptest! {
        #[test]
        fn wrapped_is_in_range_and_wrapping_is_idempotent(angle in prop_oneof![-20.0..20.0, -1e18..1e18]) {
            let wrapped = wrap_axial(angle);
            prop_assert!(-FRAC_PI_2 < wrapped && wrapped <= FRAC_PI_2);
            prop_assert_eq!(wrap_axial(wrapped).to_bits(), wrapped.to_bits());
        }

        #[test]
        fn it_is_the_same_line(angle in -20.0_f64..20.0) {
            let wrapped = wrap_axial(angle);
            prop_assert!((libm::cos(2.0 * wrapped) - libm::cos(2.0 * angle)).abs() < 1e-13);
            prop_assert!((libm::sin(2.0 * wrapped) - libm::sin(2.0 * angle)).abs() < 1e-13);
        }

        #[test]
        fn half_turns_change_nothing(angle in -1.5_f64..1.5, turns in -50_i32..50) {
            prop_assert!((wrap_axial(angle + f64::from(turns) * PI) - angle).abs() < 1e-13);
        }
    }
}
