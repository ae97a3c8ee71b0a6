//! Numbers with units: their exact values, and texts that are none.

use proptest::prelude::*;

use super::super::Unit;
use super::*;

fn converted(text: &str, unit: &str) -> Option<f64> {
    Measure::parse(text).ok()?.to(&UnitSize::parse(unit)?)
}

#[test]
fn every_value_is_the_nearest_to_the_exact_one() {
    for (text, unit, bits) in exact::EXACT {
        let is = converted(text, unit).unwrap_or_else(|| panic!("{text}"));
        assert_eq!(is.to_bits(), *bits, "{text} is {is:e} {unit}, not {:e}", f64::from_bits(*bits));
    }
}

#[test]
fn the_same_number_may_be_written_in_many_ways() {
    let cases = [
        ("40 mm", "m", 0.04),
        ("40mm", "m", 0.04),
        ("  40   mm ", "m", 0.04),
        ("1e3N", "kN", 1.0),
        ("2 m/s2", "m/s2", 2.0),
        ("2 m/s^2", "m/s2", 2.0),
        ("2 m/s²", "m/s2", 2.0),
        ("2 m / s2", "m/s2", 2.0),
        ("2 m/s/s", "m/s2", 2.0),
        ("2 m s^-2", "m/s2", 2.0),
        ("3 mN m", "N m", 0.003),
        ("3 m N", "N m", 3.0),
        ("3 N·m", "J", 3.0),
        ("20 µm", "m", 20e-6),
        ("20 μm", "m", 20e-6),
        ("20 um", "m", 20e-6),
        ("0.5 1/s", "Hz", 0.5),
        ("3 kPa", "N/m2", 3000.0),
        ("180 deg", "rad mod pi", std::f64::consts::PI),
        ("5 1", "%", 500.0),
    ];
    for (text, unit, expected) in cases {
        assert_eq!(converted(text, unit), Some(expected), "{text} in {unit}");
    }
}

#[test]
fn units_of_other_dimensions_do_not_convert() {
    let cases = [
        ("3 raw", "N"),
        ("3 N", "raw"),
        ("3 N", "kPa"),
        ("3 tactel", "1"),
        ("3 sample", "1"),
        ("3 byte", "1"),
        ("3 rad", "1"),
        ("3 rad/s", "Hz"),
        ("3 Hz", "rad/s"),
        ("3 N/tactel", "N"),
        ("3 rad mod pi", "rad"),
    ];
    for (text, unit) in cases {
        assert!(Measure::parse(text).is_ok(), "{text}");
        assert_eq!(converted(text, unit), None, "{text} in {unit}");
    }
}

#[test]
fn other_texts_are_no_numbers_with_units() {
    use MeasureError::{NoNumber, NoUnit, NotFinite};
    let none =
        ["", " ", "mm", "pad.image", ".5 mm", "5. mm", "07 mm", "1__0 mm", "_1 mm", "- 5 mm", "--5 mm", "info m"];
    let cases = none.map(|text| (text, NoNumber)).into_iter();
    let cases = cases.chain(["nan m", "inf m", "-inf m", "+nan", "inf"].map(|text| (text, NotFinite)));
    let cases = cases.chain(["40", " -1.5e3 ", "1_000"].map(|text| (text, NoUnit)));
    for (text, error) in cases {
        assert_eq!(Measure::parse(text), Err(error), "{text}");
    }
    let units =
        ["Mm", "foo", "m/", "/s", "m//s", "m4", "m^4", "12", "e m", "x10 mm", "N/m s", "m,s", "rad mod", "N mod pi"];
    for unit in units {
        let unknown = MeasureError::UnknownUnit { number: "5".into(), unit: unit.into() };
        assert_eq!(Measure::parse(&format!("5 {unit}")), Err(unknown), "{unit}");
    }
}

#[test]
fn every_declared_unit_has_a_size_and_a_whole_number_of_it_stays_as_it_is() {
    for unit in Unit::PARAM_UNITS {
        assert_eq!(converted(&format!("7 {unit}"), unit), Some(7.0), "{unit}");
    }
}

proptest! {
    #[test]
    fn no_text_panics(number in "[-+]?[0-9_.eE]{0,12}", unit in "\\PC{0,24}", unit_like in "[kmµ]?(m|s|rad|deg|N|h)[23²^/* ]{0,3}(min|h|deg)?") {
        for unit in [unit, unit_like] {
            let _ = Measure::parse(&format!("{number}{unit}")).map(|measure| measure.to(measure.size()));
        }
    }

    #[test]
    fn a_prefix_shifts_the_exponent(number in "-?[1-9][0-9]{0,20}(\\.[0-9]{1,20})?", ten in -300..300_i32) {
        for (unit, shift) in [("km", 3), ("cm", -2), ("mm", -3), ("µm", -6), ("nm", -9)] {
            let expected: f64 = format!("{number}e{}", ten + shift).parse().unwrap();
            prop_assert_eq!(converted(&format!("{number}e{ten} {unit}"), "m"), Some(expected));
        }
    }

    /// The oracle has twice the digits of an `f64`. Each angle is one.
    #[test]
    fn degrees_are_rounded_once(parts in -10_000_000..10_000_000_i32) {
        let degrees = f64::from(parts) / 1024.0;
        const PI: [f64; 2] = [std::f64::consts::PI, 1.224_646_799_147_353_2e-16];
        let radians = converted(&format!("{degrees} deg"), "rad").unwrap();
        let product = degrees * PI[0];
        let rest = degrees.mul_add(PI[0], -product) + degrees * PI[1];
        let quotient = product / 180.0;
        let more = ((-quotient).mul_add(180.0, product) + rest) / 180.0;
        let error = ((quotient - radians) + more).abs();
        let spacing = f64::from_bits(radians.abs().to_bits() + 1) - radians.abs();
        prop_assert!(error <= 0.5 * spacing * (1.0 + 1e-9), "{degrees} deg is not {radians} rad");
    }
}
