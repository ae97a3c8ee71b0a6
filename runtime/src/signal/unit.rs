//! Units of a wire: a closed list, known at load.

use std::fmt;
use std::str::FromStr;

/// What is counted.
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
    /// Radian of an axis without a direction: 0 and pi are the same line.
    Axial,
    /// Newton.
    Newton,
    /// Kilopascal.
    Kilopascal,
    /// What the sensor's converter counts, before any calibration.
    Raw,
    /// Number of tactels.
    Tactel,
}

const NAMES: [(Base, &str); 9] = [
    (Base::One, "1"),
    (Base::Metre, "m"),
    (Base::SquareMetre, "m2"),
    (Base::Radian, "rad"),
    (Base::Axial, "rad mod pi"),
    (Base::Newton, "N"),
    (Base::Kilopascal, "kPa"),
    (Base::Raw, "raw"),
    (Base::Tactel, "tactel"),
];

/// A unit: what is counted, per tactel or not, and how often divided by seconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Unit {
    /// What is counted.
    pub base: Base,
    /// Whether it is a mean over the tactels of a region.
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
    /// Radian of a line's direction, modulo pi.
    pub const AXIAL: Self = Self::of(Base::Axial);
    /// Newton.
    pub const NEWTON: Self = Self::of(Base::Newton);
    /// Counts of the converter.
    pub const RAW: Self = Self::of(Base::Raw);

    /// The unit of a base.
    #[must_use]
    pub const fn of(base: Base) -> Self {
        Self { base, per_tactel: false, per_second: 0 }
    }

    /// This unit per second; the rate of an axial angle is a plain rad/s.
    #[must_use]
    pub const fn per_second(self) -> Self {
        let base = if matches!(self.base, Base::Axial) { Base::Radian } else { self.base };
        Self { base, per_second: self.per_second + 1, ..self }
    }

    /// This unit per tactel.
    #[must_use]
    pub const fn per_tactel(self) -> Self {
        Self { per_tactel: true, ..self }
    }

    /// Whether 0 and pi mean the same, so that differences are wrapped into (-pi/2, pi/2].
    #[must_use]
    pub const fn is_axial(self) -> bool {
        matches!(self.base, Base::Axial) && self.per_second == 0
    }

    /// Every unit a graph file may name, for messages.
    #[must_use]
    pub fn list() -> String {
        let names: Vec<String> = NAMES.iter().map(|(_, name)| format!("`{name}`")).collect();
        format!("{}, each also `…/tactel`, `…/s`, `…/s2`", names.join(", "))
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
        let (rest, per_second) = match text.rsplit_once("/s") {
            Some((rest, "")) => (rest, 1),
            Some((rest, "2")) => (rest, 2),
            _ => (text, 0),
        };
        let (rest, per_tactel) = rest.strip_suffix("/tactel").map_or((rest, false), |rest| (rest, true));
        let base = NAMES.iter().find(|(_, name)| *name == rest).map(|(base, _)| *base);
        let base = base.ok_or_else(|| format!("`{text}` is not a unit; units are {}", Self::list()))?;
        Ok(Self { base, per_tactel, per_second })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_reads_back_as_written() {
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
    fn the_rate_of_an_axial_angle_is_not_axial() {
        assert_eq!(Unit::AXIAL.per_second().to_string(), "rad/s");
        assert!(Unit::AXIAL.is_axial() && !Unit::AXIAL.per_second().is_axial());
    }
}
