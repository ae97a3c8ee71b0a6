//! The size of a unit: what it measures, and its exact factor to the base units.

use super::Unit;

/// Powers of the base units: kilogram, metre, second, radian, raw, tactel, sample and byte.
type Powers = [i8; 8];

/// A factor `times / by * 10^ten * pi^pi`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Factor {
    pub(super) times: u64,
    pub(super) by: u64,
    pub(super) ten: i32,
    pub(super) pi: i32,
}

const ONE: Factor = Factor { times: 1, by: 1, ten: 0, pi: 0 };
const MINUTE: Factor = Factor { times: 60, ..ONE };
const HOUR: Factor = Factor { times: 3600, ..ONE };
const DEGREE: Factor = Factor { by: 180, pi: 1, ..ONE };

const fn ten_to(ten: i32) -> Factor {
    Factor { ten, ..ONE }
}

/// The symbols of units, each with the prefixes that it may have. `Mm` is not among them: it would be a misspelt `mm`.
const SYMBOLS: [(&str, &str, Powers, Factor); 18] = [
    ("1", "", [0; 8], ONE),
    ("%", "", [0; 8], ten_to(-2)),
    ("g", "kmµ", [1, 0, 0, 0, 0, 0, 0, 0], ten_to(-3)),
    ("m", "kcmµn", [0, 1, 0, 0, 0, 0, 0, 0], ONE),
    ("s", "mµn", [0, 0, 1, 0, 0, 0, 0, 0], ONE),
    ("min", "", [0, 0, 1, 0, 0, 0, 0, 0], MINUTE),
    ("h", "", [0, 0, 1, 0, 0, 0, 0, 0], HOUR),
    ("Hz", "kM", [0, 0, -1, 0, 0, 0, 0, 0], ONE),
    ("rad", "mµ", [0, 0, 0, 1, 0, 0, 0, 0], ONE),
    ("deg", "", [0, 0, 0, 1, 0, 0, 0, 0], DEGREE),
    ("N", "kmµ", [1, 1, -2, 0, 0, 0, 0, 0], ONE),
    ("J", "kmµ", [1, 2, -2, 0, 0, 0, 0, 0], ONE),
    ("Pa", "Mkh", [1, -1, -2, 0, 0, 0, 0, 0], ONE),
    ("bar", "m", [1, -1, -2, 0, 0, 0, 0, 0], ten_to(5)),
    ("raw", "", [0, 0, 0, 0, 1, 0, 0, 0], ONE),
    ("tactel", "", [0, 0, 0, 0, 0, 1, 0, 0], ONE),
    ("sample", "", [0, 0, 0, 0, 0, 0, 1, 0], ONE),
    ("byte", "", [0, 0, 0, 0, 0, 0, 0, 1], ONE),
];

/// The prefixes, with other ways to write them.
const PREFIXES: [(&str, char, i32); 9] = [
    ("M", 'M', 6),
    ("k", 'k', 3),
    ("h", 'h', 2),
    ("c", 'c', -2),
    ("m", 'm', -3),
    ("µ", 'µ', -6),
    ("μ", 'µ', -6),
    ("u", 'µ', -6),
    ("n", 'n', -9),
];

/// What units measure, each with the usual units, for messages.
const DIMENSIONS: [(&str, &[&str]); 20] = [
    ("a pure number", &["1", "%"]),
    ("a length", &["m", "cm", "mm", "µm"]),
    ("an area", &["m2", "cm2", "mm2"]),
    ("a speed", &["m/s", "cm/s", "mm/s"]),
    ("an acceleration", &["m/s2", "mm/s2"]),
    ("an angle", &["rad", "deg", "mrad"]),
    ("an angular speed", &["rad/s", "deg/s"]),
    ("an angular acceleration", &["rad/s2", "deg/s2"]),
    ("a time", &["s", "ms", "µs", "ns", "min", "h"]),
    ("a frequency", &["Hz", "kHz", "MHz", "1/s"]),
    ("a force", &["N", "kN", "mN", "µN"]),
    ("a torque", &["N m", "mN m", "N mm", "J"]),
    ("a stiffness", &["N/m", "N/mm"]),
    ("a pressure", &["kPa", "Pa", "hPa", "MPa", "bar", "mbar"]),
    ("a mass", &["kg", "g", "mg"]),
    ("a force per tactel", &["N/tactel", "mN/tactel"]),
    ("a raw reading", &["raw"]),
    ("a number of tactels", &["tactel"]),
    ("a number of samples", &["sample"]),
    ("a number of bytes", &["byte"]),
];

/// What a unit measures, and how large it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnitSize {
    powers: Powers,
    pub(super) factor: Factor,
    /// Whether it is the direction of a line, modulo pi.
    is_axial: bool,
}

impl UnitSize {
    const ONE: Self = Self { powers: [0; 8], factor: ONE, is_axial: false };

