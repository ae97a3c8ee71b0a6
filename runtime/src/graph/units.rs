//! Units: what an input takes, what an output gives, and what follows from one for the other.

use std::collections::BTreeMap;

use crate::node::PortSpec;
use crate::signal::{Shape, Unit};

/// A unit as a port declares it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pattern {
    /// `"_"`: any, and nothing follows from it.
    Any,
    /// `"_/s"`: any, per second.
    AnyRate,
    /// A unit.
    Known(Unit),
    /// A variable, and what it is divided by.
    Variable { name: char, per_tactel: bool, per_second: bool },
}

fn pattern(port: &PortSpec) -> Option<Pattern> {
    let text = port.args.first().filter(|_| port.kind.has_unit())?;
    Some(match &**text {
        "_" => Pattern::Any,
        "_/s" => Pattern::AnyRate,
        text => text.parse().map_or_else(|_| variable(text), Pattern::Known),
    })
}

fn variable(text: &str) -> Pattern {
    let name = text.chars().next().expect("a unit is not empty");
    Pattern::Variable { name, per_tactel: text.contains("/tactel"), per_second: text.ends_with("/s") }
}

/// What the variables of one node stand for, and which input told.
#[derive(Debug, Default)]
pub(crate) struct Units {
    known: BTreeMap<char, (Unit, String)>,
}

impl Units {
    /// Takes the unit of what comes in; says what the input takes instead if it does not fit.
    pub(crate) fn take(&mut self, port: &PortSpec, name: &str, shape: &Shape) -> Result<(), String> {
        if let Shape::Features(features) = shape {
            let slow = features.features.iter().find(|feature| feature.unit.per_second == 0);
            return match (pattern(port), slow) {
                (Some(Pattern::AnyRate), Some(feature)) => {
                    Err(format!("takes features per second, and `{}` is in `{}`", feature.name, feature.unit))
                }
                _ => Ok(()),
            };
        }
        let Some(unit) = shape.unit() else { return Ok(()) };
        match pattern(port) {
            None | Some(Pattern::Any) => Ok(()),
            Some(Pattern::AnyRate) if unit.per_second > 0 => Ok(()),
            Some(Pattern::AnyRate) => Err(format!("takes something per second, not `{unit}`")),
            Some(Pattern::Known(takes)) if takes == unit => Ok(()),
            Some(Pattern::Known(takes)) => Err(format!("takes `{takes}`")),
            Some(Pattern::Variable { name: letter, .. }) => {
                let (takes, by) = self.known.entry(letter).or_insert_with(|| (unit, name.to_owned()));
                if *takes == unit { Ok(()) } else { Err(format!("takes `{takes}` like `{by}`")) }
            }
        }
    }

    /// Fills in the unit of an output that follows from its declaration.
    pub(crate) fn give(&self, port: &PortSpec, shape: &mut Shape) {
        match pattern(port) {
            Some(Pattern::Known(unit)) => shape.set_unit(unit),
            Some(Pattern::Variable { name, per_tactel, per_second }) => {
                if let Some((unit, _)) = self.known.get(&name) {
                    let unit = if per_tactel { unit.per_tactel() } else { *unit };
                    shape.set_unit(if per_second { unit.per_second() } else { unit });
                }
            }
            None | Some(Pattern::Any | Pattern::AnyRate) => {}
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
        PortSpec { name: "x".into(), doc: "".into(), kind: Kind::Scalar, args, need: Need::Required }
    }

    fn scalar(unit: &str) -> Shape {
        ScalarShape { unit: unit.parse().unwrap() }.into()
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
        assert_eq!(units.take(&port("U"), "n.b", &scalar("N")), Err("takes `raw` like `n.a`".into()));
        for (pattern, gives) in [("U", "raw"), ("U/tactel", "raw/tactel"), ("U/s", "raw/s"), ("m", "m"), ("V", "1")] {
            let mut shape = scalar("1");
            units.give(&port(pattern), &mut shape);
            assert_eq!(shape.unit().unwrap().to_string(), gives);
        }
    }
}
