//! Units: what an input takes, what an output gives, and what follows from one for the other.

use std::collections::BTreeMap;

use super::frames::frame_args;
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
    let name = text.chars().next().unwrap_or('?');
    Pattern::Variable { name, per_tactel: text.contains("/tactel"), per_second: text.ends_with("/s") }
}

/// Whether the unit that a port declares is a unit, a wildcard or a variable: a capital letter, by itself or divided.
pub(crate) fn declares_a_unit(port: &PortSpec) -> bool {
    match (pattern(port), port.args.first()) {
        (Some(Pattern::Variable { name, .. }), Some(text)) => {
            name.is_ascii_uppercase() && matches!(&text[1..], "" | "/tactel" | "/s" | "/tactel/s")
        }
        _ => true,
    }
}

/// Whether a wire from an output to an input can be right, as far as their declarations tell.
pub(crate) fn may_fit(output: &PortSpec, input: &PortSpec) -> bool {
    let units = match (pattern(output), pattern(input)) {
        (Some(Pattern::Known(has)), Some(Pattern::Known(takes))) => has == takes,
        (Some(Pattern::Known(has)), Some(Pattern::AnyRate)) => has.per_second > 0,
        (Some(Pattern::Variable { per_second, .. }), Some(Pattern::Known(takes))) => {
            !per_second || takes.per_second > 0
        }
        _ => true,
    };
    let is_fixed = |frame: &str| frame != "self" && frame.starts_with(|c: char| c.is_ascii_lowercase());
    let frames = frame_args(output).iter().zip(frame_args(input));
    let do_frames_fit = frames.into_iter().all(|(a, b)| a == b || !is_fixed(a) || !is_fixed(b));
    output.kind == input.kind && units && do_frames_fit
}

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
            return match (pattern(port), slow) {
                (Some(Pattern::AnyRate | Pattern::Variable { per_second: true, .. }), Some(feature)) => {
                    let has = format!("has `{}` in `{}`", feature.name, feature.unit);
                    Err(Clash { has, takes: "features per second".into() })
                }
                _ => Ok(()),
            };
        }
        let Some(unit) = shape.unit() else { return Ok(()) };
        let takes = match pattern(port) {
            None | Some(Pattern::Any) => return Ok(()),
            Some(Pattern::AnyRate) if unit.per_second > 0 => return Ok(()),
            Some(Pattern::AnyRate) => "something per second".into(),
            Some(Pattern::Known(takes)) if takes == unit => return Ok(()),
            Some(Pattern::Known(takes)) => format!("`{takes}`"),
            Some(Pattern::Variable { name: letter, .. }) => {
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
        match pattern(port) {
            Some(Pattern::Known(unit)) => shape.set_unit(unit),
            Some(Pattern::Variable { name: letter, per_tactel, per_second }) => {
                if let Some((unit, _)) = self.known.get(&letter) {
                    let unit = if per_tactel { unit.per_tactel() } else { *unit };
                    shape.set_unit(if per_second { unit.per_second() } else { unit });
                } else if let Some(unit) = shape.unit().filter(|_| !per_tactel && !per_second) {
                    self.known.insert(letter, (unit, name.to_owned()));
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
        PortSpec { name: "x".into(), doc: "".into(), kind: Kind::Scalar, args, need: Need::REQUIRED }
    }

    fn scalar(unit: &str) -> Shape {
        ScalarShape::of(unit.parse().unwrap()).into()
    }

    #[test]
    fn what_a_port_may_declare() {
        let cases = [("N", true), ("U", true), ("U/tactel/s", true), ("_/s", true), ("newton", false), ("Um", false)];
        for (unit, is_good) in cases.into_iter().chain([("", false)]) {
            assert_eq!(declares_a_unit(&port(unit)), is_good, "{unit}");
        }
    }

    #[test]
    fn what_may_fit_as_far_as_the_declarations_tell() {
        let cases = [
            ("N", "N", true),
            ("N", "m", false),
            ("U", "m", true),
            ("U/s", "m", false),
            ("U/s", "m/s", true),
            ("m", "_/s", false),
            ("m/s", "_/s", true),
            ("m", "_", true),
        ];
        for (gives, takes, fits) in cases {
            assert_eq!(may_fit(&port(gives), &port(takes)), fits, "{gives} to {takes}");
        }
        let in_frame = |frame: &'static str| PortSpec { args: vec!["m".into(), frame.into()].into(), ..port("m") };
        for (from, to, fits) in
            [("base", "base", true), ("base", "tool", false), ("base", "A", true), ("$of", "base", true)]
        {
            assert_eq!(may_fit(&in_frame(from), &in_frame(to)), fits, "{from} to {to}");
        }
        let flag = PortSpec { kind: Kind::Flag, args: vec![].into(), ..port("m") };
        assert!(!may_fit(&flag, &port("_")));
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
