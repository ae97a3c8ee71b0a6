//! Numbers that are written with their unit, such as `40 mm`, and their conversion to another unit.

use super::decimal::Decimal;
use super::unit_size::UnitSize;

/// A number with its unit, as text.
///
/// ```
/// use tactflow_runtime::signal::{Measure, UnitSize};
///
/// let metre = UnitSize::parse("m").unwrap();
/// assert_eq!(Measure::parse("40 mm").unwrap().to(&metre), Some(0.04));
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Measure {
    /// The text of the number.
    pub number: String,
    /// The text of the unit.
    pub unit: String,
    decimal: Decimal,
    size: UnitSize,
}

/// Why a text is not a number with a unit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum MeasureError {
    /// It does not start with a number in the form of TOML.
    NoNumber,
    /// It starts with `nan` or `inf`.
    NotFinite,
    /// It has no unit.
    NoUnit,
    /// The unit does not exist.
    UnknownUnit {
        /// The text of the number.
        number: String,
        /// The text of the unit.
        unit: String,
    },
}

impl Measure {
    /// Parses a number and its unit, with or without a space between them.
    ///
    /// # Errors
    /// If the text is not a number with a known unit.
    pub fn parse(text: &str) -> Result<Self, MeasureError> {
        let text = text.trim();
        let Some((decimal, rest)) = Decimal::parse(text) else {
            let word = text.trim_start_matches(['+', '-']).split(' ').next();
            let is_finite = !matches!(word, Some("nan" | "inf"));
            return Err(if is_finite { MeasureError::NoNumber } else { MeasureError::NotFinite });
        };
        let number = text[..text.len() - rest.len()].to_owned();
        let unit = rest.trim().to_owned();
        if unit.is_empty() {
            return Err(MeasureError::NoUnit);
        }
        match UnitSize::parse(&unit) {
            Some(size) => Ok(Self { number, unit, decimal, size }),
            None => Err(MeasureError::UnknownUnit { number, unit }),
        }
    }

    /// Returns the `f64` nearest to the exact value in a unit, or `None` if the unit measures something else. A value
    /// that is too large is infinite.
    #[must_use]
    pub fn to(&self, unit: &UnitSize) -> Option<f64> {
        let factor = self.size.factor_to(unit).filter(|_| self.size.fits(unit))?;
        Some(self.decimal.scaled(factor.times, factor.by, factor.ten, factor.pi).to_f64())
    }

    /// Returns the size of the unit.
    #[must_use]
    pub const fn size(&self) -> &UnitSize {
        &self.size
    }
}

#[cfg(test)]
mod exact;
#[cfg(test)]
mod tests;
