//! Numbers with few digits, for messages and for values that a file gets.

/// Returns a number with three digits.
pub(crate) fn to_three_digits(number: f64) -> f64 {
    format!("{number:.2e}").parse().unwrap_or(number)
}

/// Returns a number with two digits, rounded by `round`; 0 and what is not finite stay.
pub(crate) fn to_two_digits(number: f64, round: impl Fn(f64) -> f64) -> f64 {
    if number == 0.0 || !number.is_finite() {
        return number;
    }
    let digits = 1.0 - libm::floor(libm::log10(number.abs()));
    let scale = libm::pow(10.0, digits);
    let exact = round(number * scale) / scale;
    // To the nearest number with two digits, because the division may leave more.
    format!("{exact:.1e}").parse().unwrap_or(exact)
}

/// Returns a number with two digits that is not larger; 0 for a number that is not positive.
pub(crate) fn down_to_two_digits(number: f64) -> f64 {
    if number <= 0.0 {
        return 0.0;
    }
    to_two_digits(number, libm::floor)
}

/// Returns a value with its unit and so many digits behind the point, or `none`.
pub(crate) fn or_none(value: Option<f64>, unit: &str, digits: usize) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:.digits$} {unit}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_keeps_three_digits_and_a_gain_never_grows() {
        assert_eq!([12.3456, -0.012345, 0.0, 1234.5].map(to_three_digits), [12.3, -0.0123, 0.0, 1230.0]);
        assert_eq!([12.99, 0.0199, 3.5, 0.0].map(down_to_two_digits), [12.0, 0.019, 3.5, 0.0]);
    }

    #[test]
    fn a_small_number_keeps_two_digits_and_its_direction() {
        for number in [3.1e-5, 9.9e-5, 4.5e-4, 0.0123, 0.37, 5.6, 1234.5] {
            let (down, up) = (down_to_two_digits(number), to_two_digits(number, libm::ceil));
            assert!(0.9 * number < down && down <= number, "{down} is not {number}, rounded down");
            assert!(number <= up && up < 1.1 * number, "{up} is not {number}, rounded up");
        }
        assert_eq!([3.15e-5, 1234.5].map(down_to_two_digits), [3.1e-5, 1200.0]);
    }
}
