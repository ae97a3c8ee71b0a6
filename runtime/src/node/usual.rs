//! The usual range of a parameter: a number outside of it is accepted with a warning.

use std::ops::Range;

use super::bounds::Bounds;
use super::mistake::{At, Mistake};
use super::param_spec::Declared;
use crate::source::Code;

/// What is usual for the numbers of a parameter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Usual {
    name: &'static str,
    unit: &'static str,
    range: Option<Bounds>,
    /// Nominal time between two samples that the node reads [s]; 0 if it is unknown.
    pub(super) period: f64,
}

impl Usual {
    /// Nothing is unusual.
    pub(super) const NONE: Self = Self { name: "", unit: "", range: None, period: 0.0 };

    /// Returns what is usual for a parameter.
    pub(super) fn of(self, declared: &Declared) -> Self {
        Self { name: declared.name, unit: declared.unit.unwrap_or(""), range: declared.usual, period: self.period }
    }

    /// Returns the warning about a number that is not usual.
    pub(super) fn find_warning(&self, number: f64, span: Range<usize>) -> Option<Mistake> {
        let Self { name, unit, range, period } = *self;
        let unit_s = [("ms", 1e-3), ("s", 1.0)].iter().find(|(time, _)| *time == unit).map(|(_, seconds)| *seconds);
        if let Some(shortest) = unit_s.and_then(|unit_s| shortest(number, period / unit_s)) {
            let message = format!("`{name}` is {number} {unit}, but a new sample comes every {shortest} {unit}");
            let help = format!("write `{name} = {shortest}` or more");
            return Some(Mistake::new(Code::ShortTime, At::Span(span), message).help(help));
        }
        let range = range.filter(|range| number.is_finite() && !range.contains(number))?;
        let unit = unit.replace('2', "²");
        let message = format!("`{name}` is {}, but usual is {}", with_unit(number, &unit), in_words(&range, &unit));
        let help = match converted(number, &unit).filter(|(number, _)| range.contains(*number)) {
            Some((converted, other)) => {
                format!("if {number} is in {other}, write `{converted}`")
            }
            None => format!("write a number that is {}", in_words(&range, &unit)),
        };
        Some(Mistake::new(Code::UnusualValue, At::Span(span), message).help(help))
    }
}

/// Returns the period, rounded for a message, if a time is shorter. Both are in the same unit.
///
/// A time of 0 means that nothing waits. The period of a device is rounded to nanoseconds.
pub(crate) fn shortest(time: f64, period: f64) -> Option<f64> {
    (time > 0.0 && time < period * (1.0 - 1e-6)).then(|| (period * 1e3).round() / 1e3)
}

/// Returns a number with its unit; that of a ratio is none.
fn with_unit(number: f64, unit: &str) -> String {
    if matches!(unit, "" | "1") { number.to_string() } else { format!("{number} {unit}") }
}

/// Returns the range in words: `at most 3 m/s`.
fn in_words(&Bounds { min, max, .. }: &Bounds, unit: &str) -> String {
    match (min.is_finite(), max.is_finite()) {
        (true, true) => format!("{min} to {}", with_unit(max, unit)),
        (true, false) => format!("at least {}", with_unit(min, unit)),
        _ => format!("at most {}", with_unit(max, unit)),
    }
}

/// Converts a number that was probably written in another unit, and returns it with that unit.
fn converted(number: f64, unit: &str) -> Option<(f64, String)> {
    let (factor, from, to) = match unit.split('/').next()? {
        "m" => (1e3, "m", "mm"),
        "rad" => (180.0 / std::f64::consts::PI, "rad", "deg"),
        "N" => (1e3, "N", "mN"),
        _ => return None,
    };
    let rounded = (number / factor * 1e6).round() / 1e6;
    Some((rounded, unit.replacen(from, to, 1)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usual(unit: &'static str, range: Option<Bounds>) -> Usual {
        Usual::NONE.of(&Declared { unit: Some(unit), usual: range, ..Declared::new("x") })
    }

    #[test]
    fn an_unusual_number_is_named_with_its_unit_and_converted() {
        let (to, between) = (|max| Some(Bounds::between(f64::NEG_INFINITY, max)), Some(Bounds::between(-10.0, 10.0)));
        let cases = [
            ("m/s", to(3.0), 50.0, "`x` is 50 m/s, but usual is at most 3 m/s", "if 50 is in mm/s, write `0.05`"),
            (
                "rad/s2",
                to(100.0),
                570.0,
                "`x` is 570 rad/s², but usual is at most 100 rad/s²",
                "if 570 is in deg/s², write `9.948377`",
            ),
            ("N", to(1000.0), 15000.0, "`x` is 15000 N, but usual is at most 1000 N", "if 15000 is in mN, write `15`"),
            ("m", between, -800.0, "`x` is -800 m, but usual is -10 to 10 m", "if -800 is in mm, write `-0.8`"),
            ("1", to(0.95), 1.0, "`x` is 1, but usual is at most 0.95", "write a number that is at most 0.95"),
            ("K", between, 11.0, "`x` is 11 K, but usual is -10 to 10 K", "write a number that is -10 to 10 K"),
        ];
        for (unit, range, number, message, help) in cases {
            let warning = usual(unit, range).find_warning(number, 0..1).unwrap();
            assert_eq!((warning.message.as_str(), warning.help.as_deref()), (message, Some(help)));
            assert_eq!(warning.code, Code::UnusualValue);
        }
        for number in [-10.0, 0.0, 10.0] {
            assert_eq!(usual("m", between).find_warning(number, 0..1), None);
        }
    }

    #[test]
    fn a_time_is_at_least_a_period() {
        let at_250_hz = |unit| Usual { period: 0.004, ..usual(unit, None) };
        let cases = [
            ("ms", 3.9, true),
            ("ms", 4.0, false),
            ("ms", 0.0, false),
            ("s", 0.003, true),
            ("s", 0.1, false),
            ("N", 1.0, false),
        ];
        for (unit, time, is_short) in cases {
            assert_eq!(at_250_hz(unit).find_warning(time, 0..1).is_some(), is_short, "{time} {unit}");
        }
        assert_eq!(usual("ms", None).find_warning(0.1, 0..1), None, "the period is unknown");
    }
}
