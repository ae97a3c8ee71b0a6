//! Angles of lines: 0 and pi are the same line.

use std::f64::consts::{FRAC_PI_2, PI};

/// The angle of the same line in (-pi/2, pi/2], as the paper takes the angular error (section IV, below eq. 3).
///
/// Exact: the remainder and both shifts are free of rounding, so wrapping once more changes no bit, and an angle that
/// is in range passes as it is.
///
/// ```
/// use std::f64::consts::{FRAC_PI_2, PI};
/// use tactflow_nodes::servo::axial::wrap_axial;
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