    /// Parses a unit such as `mm`, `N s/m`, `m/s2`, `m/s^2` or `m/s²`.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        Self::parse_with(text, &|_| None)
    }

    /// Parses a unit in which letters may stand for units.
    pub(crate) fn parse_with(text: &str, letter: &dyn Fn(&str) -> Option<Unit>) -> Option<Self> {
        let text = text.trim();
        if let Some(angle) = text.strip_suffix(" mod pi") {
            let size = Self::parse_with(angle, letter)?;
            return size.measures_the_same_as(&Self::of(Unit::RADIAN)).then_some(Self { is_axial: true, ..size });
        }
        if let Some(unit) = letter(text) {
            return Some(Self::of(unit));
        }
        let mut parts = text.split('/');
        let product = parts.next()?.split([' ', '*', '·']).filter(|factor| !factor.is_empty());
        let mut size = None;
        for factor in product {
            size = Some(size.unwrap_or(Self::ONE).times(factor, 1, letter)?);
        }
        parts.try_fold(size?, |size, factor| size.times(factor.trim(), -1, letter))
    }

    /// Returns the size of the unit of a wire.
    pub(crate) fn of(unit: Unit) -> Self {
        Self::parse(&unit.to_string()).unwrap_or(Self::ONE)
    }

    /// Whether a number in this unit has a value in another. A direction modulo pi is not an angle, but an angle is a
    /// direction.
    #[must_use]
    pub fn fits(&self, other: &Self) -> bool {
        self.measures_the_same_as(other) && (other.is_axial || !self.is_axial)
    }

    /// Returns what the unit measures, `a length`, if that has a name.
    #[must_use]
    pub fn dimension(&self) -> Option<&'static str> {
        self.entry().map(|(name, _)| *name)
    }

    /// Returns the usual units of what the unit measures.
    pub fn usual_units(&self) -> impl Iterator<Item = &'static str> + Clone {
        self.entry().into_iter().flat_map(|(_, units)| units.iter().copied())
    }

    /// Returns the usual units of everything that has a name.
    pub(crate) fn all_usual_units() -> Vec<&'static str> {
        DIMENSIONS.iter().flat_map(|(_, units)| units.iter().copied()).collect()
    }

    fn entry(&self) -> Option<&'static (&'static str, &'static [&'static str])> {
        DIMENSIONS.iter().find(|(_, units)| Self::parse(units[0]).is_some_and(|size| size.measures_the_same_as(self)))
    }

    fn measures_the_same_as(&self, other: &Self) -> bool {
        self.powers == other.powers
    }

    /// Multiplies by a factor such as `mm` or `s2`, or divides by it if `sign` is negative.
    fn times(self, factor: &str, sign: i8, letter: &dyn Fn(&str) -> Option<Unit>) -> Option<Self> {
        let (symbol, power) = split_power(factor)?;
        let size = match letter(symbol) {
            Some(unit) => Self::of(unit),
            None => find_symbol(symbol)?,
        };
        (0..power.unsigned_abs()).try_fold(self, |product, _| product.once(&size, sign * power.signum()))
    }

    fn once(mut self, other: &Self, sign: i8) -> Option<Self> {
        for (power, more) in self.powers.iter_mut().zip(other.powers) {
            *power = power.checked_add(sign * more)?;
        }
        let (times, by) = match sign {
            1 => (other.factor.times, other.factor.by),
            _ => (other.factor.by, other.factor.times),
        };
        let factor = Factor {
            times: self.factor.times.checked_mul(times)?,
            by: self.factor.by.checked_mul(by)?,
            ten: self.factor.ten + i32::from(sign) * other.factor.ten,
            pi: self.factor.pi + i32::from(sign) * other.factor.pi,
        };
        Some(Self { factor, is_axial: false, ..self })
    }

    /// Returns the factor from this unit to another.
    pub(super) fn factor_to(&self, other: &Self) -> Option<Factor> {
        let inverse = Self { powers: [0; 8], ..*self }.once(&Self { powers: [0; 8], ..*other }, -1)?;
        Some(inverse.factor)
    }
}

/// Splits `s2`, `s^2` or `s²` into a symbol and its power.
fn split_power(factor: &str) -> Option<(&str, i8)> {
    const POWERS: [(&str, i8); 9] =
        [("^-1", -1), ("^-2", -2), ("^-3", -3), ("^2", 2), ("^3", 3), ("²", 2), ("³", 3), ("2", 2), ("3", 3)];
    let found = POWERS.iter().find_map(|(text, power)| Some((factor.strip_suffix(text)?, *power)));
    let (symbol, power) = found.unwrap_or((factor, 1));
    let has_power = symbol.chars().all(|c| c.is_alphabetic() || c == '_');
    (power == 1 || has_power).then_some((symbol, power))
}

/// Returns the size of a symbol, with or without a prefix.
fn find_symbol(text: &str) -> Option<UnitSize> {
    let find = |name: &str| SYMBOLS.iter().find(|(symbol, ..)| *symbol == name);
    let (powers, factor) = match find(text) {
        Some((_, _, powers, factor)) => (*powers, *factor),
        None => PREFIXES.iter().find_map(|(written, prefix, ten)| {
            let (_, prefixes, powers, factor) = find(text.strip_prefix(written)?)?;
            let factor = Factor { ten: factor.ten + ten, ..*factor };
            prefixes.contains(*prefix).then_some((*powers, factor))
        })?,
    };
    Some(UnitSize { powers, factor, is_axial: false })
}
