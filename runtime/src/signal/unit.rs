//! Units of wires, a closed list. Every unit is known at load.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::source::quoted;

/// The base of a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Base {
    /// A pure number.
    #[default]
    One,
    /// Metre.
    Metre,
    /// Square metre.
    SquareMetre,
    /// Radian.
    Radian,
    /// Radian of an undirected line: 0 and pi are the same line.
    Axial,
    /// Newton.
    Newton,
    /// Newton metre, of a torque.
    NewtonMetre,
    /// Kilopascal.
    Kilopascal,
    /// Counts of the sensor's converter, before any calibration.
    Raw,
    /// Number of tactels.
    Tactel,
}

const NAMES: [(Base, &str); 10] = [
    (Base::One, "1"),
    (Base::Metre, "m"),
    (Base::SquareMetre, "m2"),
    (Base::Radian, "rad"),
    (Base::Axial, "rad mod pi"),
    (Base::Newton, "N"),
    (Base::NewtonMetre, "N m"),
    (Base::Kilopascal, "kPa"),
    (Base::Raw, "raw"),
    (Base::Tactel, "tactel"),
];

/// A unit: a base, optionally per tactel and per a power of seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
#[must_use]
pub struct Unit {
    /// The base.
    pub base: Base,
    /// Whether the value is a mean over the tactels of a region.
    pub per_tactel: bool,
    /// Power of `1/s`.
    pub per_second: u8,
}

impl Unit {
    /// A pure number.
    pub const ONE: Self = Self::of(Base::One);
    /// Metre.
    pub const METRE: Self = Self::of(Base::Metre);
    /// Square metre.
    pub const SQUARE_METRE: Self = Self::of(Base::SquareMetre);
    /// Radian.
    pub const RADIAN: Self = Self::of(Base::Radian);
    /// Direction of a line in radians, modulo pi.
    pub const AXIAL: Self = Self::of(Base::Axial);
    /// Newton.
    pub const NEWTON: Self = Self::of(Base::Newton);
    /// Newton metre, of a torque.
    pub const NEWTON_METRE: Self = Self::of(Base::NewtonMetre);
    /// Counts of the converter.
    pub const RAW: Self = Self::of(Base::Raw);

    /// Creates a plain unit of a base.
    pub const fn of(base: Base) -> Self {
        Self { base, per_tactel: false, per_second: 0 }
    }

    /// Returns this unit per second. The rate of an axial angle is in rad/s.
    pub const fn per_second(self) -> Self {
        let base = if matches!(self.base, Base::Axial) { Base::Radian } else { self.base };
        Self { base, per_second: self.per_second + 1, ..self }
    }

    /// Returns this unit per tactel.
    pub const fn per_tactel(self) -> Self {
        Self { per_tactel: true, ..self }
    }

    /// Whether the unit is an axial angle. Then 0 and pi are equal, and differences are wrapped into (-pi/2, pi/2].
    #[must_use]
    pub const fn is_axial(self) -> bool {
        matches!(self.base, Base::Axial) && self.per_second == 0
    }

    /// Lists every unit that a graph file may name, for messages.
    #[must_use]
    pub fn list() -> String {
        format!("{}, each also `…/tactel`, `…/s`, `…/s2`", quoted(NAMES.iter().map(|(_, name)| name)))
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = NAMES.iter().find(|(base, _)| *base == self.base).map_or("?", |(_, name)| name);
        f.write_str(name)?;
        if self.per_tactel {
            f.write_str("/tactel")?;
        }
        match self.per_second {
            0 => Ok(()),
            1 => f.write_str("/s"),
            n => write!(f, "/s{n}"),
        }
    }
}

impl FromStr for Unit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::parse(text.as_bytes()).ok_or_else(|| format!("`{text}` is not a unit; units are {}", Self::list()))
    }
}

impl TryFrom<String> for Unit {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Unit> for String {
    fn from(unit: Unit) -> Self {
        unit.to_string()
    }
}

/// Checks of the units in declarations. They are `const`, so that the derives reject a wrong unit at compile time.
impl Unit {
    const fn parse(text: &[u8]) -> Option<Self> {
        let (rest, per_second) = match text {
            [rest @ .., b'/', b's'] => (rest, 1),
            [rest @ .., b'/', b's', b'2'] => (rest, 2),
            _ => (text, 0),
        };
        let (rest, per_tactel) = match rest {
            [rest @ .., b'/', b't', b'a', b'c', b't', b'e', b'l'] => (rest, true),
            _ => (rest, false),
        };
        let mut i = 0;
        while i < NAMES.len() {
            if is_same(NAMES[i].1.as_bytes(), rest) {
                return Some(Self { base: NAMES[i].0, per_tactel, per_second });
            }
            i += 1;
        }
        None
    }

