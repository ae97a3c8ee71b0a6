//! The integral part of a controller, with anti-windup.

/// Returns the integral after it has grown by `growth`, within ±`bound`. All arguments are in the unit of the control.
///
/// The control is the sum of the integral and `others`, and is clamped to ±`limit` (infinite for no limit). Away from
/// zero, the integral grows only until the control reaches the limit: whatever it gathered beyond would have to be
/// unwound before the control leaves the limit. Toward zero it is free. A subnormal result becomes zero.
///
/// ```
/// use tactflow_nodes::servo::integral::integrate;
///
/// assert_eq!(integrate(0.25, 0.5, 1.0, 0.0, f64::INFINITY), 0.75);
/// assert_eq!(integrate(0.75, 0.5, 1.0, 0.0, f64::INFINITY), 1.0);
/// assert_eq!(integrate(0.25, 0.5, 1.0, 1.5, 2.0), 0.5);
/// assert_eq!(integrate(0.25, 0.5, 1.0, 3.0, 2.0), 0.25);
/// ```
#[must_use]
pub fn integrate(integral: f64, growth: f64, bound: f64, others: f64, limit: f64) -> f64 {
    let grown = if growth > 0.0 {
        (integral + growth).min((limit - others).max(integral))
    } else {
        (integral + growth).max((-limit - others).min(integral))
    };
    flush_subnormal(grown.clamp(-bound, bound))
}

/// Returns zero for a subnormal number, as arithmetic with such numbers is slow.
pub(super) fn flush_subnormal(value: f64) -> f64 {
    if value.abs() < f64::MIN_POSITIVE { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_grows_only_up_to_the_limit(
            integral in -3.0_f64..3.0, growth in -1.0_f64..1.0, others in -3.0_f64..3.0, limit in 0.1_f64..3.0,
        ) {
            let next = integrate(integral, growth, 10.0, others, limit);
            let step = next - integral;
            prop_assert!(step * growth >= 0.0 && step.abs() <= growth.abs() + 1e-15, "never against the error");
            let (before, after) = (others + integral, others + next);
            prop_assert!(after.abs() <= limit.max(before.abs()) + 1e-12, "never further out");
            let is_inwards = before * growth < 0.0 && growth.abs() <= before.abs();
            let is_free = (before + growth).abs() <= limit || is_inwards;
            prop_assert!(!is_free || (step - growth).abs() < 1e-12, "free within the limit and inwards");
        }

        #[test]
        fn without_a_limit_only_the_bound_clamps_it(
            integral in -0.5_f64..0.5, growth in -1.0_f64..1.0, others in -3.0_f64..3.0,
        ) {
            let next = integrate(integral, growth, 0.5, others, f64::INFINITY);
            prop_assert_eq!(next, (integral + growth).clamp(-0.5, 0.5));
        }
    }

    #[test]
    fn a_subnormal_integral_becomes_zero() {
        assert_eq!(
            [f64::MIN_POSITIVE, -1.0, 1e-310, -1e-310].map(flush_subnormal),
            [f64::MIN_POSITIVE, -1.0, 0.0, 0.0]
        );
        assert_eq!(integrate(1e-310, 1e-310, 1.0, 0.0, f64::INFINITY), 0.0);
    }
}
