//! Units of one node: what its inputs accept, and what follows for its outputs.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::node::{PortSpec, UnitPattern, unit_pattern};
use crate::signal::{Shape, Unit};

/// An input received another unit than it accepts.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct UnitMismatch {
    /// The received unit, for example ``is in `m` ``.
    pub(crate) has: String,
    /// The accepted unit, for example `` `N` ``.
    pub(crate) takes: String,
    /// What determined the accepted unit, if it is not the declaration of the input.
    pub(crate) by: Option<UnitOrigin>,
}

/// The place that determined a unit, and what happens there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct UnitOrigin {
    pub(crate) span: Range<usize>,
    pub(crate) text: String,
}

/// The unit variables of one node: the unit, the port that determined it, and where that port got it.
#[derive(Debug, Default)]
pub(crate) struct Units {
    known: BTreeMap<char, (Unit, String, UnitOrigin)>,
}

impl Units {
    /// Binds the unit variable of an input, or returns the mismatch.
    ///
    /// `name` is the full name of the input, and `origin` what determined the unit of its source.
    pub(crate) fn take(
        &mut self,
        port: &PortSpec,
        name: &str,
        shape: &Shape,
        origin: &UnitOrigin,
    ) -> Result<(), UnitMismatch> {
        let mismatch = |has: String, takes: String| UnitMismatch { has, takes, by: None };
        if let Shape::Features(features) = shape {
            let not_rate = features.features.iter().find(|feature| feature.unit.per_second == 0);
            return match (unit_pattern(port), not_rate) {
                (Some(UnitPattern::AnyRate | UnitPattern::Variable { per_second: true, .. }), Some(feature)) => {
                    let has = format!("has `{}` in `{}`", feature.name, feature.unit);
                    Err(mismatch(has, "features per second".into()))
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
                let bind = || (unit, format!("`{name}`"), origin.clone());
                let (takes, by, first) = self.known.entry(letter).or_insert_with(bind);
                if *takes == unit {
                    return Ok(());
                }
                let (has, takes) = (format!("is in `{unit}`"), format!("`{takes}`, the unit of {by}"));
                return Err(UnitMismatch { has, takes, by: Some(first.clone()) });
            }
        };
        Err(mismatch(format!("is in `{unit}`"), takes))
    }

    /// Sets the unit of an output from its declaration, and returns what determined it. `name` is the full name of the
    /// output, and `node` the place of its node.
    ///
    /// A variable that no input has bound takes the unit that the node chose, so a delayed input must agree with it.
    pub(crate) fn give(&mut self, port: &PortSpec, name: &str, node: &Range<usize>, shape: &mut Shape) -> UnitOrigin {
        let here = |shape: &Shape| {
            let text = match shape.unit() {
                Some(unit) => format!("`{name}` is in `{unit}` by its declaration"),
                None => format!("`{name}` is computed here"),
            };
            UnitOrigin { span: node.clone(), text }
        };
        match unit_pattern(port) {
            Some(UnitPattern::Known(unit)) => shape.set_unit(unit),
            Some(UnitPattern::Variable { name: letter, per_tactel, per_second }) => {
                if let Some((unit, _, origin)) = self.known.get(&letter) {
                    let unit = if per_tactel { unit.per_tactel() } else { *unit };
                    shape.set_unit(if per_second { unit.per_second() } else { unit });
                    return origin.clone();
                }
                if let Some(unit) = shape.unit().filter(|_| !per_tactel && !per_second) {
                    self.known.insert(letter, (unit, format!("the output `{name}`"), here(shape)));
                }
            }
            None | Some(UnitPattern::Any | UnitPattern::AnyRate) => {}
        }
        here(shape)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{Kind, ScalarShape};

    fn port(unit: &'static str) -> PortSpec {
        PortSpec::new("x", "", Kind::Scalar, &[unit])
    }

    fn origin(text: &str) -> UnitOrigin {
        UnitOrigin { span: 0..1, text: text.to_owned() }
    }

    fn scalar(unit: &str) -> Shape {
        ScalarShape::of(unit.parse().unwrap()).into()
    }

    #[test]
    fn inputs_bind_variables_and_outputs_follow() {
        let cases =
            [("N", "N", true), ("N", "m", false), ("_", "kPa", true), ("_/s", "m/s", true), ("_/s", "m", false)];
        for (takes, has, fits) in cases {
            let taken = Units::default().take(&port(takes), "n.x", &scalar(has), &origin("m.x"));
            assert_eq!(taken.is_ok(), fits, "{takes} {has}");
        }
        let mut units = Units::default();
        units.take(&port("U"), "n.a", &scalar("raw"), &origin("m.a")).unwrap();
        let clash = units.take(&port("U"), "n.b", &scalar("N"), &origin("m.b")).unwrap_err();
        assert_eq!(clash.by, Some(origin("m.a")), "what determined the unit first");
        assert_eq!((clash.has.as_str(), clash.takes.as_str()), ("is in `N`", "`raw`, the unit of `n.a`"));
        for (pattern, gives) in [("U", "raw"), ("U/tactel", "raw/tactel"), ("U/s", "raw/s"), ("m", "m"), ("V", "1")] {
            let mut shape = scalar("1");
            let given = units.give(&port(pattern), "n.y", &(7..8), &mut shape);
            assert_eq!(given == origin("m.a"), pattern.starts_with('U'), "{pattern}: {given:?}");
            assert_eq!(shape.unit().unwrap().to_string(), gives);
        }
        units.give(&port("W"), "n.y", &(7..8), &mut scalar("kPa"));
        let clash = units.take(&port("W"), "n.c", &scalar("N"), &origin("m.c")).unwrap_err();
        assert_eq!(clash.takes, "`kPa`, the unit of the output `n.y`", "a delayed input");
    }
}
