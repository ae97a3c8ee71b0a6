//! Units of one node: what its inputs accept, and what follows for its outputs.

use std::collections::BTreeMap;

use crate::node::{PortSpec, UnitPattern, unit_pattern};
use crate::signal::{Shape, Unit};

/// An input received another unit than it accepts.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct UnitMismatch {
    /// The received unit, for example ``is in `m` ``.
    pub(crate) has: String,
    /// The accepted unit, for example `` `N` ``.
    pub(crate) takes: String,
}

/// The unit variables of one node: the unit, and the port that determined it.
#[derive(Debug, Default)]
pub(crate) struct Units {
    known: BTreeMap<char, (Unit, String)>,
}

impl Units {
    /// Binds the unit variable of an input, or returns the mismatch. `name` is the full name of the input.
    pub(crate) fn take(&mut self, port: &PortSpec, name: &str, shape: &Shape) -> Result<(), UnitMismatch> {
        if let Shape::Features(features) = shape {
            let not_rate = features.features.iter().find(|feature| feature.unit.per_second == 0);
            return match (unit_pattern(port), not_rate) {
                (Some(UnitPattern::AnyRate | UnitPattern::Variable { per_second: true, .. }), Some(feature)) => {
                    let has = format!("has `{}` in `{}`", feature.name, feature.unit);
                    Err(UnitMismatch { has, takes: "features per second".into() })
                }
                _ => Ok(()),
            };
        }
        let Some(unit) = shape.unit() else { return Ok(()) };
        let takes = match unit_pattern(port) {
            None | Some(UnitPattern::Any) => return Ok(()),
            Some(UnitPattern::AnyRate) if unit.per_second > 0 => return Ok(()),
            Some(UnitPattern::AnyRate) => "a unit per second".into(),
            Some(UnitPattern::Known(takes)) if takes == unit => return Ok(()),
            Some(UnitPattern::Known(takes)) => format!("`{takes}`"),
            Some(UnitPattern::Variable { name: letter, .. }) => {
                let (takes, by) = self.known.entry(letter).or_insert_with(|| (unit, format!("`{name}`")));
                if *takes == unit {
                    return Ok(());
                }
                format!("`{takes}`, the unit of {by}")
            }
        };
        Err(UnitMismatch { has: format!("is in `{unit}`"), takes })
    }

    /// Sets the unit of an output from its declaration. `name` is the full name of the output.
    ///
    /// A variable that no input has bound takes the unit that the node chose, so a delayed input must agree with it.
    pub(crate) fn give(&mut self, port: &PortSpec, name: &str, shape: &mut Shape) {
        match unit_pattern(port) {
            Some(UnitPattern::Known(unit)) => shape.set_unit(unit),
            Some(UnitPattern::Variable { name: letter, per_tactel, per_second }) => {
                if let Some((unit, _)) = self.known.get(&letter) {
                    let unit = if per_tactel { unit.per_tactel() } else { *unit };
                    shape.set_unit(if per_second { unit.per_second() } else { unit });
                } else if let Some(unit) = shape.unit().filter(|_| !per_tactel && !per_second) {
                    self.known.insert(letter, (unit, format!("the output `{name}`")));
                }
            }
            None | Some(UnitPattern::Any | UnitPattern::AnyRate) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{Kind, ScalarShape};

    fn port(unit: &'static str) -> PortSpec {
        PortSpec::new("x", "", Kind::Scalar, &[unit])
    }

    fn scalar(unit: &str) -> Shape {
        ScalarShape::of(unit.parse().unwrap()).into()
    }

    #[test]
    fn inputs_bind_variables_and_outputs_follow() {
        let cases =
            [("N", "N", true), ("N", "m", false), ("_", "kPa", true), ("_/s", "m/s", true), ("_/s", "m", false)];
        for (takes, has, fits) in cases {
            assert_eq!(Units::default().take(&port(takes), "n.x", &scalar(has)).is_ok(), fits, "{takes} {has}");
        }
        let mut units = Units::default();
        units.take(&port("U"), "n.a", &scalar("raw")).unwrap();
        let clash = units.take(&port("U"), "n.b", &scalar("N")).unwrap_err();
        assert_eq!((clash.has.as_str(), clash.takes.as_str()), ("is in `N`", "`raw`, the unit of `n.a`"));
        for (pattern, gives) in [("U", "raw"), ("U/tactel", "raw/tactel"), ("U/s", "raw/s"), ("m", "m"), ("V", "1")] {
            let mut shape = scalar("1");
            units.give(&port(pattern), "n.y", &mut shape);
            assert_eq!(shape.unit().unwrap().to_string(), gives);
        }
        units.give(&port("W"), "n.y", &mut scalar("kPa"));
        let clash = units.take(&port("W"), "n.c", &scalar("N")).unwrap_err();
        assert_eq!(clash.takes, "`kPa`, the unit of the output `n.y`", "a delayed input");
    }
}
