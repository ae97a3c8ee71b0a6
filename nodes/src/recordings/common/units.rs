//! Names of units as the vendors write them.

use tactflow_runtime::signal::{Base, Unit};

/// A name of a unit in lower case, and its factor to the unit of the table.
type Name = (&'static str, f64);

/// Pressures [kPa].
const PRESSURES: &[Name] = &[
    ("kpa", 1.0),
    ("kn/m2", 1.0),
    ("pa", 1e-3),
    ("n/m2", 1e-3),
    ("hpa", 0.1),
    ("mbar", 0.1),
    ("mpa", 1e3),
    ("n/mm2", 1e3),
    ("n/cm2", 10.0),
    ("bar", 100.0),
    ("atm", 101.325),
    ("psi", PSI),
    ("lb/in2", PSI),
    ("lbs/in2", PSI),
    ("lbf/in2", PSI),
    ("mmhg", TORR),
    ("torr", TORR),
    ("inhg", 25.4 * TORR),
    ("cmh2o", 0.01 * GRAVITY),
    ("kg/cm2", 10.0 * GRAVITY),
    ("kgf/cm2", 10.0 * GRAVITY),
    ("kp/cm2", 10.0 * GRAVITY),
    ("g/cm2", 0.01 * GRAVITY),
    ("gf/cm2", 0.01 * GRAVITY),
];

/// Forces [N].
const FORCES: &[Name] = &[
    ("n", 1.0),
    ("newton", 1.0),
    ("newtons", 1.0),
    ("kn", 1e3),
    ("lb", POUND),
    ("lbs", POUND),
    ("lbf", POUND),
    ("pounds", POUND),
    ("kg", GRAVITY),
    ("kgs", GRAVITY),
    ("kgf", GRAVITY),
    ("kp", GRAVITY),
    ("kilograms", GRAVITY),
    ("g", 1e-3 * GRAVITY),
    ("gf", 1e-3 * GRAVITY),
    ("grams", 1e-3 * GRAVITY),
];

const COUNTS: &[Name] = &[("raw", 1.0), ("counts", 1.0), ("digits", 1.0), ("bits", 1.0), ("adc", 1.0), ("lsb", 1.0)];

/// Lengths [m].
const LENGTHS: &[Name] = &[
    ("mm", 1e-3),
    ("millimeter", 1e-3),
    ("millimeters", 1e-3),
    ("millimetre", 1e-3),
    ("millimetres", 1e-3),
    ("cm", 1e-2),
    ("centimeter", 1e-2),
    ("centimeters", 1e-2),
    ("centimetre", 1e-2),
    ("centimetres", 1e-2),
    ("m", 1.0),
    ("meter", 1.0),
    ("meters", 1.0),
    ("metre", 1.0),
    ("metres", 1.0),
    ("in", 0.0254),
    ("inch", 0.0254),
    ("inches", 0.0254),
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

fn find(names: &[Name], name: &str) -> Option<f64> {
    names.iter().find(|(known, _)| *known == name).map(|(_, factor)| *factor)
}

/// Returns the unit that stands for a vendor's name, and the factor to it.
pub(crate) fn unit(name: &str) -> Option<(Unit, f64)> {
    let is_ignored = |c: char| c.is_whitespace() || "[]()^\"".contains(c);
    let name: String = name.to_lowercase().replace('²', "2").chars().filter(|c| !is_ignored(*c)).collect();
    let pressure = find(PRESSURES, &name).map(|factor| (Unit::of(Base::Kilopascal), factor));
    let force = || find(FORCES, &name).map(|factor| (Unit::NEWTON, factor));
    let count = || find(COUNTS, &name).map(|factor| (Unit::RAW, factor));
    pressure.or_else(force).or_else(count)
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
