//! The range of a numeric parameter.

/// The range of a numeric parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower end; negative infinity for none.
    pub min: f64,
    /// Upper end; infinity for none.
    pub max: f64,
    /// Whether the range excludes its lower end.
    pub is_open: bool,
}

impl Bounds {
    /// The numbers from `min` to `max`.
    #[must_use]
    pub const fn between(min: f64, max: f64) -> Self {
        Self { min, max, is_open: false }
    }

    /// The numbers greater than `min`.
    #[must_use]
    pub const fn above(min: f64) -> Self {
        Self { min, max: f64::INFINITY, is_open: true }
    }

    /// Whether no finite number is in range.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        let is_nan = self.min.is_nan() || self.max.is_nan();
        is_nan || self.min > self.max || (self.is_open && self.min == self.max)
    }

    /// Whether `number` is finite and in range.
    #[must_use]
    pub const fn contains(&self, number: f64) -> bool {
        let is_above = if self.is_open { number > self.min } else { number >= self.min };
        number.is_finite() && is_above && number <= self.max
    }

    /// Returns `what` with the range, for a message: `a number greater than 0`.
    #[must_use]
    pub fn describe(&self, what: &str) -> String {
        let Self { min, max, is_open } = *self;
        match (min.is_finite(), max.is_finite()) {
            (true, true) if what.starts_with("a whole number") && max - min == 1.0 => format!("{min} or {max}"),
            (true, true) => format!("{what} from {min} to {max}"),
            (true, false) if is_open => format!("{what} greater than {min}"),
            (true, false) => format!("{what}, {min} or more"),
            (false, true) => format!("{what}, {max} or less"),
            (false, false) => what.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_contains_its_ends_unless_it_is_open() {
        let (closed, open) = (Bounds::between(0.0, 1.0), Bounds::above(0.0));
        assert!(closed.contains(0.0) && closed.contains(1.0) && !closed.contains(1.1) && !closed.contains(-0.1));
        assert!(
            !open.contains(0.0) && open.contains(1e-9) && !open.contains(f64::INFINITY) && !open.contains(f64::NAN)
        );
        assert!(
            Bounds::between(1.0, 0.0).is_empty() && Bounds::between(0.0, f64::NAN).is_empty() && !closed.is_empty()
        );
    }

    #[test]
    fn a_range_in_words() {
        let cases = [
            (Bounds::above(0.0), "a number", "a number greater than 0"),
            (Bounds::between(0.0, f64::INFINITY), "a number", "a number, 0 or more"),
            (Bounds::between(f64::NEG_INFINITY, 2.5), "a number", "a number, 2.5 or less"),
            (Bounds::between(0.0, 1.0), "a number", "a number from 0 to 1"),
            (Bounds::between(0.0, 1.0), "a whole number", "0 or 1"),
            (Bounds::between(1.0, 1e6), "a whole number", "a whole number from 1 to 1000000"),
        ];
        for (bounds, what, expected) in cases {
            assert_eq!(bounds.describe(what), expected);
        }
    }
}
