//! Names of units as the vendors write them.

use tactflow_runtime::signal::{Base, Unit};

use super::refusal::TextError;
use super::text::{Piece, shortened};

/// Names of a unit in lower case, and its factor to the unit of the table.
type Names = (f64, &'static [&'static str]);

/// Pressures [kPa].
const PRESSURES: &[Names] = &[
    (1.0, &["kpa", "kn/m2"]),
    (1e-3, &["pa", "n/m2"]),
    (0.1, &["hpa", "mbar"]),
    (1e3, &["mpa", "n/mm2"]),
    (10.0, &["n/cm2"]),
    (100.0, &["bar"]),
    (101.325, &["atm"]),
    (PSI, &["psi", "lb/in2", "lbs/in2", "lbf/in2"]),
    (TORR, &["mmhg", "torr"]),
    (25.4 * TORR, &["inhg"]),
    (0.01 * GRAVITY, &["cmh2o", "g/cm2", "gf/cm2"]),
    (10.0 * GRAVITY, &["kg/cm2", "kgf/cm2", "kp/cm2"]),
];

/// Forces [N].
const FORCES: &[Names] = &[
    (1.0, &["n", "newton", "newtons"]),
    (1e3, &["kn"]),
    (POUND, &["lb", "lbs", "lbf", "pounds"]),
    (GRAVITY, &["kg", "kgs", "kgf", "kp", "kilograms"]),
    (1e-3 * GRAVITY, &["g", "gf", "grams"]),
];

const COUNTS: &[Names] = &[(1.0, &["raw", "counts", "digits", "bits", "adc", "lsb"])];

/// Lengths [m].
const LENGTHS: &[Names] = &[
    (1e-3, &["mm", "millimeter", "millimeters", "millimetre", "millimetres"]),
    (1e-2, &["cm", "centimeter", "centimeters", "centimetre", "centimetres"]),
    (1.0, &["m", "meter", "meters", "metre", "metres"]),
    (0.0254, &["in", "inch", "inches"]),
];

/// Standard gravity [m/s²], which is also the weight of a kilogram [N].
const GRAVITY: f64 = 9.80665;
/// Weight of a pound [N].
const POUND: f64 = 4.448_221_615_260_5;
/// A pound per square inch [kPa].
const PSI: f64 = POUND / (25.4 * 25.4) * 1e3;
/// A millimetre of mercury [kPa].
const TORR: f64 = 101.325 / 760.0;

/// Units that a message lists.
pub(crate) const KNOWN: &str = "`raw`, pressures (`kPa`, `N/cm2`, `PSI`, `mmHg`, …) and forces (`N`, `lbs`, `kg`, …)";

fn find(table: &[Names], name: &str) -> Option<f64> {
    table.iter().find(|(_, names)| names.contains(&name)).map(|(factor, _)| *factor)
}

/// Returns the unit that stands for a vendor's name, and the factor to it.
pub(crate) fn unit(name: &str) -> Option<(Unit, f64)> {
    let is_ignored = |c: char| c.is_whitespace() || "[]()^\"".contains(c);
    let name: String = name.to_lowercase().replace('²', "2").chars().filter(|c| !is_ignored(*c)).collect();
    let tables = [(PRESSURES, Unit::of(Base::Kilopascal)), (FORCES, Unit::NEWTON), (COUNTS, Unit::RAW)];
    tables.into_iter().find_map(|(table, unit)| Some((unit, find(table, &name)?)))
}

/// Parses a vendor's name of a unit.
pub(crate) fn parse(name: Piece<'_>) -> Result<(Unit, f64), TextError> {
    unit(name.text).ok_or_else(|| name.error(format!("the unit `{}` is unknown", shortened(name.text))))
}

/// Returns the factor from a unit of length to metres.
pub(crate) fn metres(name: &str) -> Option<f64> {
    find(LENGTHS, &name.trim().to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_has_its_physical_value() {
        // Each value is calculated in another way than the table.
        let cases = [
            ("PSI", "kPa", 6.894_757),
            ("mmHg", "kPa", 0.133_322_4),
            ("N/cm²", "kPa", 10.0),
            ("kg/cm^2", "kPa", 98.0665),
            ("g/cm2", "kPa", 0.098_066_5),
            ("MPa", "kPa", 1000.0),
            ("[hPa]", "kPa", 0.1),
            ("lbs", "N", 4.448_222),
            ("g", "N", 0.009_806_65),
            ("Newtons", "N", 1.0),
            ("Raw", "raw", 1.0),
        ];
        for (name, ours, factor) in cases {
            let (unit, found) = super::unit(name).expect(name);
            assert_eq!(unit.to_string(), ours, "{name}");
            assert!((found - factor).abs() <= 1e-6 * factor, "{name}: {found}");
        }
        assert_eq!(super::unit("furlong"), None);
        assert_eq!((metres("Inches"), metres(" mm "), metres("feet")), (Some(0.0254), Some(0.001), None));
    }
}
