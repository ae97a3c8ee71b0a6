//! What the arguments of a port say: its unit as a pattern, and its frames.

use super::PortSpec;
use crate::signal::Unit;

/// A unit as a port declares it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum UnitPattern {
    /// `"_"`: any, and nothing follows from it.
    Any,
    /// `"_/s"`: any, per second.
    AnyRate,
    /// A unit.
    Known(Unit),
    /// A variable, and what it is divided by.
    Variable { name: char, per_tactel: bool, per_second: bool },
}

/// Returns the unit that a port declares, or `None` if its kind has none.
pub(crate) fn unit_pattern(port: &PortSpec) -> Option<UnitPattern> {
    let text = port.args.first().filter(|_| port.kind.has_unit())?;
    Some(match &**text {
        "_" => UnitPattern::Any,
        "_/s" => UnitPattern::AnyRate,
        text => text.parse().map_or_else(|_| variable(text), UnitPattern::Known),
    })
}

fn variable(text: &str) -> UnitPattern {
    let name = text.chars().next().unwrap_or('?');
    UnitPattern::Variable { name, per_tactel: text.contains("/tactel"), per_second: text.ends_with("/s") }
}

/// Whether the unit that a port declares is a unit, a wildcard or a variable: a capital letter, by itself or divided.
pub(crate) fn declares_a_unit(port: &PortSpec) -> bool {
    match (unit_pattern(port), port.args.first()) {
        (Some(UnitPattern::Variable { name, .. }), Some(text)) => {
            name.is_ascii_uppercase() && matches!(&text[1..], "" | "/tactel" | "/s" | "/tactel/s")
        }
        _ => true,
    }
}

/// Whether a wire from an output to an input can be right, as far as their declarations tell.
pub(crate) fn may_fit(output: &PortSpec, input: &PortSpec) -> bool {
    let units = match (unit_pattern(output), unit_pattern(input)) {
        (Some(UnitPattern::Known(has)), Some(UnitPattern::Known(takes))) => has == takes,
        (Some(UnitPattern::Known(has)), Some(UnitPattern::AnyRate)) => has.per_second > 0,
        (Some(UnitPattern::Variable { per_second, .. }), Some(UnitPattern::Known(takes))) => {
            !per_second || takes.per_second > 0
        }
        _ => true,
    };
    let is_fixed = |frame: &str| frame != "self" && frame.starts_with(|c: char| c.is_ascii_lowercase());
    let frames = frame_args(output).iter().zip(frame_args(input));
    let do_frames_fit = frames.into_iter().all(|(a, b)| a == b || !is_fixed(a) || !is_fixed(b));
    output.kind == input.kind && units && do_frames_fit && may_quantity_fit(output, input)
}

/// Whether a port's quantity can be the one that an input accepts. A variable may be any.
fn may_quantity_fit(output: &PortSpec, input: &PortSpec) -> bool {
    let is_name = |quantity: &&str| quantity.starts_with(|c: char| c.is_ascii_lowercase());
    match (output.quantity.as_deref(), input.quantity.as_deref().filter(is_name)) {
        (Some(has), Some(takes)) => !is_name(&has) || has == takes,
        (None, Some(_)) => !input.need.must_be_known,
        (_, None) => true,
    }
}

/// The frames among a port's arguments.
pub(crate) fn frame_args(port: &PortSpec) -> &[std::borrow::Cow<'static, str>] {
    let from = usize::from(port.kind.has_unit()).min(port.args.len());
    &port.args[from..]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::Kind;

    fn port(unit: &'static str) -> PortSpec {
        PortSpec::new("x", "", Kind::Scalar, &[unit])
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
}
