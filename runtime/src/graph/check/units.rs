//! Units: what an input takes, what an output gives, and what follows from one for the other.

use std::collections::BTreeMap;

use crate::node::{PortSpec, UnitPattern, unit_pattern};
use crate::signal::{Shape, Unit};

/// What comes in is not what is taken.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Clash {
    /// What comes in: `is in `m``.
    pub(crate) has: String,
    /// What is taken: ``N``.
    pub(crate) takes: String,
}

/// What the variables of one node stand for, and which input told.
#[derive(Debug, Default)]
pub(crate) struct Units {
    known: BTreeMap<char, (Unit, String)>,
}

impl Units {
    /// Takes the unit of what comes in on the input called `name`.
    pub(crate) fn take(&mut self, port: &PortSpec, name: &str, shape: &Shape) -> Result<(), Clash> {
        if let Shape::Features(features) = shape {
            let slow = features.features.iter().find(|feature| feature.unit.per_second == 0);
            return match (unit_pattern(port), slow) {
                (Some(UnitPattern::AnyRate | UnitPattern::Variable { per_second: true, .. }), Some(feature)) => {
                    let has = format!("has `{}` in `{}`", feature.name, feature.unit);
                    Err(Clash { has, takes: "features per second".into() })
                }
                _ => Ok(()),
            };
        }
        let Some(unit) = shape.unit() else { return Ok(()) };
        let takes = match unit_pattern(port) {
            None | Some(UnitPattern::Any) => return Ok(()),
            Some(UnitPattern::AnyRate) if unit.per_second > 0 => return Ok(()),
            Some(UnitPattern::AnyRate) => "something per second".into(),
            Some(UnitPattern::Known(takes)) if takes == unit => return Ok(()),
            Some(UnitPattern::Known(takes)) => format!("`{takes}`"),
            Some(UnitPattern::Variable { name: letter, .. }) => {
                let (takes, by) = self.known.entry(letter).or_insert_with(|| (unit, name.to_owned()));
                if *takes == unit {
                    return Ok(());
                }
                format!("`{takes}` like `{by}`")
            }
        };
        Err(Clash { has: format!("is in `{unit}`"), takes })
    }

    /// Fills in the unit of an output, called `name`, that follows from its declaration. What nothing has told so far
    /// is what the node says: an input that is delayed has to agree.
    pub(crate) fn give(&mut self, port: &PortSpec, name: &str, shape: &mut Shape) {
        match unit_pattern(port) {
            Some(UnitPattern::Known(unit)) => shape.set_unit(unit),
            Some(UnitPattern::Variable { name: letter, per_tactel, per_second }) => {
                if let Some((unit, _)) = self.known.get(&letter) {
                    let unit = if per_tactel { unit.per_tactel() } else { *unit };
                    shape.set_unit(if per_second { unit.per_second() } else { unit });
                } else if let Some(unit) = shape.unit().filter(|_| !per_tactel && !per_second) {
                    self.known.insert(letter, (unit, name.to_owned()));
                }
            }
            None | Some(UnitPattern::Any | UnitPattern::AnyRate) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::node::Need;
    use crate::signal::{Kind, ScalarShape};

    fn port(unit: &'static str) -> PortSpec {
        let args = vec![unit.into()].into();
        PortSpec { name: "x".into(), doc: "".into(), kind: Kind::Scalar, args, need: Need::REQUIRED }
    }

    fn scalar(unit: &str) -> Shape {
        ScalarShape::of(unit.parse().unwrap()).into()
    }

    #[test]
    fn what_goes_in_and_what_follows() {
        let cases =
            [("N", "N", true), ("N", "m", false), ("_", "kPa", true), ("_/s", "m/s", true), ("_/s", "m", false)];
        for (takes, has, fits) in cases {
            assert_eq!(Units::default().take(&port(takes), "n.x", &scalar(has)).is_ok(), fits, "{takes} {has}");
        }
        let mut units = Units::default();
        units.take(&port("U"), "n.a", &scalar("raw")).unwrap();
        let clash = units.take(&port("U"), "n.b", &scalar("N")).unwrap_err();
        assert_eq!((clash.has.as_str(), clash.takes.as_str()), ("is in `N`", "`raw` like `n.a`"));
        for (pattern, gives) in [("U", "raw"), ("U/tactel", "raw/tactel"), ("U/s", "raw/s"), ("m", "m"), ("V", "1")] {
            let mut shape = scalar("1");
            units.give(&port(pattern), "n.y", &mut shape);
            assert_eq!(shape.unit().unwrap().to_string(), gives);
        }
        units.give(&port("W"), "n.y", &mut scalar("kPa"));
        let clash = units.take(&port("W"), "n.c", &scalar("N")).unwrap_err();
        assert_eq!(clash.takes, "`kPa` like `n.y`", "an input that is compared later");
    }
}
