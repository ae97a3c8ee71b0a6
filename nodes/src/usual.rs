//! What is usual for an arm and for a pad. A number far beyond it is probably in another unit, so nodes warn of it.

use tactflow_runtime::node::{At, Mistake};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::Code;

/// Linear speed of a sensor [m/s].
pub const USUAL_M_PER_S: f64 = 3.0;
/// Angular speed of a sensor [rad/s].
pub const USUAL_RAD_PER_S: f64 = 10.0;
/// Linear acceleration of a sensor [m/s²].
pub const USUAL_M_PER_S2: f64 = 30.0;
/// Angular acceleration of a sensor or of a joint [rad/s²].
pub const USUAL_RAD_PER_S2: f64 = 100.0;
/// Coordinate in the workspace of an arm [m].
pub const USUAL_REACH_M: f64 = 5.0;
/// Length of a path on an object, or of a holder [m].
pub const USUAL_LENGTH_M: f64 = 2.0;
/// Angle in either direction: one turn, rounded up [rad].
pub const USUAL_RAD: f64 = 6.3;
/// Lead of the equilibrium of a joint: a quarter of a turn, rounded up [rad].
pub const USUAL_LEAD_RAD: f64 = 1.6;
/// Force on a whole pad [N].
pub const USUAL_FORCE_N: f64 = 1000.0;
/// Force on one tactel [N].
pub const USUAL_PEAK_N: f64 = 100.0;
/// Mean force of the tactels of a contact [N].
pub const USUAL_PRESSURE_N: f64 = 20.0;
/// Force from which a tactel counts as touched [N].
pub const USUAL_THRESHOLD_N: f64 = 5.0;
/// Force from which a region counts as a contact [N].
pub const USUAL_CONTACT_N: f64 = 50.0;

/// Gain of a loop with which the recipe of docs/control.md begins [1/s].
pub const FIRST_GAIN: f64 = 3.5;

/// Returns a number in `unit` for one that was probably written in a smaller unit, and the name of that unit.
///
/// ```
/// use tactflow_nodes::usual::from_smaller_unit;
/// use tactflow_runtime::signal::Unit;
///
/// assert_eq!(from_smaller_unit(15.0, Unit::METRE), Some((0.015, "mm")));
/// assert_eq!(from_smaller_unit(90.0, Unit::RADIAN), Some((1.570796, "degrees")));
/// assert_eq!(from_smaller_unit(90.0, Unit::RAW), None);
/// ```
#[must_use]
pub fn from_smaller_unit(number: f64, unit: Unit) -> Option<(f64, &'static str)> {
    let rounded = |number: f64| (number * 1e6).round() / 1e6;
    match unit {
        Unit::METRE => Some((rounded(number * 1e-3), "mm")),
        Unit::RADIAN | Unit::AXIAL => Some((rounded(number.to_radians()), "degrees")),
        _ if unit == Unit::NEWTON || unit == Unit::NEWTON.per_tactel() => Some((rounded(number * 1e-3), "mN")),
        _ => None,
    }
}

/// Returns the warning about the number of a parameter, in the unit of a port, that is outside the usual range.
#[must_use]
pub fn unusual(param: &str, number: f64, [min, max]: [f64; 2], unit: Unit) -> Option<Mistake> {
    let is_usual = |number: f64| (min..=max).contains(&number);
    let rounded = |end: f64| (end * 1e4).round() / 1e4;
    let name = if unit == Unit::default() { String::new() } else { format!(" {unit}") };
    let message = format!("`{param}` is {number}{name}, but usual is {} to {}{name}", rounded(min), rounded(max));
    let within = format!("write a number from {} to {}", rounded(min), rounded(max));
    // Nobody writes a fraction of a smaller unit.
    let smaller = from_smaller_unit(number, unit).filter(|(converted, _)| number.abs() >= 1.0 && is_usual(*converted));
    let help = match smaller {
        Some((converted, other)) => format!("if {number} is in {other}, write `{converted}`; or else {within}"),
        None => within,
    };
    let warning = Mistake::new(Code::UnusualValue, At::Param(param.into()), message).help(help);
    (!is_usual(number)).then_some(warning)
}

/// Returns the warning about a parameter in the unit of an image, if that is N and the number is greater than `max`.
#[must_use]
pub fn unusual_force(param: &str, number: f64, max: f64, unit: Unit) -> Option<Mistake> {
    unusual(param, number, [0.0, max], unit).filter(|_| unit == Unit::NEWTON && number > max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_force_in_newtons_is_unusual() {
        let warning = unusual_force("threshold", 15.0, USUAL_THRESHOLD_N, Unit::NEWTON).expect("15 mN");
        assert_eq!(warning.message, "`threshold` is 15 N, but usual is 0 to 5 N");
        assert_eq!(warning.help.as_deref(), Some("if 15 is in mN, write `0.015`; or else write a number from 0 to 5"));
        for (value, unit) in [(5.0, Unit::NEWTON), (100.0, Unit::RAW)] {
            assert_eq!(unusual_force("threshold", value, USUAL_THRESHOLD_N, unit), None);
        }
    }
}