    /// Whether a port may declare the unit: a unit, `_`, `_/s`, or a capital letter, alone or divided.
    #[must_use]
    pub const fn is_port_unit(text: &str) -> bool {
        let is_variable = match text.as_bytes() {
            b"_" | b"_/s" => true,
            [b'A'..=b'Z', rest @ ..] => matches!(rest, b"" | b"/tactel" | b"/s" | b"/tactel/s"),
            _ => false,
        };
        is_variable || Self::parse(text.as_bytes()).is_some()
    }

    /// Whether a parameter may declare the unit: products and quotients of [`PARAM_UNITS`](Self::PARAM_UNITS) and
    /// capital letters, such as `N s/m` or `U/s2`, a list such as `m/s, rad/s`, or `$` with the name of a parameter.
    /// `_` is the unit of the component that an entry of a table is for.
    #[must_use]
    pub const fn is_param_unit(text: &str) -> bool {
        matches!(text.as_bytes(), [b'$', b'a'..=b'z', ..]) || are_factors(text.as_bytes())
    }

    /// The factors in the unit of a parameter, besides the capital letters that inputs bind.
    pub const PARAM_UNITS: [&str; 18] = [
        "1", "m", "mm", "rad", "deg", "s", "ms", "ns", "Hz", "N", "kPa", "kg", "J", "raw", "tactel", "sample", "byte",
        "%",
    ];
}

/// Whether a text consists of units of parameters with `/`, a space, or a comma and a space between them.
const fn are_factors(text: &[u8]) -> bool {
    let mut end = 0;
    while end < text.len() && !matches!(text[end], b'/' | b' ' | b',') {
        end += 1;
    }
    let (first, rest) = text.split_at(end);
    is_factor(first)
        && match rest {
            [] => true,
            [b',', b' ', rest @ ..] | [b'/' | b' ', rest @ ..] => are_factors(rest),
            _ => false,
        }
}

/// Whether a text is a unit of a parameter or a letter, to the power of one, two or three.
const fn is_factor(text: &[u8]) -> bool {
    let text = match text {
        [base @ .., b'2' | b'3'] if !base.is_empty() => base,
        _ => text,
    };
    let mut i = 0;
    while i < Unit::PARAM_UNITS.len() {
        if is_same(Unit::PARAM_UNITS[i].as_bytes(), text) {
            return true;
        }
        i += 1;
    }
    matches!(text, [b'A'..=b'Z' | b'_'])
}

/// Whether two texts are equal.
pub(super) const fn is_same(a: &[u8], b: &[u8]) -> bool {
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    i == a.len() && i == b.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_parses_to_itself() {
        for (base, _) in NAMES {
            for per_tactel in [false, true] {
                for per_second in 0..3 {
                    let unit = Unit { base, per_tactel, per_second };
                    assert_eq!(unit.to_string().parse(), Ok(unit), "{unit}");
                }
            }
        }
        assert!("Nm".parse::<Unit>().is_err());
    }

    #[test]
    fn declarations_accept_only_known_units() {
        for text in ["N", "m/s", "_", "_/s", "U", "U/tactel", "E/s", "rad mod pi"] {
            assert!(Unit::is_port_unit(text), "{text}");
        }
        for text in ["", "UV", "U/m", "_/s2", "newton", "m/s3", "u"] {
            assert!(!Unit::is_port_unit(text), "{text}");
        }
        for text in ["1", "m/s2", "N s/m", "m/s, rad/s", "U/s", "V/U", "kg m2", "$unit", "%", "_", "m/_, rad/_"] {
            assert!(Unit::is_param_unit(text), "{text}");
        }
        for text in ["", "newton", "m/", "/s", "m,rad", "m,, rad", "$", "m//s", "2", "m/s²"] {
            assert!(!Unit::is_param_unit(text), "{text}");
        }
    }

    #[test]
    fn the_rate_of_an_axial_angle_is_not_axial() {
        assert_eq!(Unit::AXIAL.per_second().to_string(), "rad/s");
        assert!(Unit::AXIAL.is_axial() && !Unit::AXIAL.per_second().is_axial());
    }
}
