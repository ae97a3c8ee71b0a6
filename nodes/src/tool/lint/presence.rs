//! Features that are never present where they are controlled: a gate keeps them away, or a wire is missing.

use tactflow_runtime::graph::{OutlinedBlock, OutlinedMode};
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::tool::control::exits::{EXITS, exits};
use crate::tool::control::filters::way;
use crate::tool::control::law::Feature;
use crate::tool::control::nodes::source;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    found.extend(arm.outline.nodes.iter().filter_map(|node| without_cause(arm, node)));
    // A feature that another mode lets pass is meant for that mode.
    let passes = |wanted: &Feature| {
        let each = arm.modes.iter().flat_map(|mode| mode.moving().map(move |feature| (mode, feature)));
        each.filter(|(_, feature)| feature.has_gains_of(wanted))
            .any(|(mode, feature)| barred(arm, mode, feature).is_none())
    };
    for mode in &arm.modes {
        for feature in mode.moving().filter(|feature| !passes(feature)) {
            let Some((gate, why, mend)) = barred(arm, mode, feature) else { continue };
            let message = format!("`{}` has gains, but it is never present: it passes `{gate}`, {why}", feature.name);
            let help = mend.unwrap_or_else(|| {
                format!(
                    "let a gate of `{}` open in a mode that selects its column, or remove its column, its gains and its wire",
                    feature.name
                )
            });
            found.push(Diagnostic::new(Code::UnusedColumn, mode.place_of_column(feature), message).help(help));
        }
    }
    found
}

/// Returns the warning about an output that something reads, and that is never present: an input or a parameter of its
/// node is missing.
fn without_cause(arm: &Arm<'_>, node: &OutlinedBlock) -> Option<Diagnostic> {
    let has = |param: &str| node.settings.iter().any(|setting| setting.path == param);
    let (port, missing, help) = match &*node.kind.text {
        "curvature" if source(node, "twist").is_none() => {
            ("rate", "in.twist", "wire the twist that moves the sensor along the line to `in.twist`")
        }
        "contact_area" if !has("threshold") => {
            ("interpolated", "threshold", "write the threshold of `binarize`, or its `release`, as `threshold`")
        }
        _ => return None,
    };
    let port = format!("{}.{port}", node.name);
    let reader = reader(arm, &port)?;
    let message = format!("{reader} reads `{port}`, which is never present: `{}` has no `{missing}`", node.name);
    let help = format!("{help} of `{}`", node.name);
    Some(Diagnostic::new(Code::UnusedColumn, node.span.clone(), message).help(help))
}

/// Returns a node or a mode that reads a port, for messages.
fn reader(arm: &Arm<'_>, port: &str) -> Option<String> {
    let reads = |reader: &&OutlinedBlock| reader.wires.iter().any(|wire| wire.source == port);
    let node = arm.outline.nodes.iter().find(reads).map(|node| format!("`{}`", node.name));
    let waits = |mode: &&OutlinedMode| {
        let mut all = EXITS.iter().flat_map(|key| exits(mode, key));
        all.any(|exit| [exit.when(), exit.of()].contains(&Some(port)))
    };
    let mode = || arm.outline.modes.iter().find(waits).map(|mode| format!("the mode `{}`", mode.name));
    node.or_else(mode)
}

/// Returns the flag that keeps a feature from moving the sensor in a mode, why, and what mends it if that is known.
fn barred<'f>(arm: &Arm<'_>, mode: &ModeLaw<'f>, feature: &'f Feature) -> Option<(&'f str, String, Option<String>)> {
    let exclusive = || {
        let [(gate, one), (other_gate, other)] = contradiction(mode, &feature.gates)?;
        let (why, mend) = match gate == other_gate {
            true => {
                (format!("which needs `{one}` and `{other}`"), format!("remove one of these two flags from `{gate}`"))
            }
            false => (
                format!("and at the same time `{other_gate}`"),
                format!("remove one of the two gates of `{}`", feature.name),
            ),
        };
        let (why, mend) =
            (why + ", but both are never set together", mend + ", or change the bounds of what sets them");
        Some((gate, why, Some(mend)))
    };
    let why_closed = |flag: &str| match mode.nodes.is_set(flag) {
        Some(true) => None,
        Some(false) => Some(("which is set in another mode only".to_owned(), None)),
        None if is_without_contact(mode, flag) => Some(("which is set without a contact only".to_owned(), None)),
        None => out_of_reach(arm, mode, flag).map(|(why, mend)| (why, Some(mend))),
    };
    let closed = feature.gates.iter().find_map(|gate| {
        let (why, mend) = needed(mode, gate).into_iter().find_map(why_closed)?;
        Some((&**gate, why, mend))
    });
    closed.or_else(exclusive)
}

/// Returns two flags of which one is always off, of those that a feature passes, each behind its gate.
fn contradiction<'f>(mode: &ModeLaw<'f>, gates: &'f [String]) -> Option<[(&'f str, &'f str); 2]> {
    let flags = gates.iter().flat_map(|gate| needed(mode, gate).into_iter().map(move |flag| (&**gate, flag)));
    let flags: Vec<(&str, &str)> = flags.collect();
    let mut pairs =
        flags.iter().enumerate().flat_map(|(at, one)| flags[at + 1..].iter().map(move |other| [*one, *other]));
    let exclude = |one: &str, other: &str| is_opposite(mode, one, other) || are_apart(mode, one, other);
    pairs.find(|[(_, one), (_, other)]| exclude(one, other) || exclude(other, one))
}

/// Returns the flags that are set whenever a flag is: those of which `all` makes it, or itself.
fn needed<'f>(mode: &ModeLaw<'f>, flag: &'f str) -> Vec<&'f str> {
    match mode.nodes.writer(flag).filter(|node| node.kind.text == "all") {
        Some(all) => all.wires.iter().flat_map(|wire| needed(mode, &wire.source)).collect(),
        None => vec![flag],
    }
}

/// Returns whether a flag is the opposite of another one.
fn is_opposite(mode: &ModeLaw<'_>, flag: &str, other: &str) -> bool {
    let not = mode.nodes.writer(flag).filter(|node| node.kind.text == "not");
    not.and_then(|not| source(not, "flag")) == Some(other)
}

/// Returns whether a flag is set above a value, and the other one below a smaller value of the same port, also with their
/// hysteresis.
fn are_apart(mode: &ModeLaw<'_>, high: &str, low: &str) -> bool {
    let compare = |flag: &str, key: &str| {
        let node = mode.nodes.writer(flag).filter(|node| node.kind.text == "compare")?;
        let number = |key: &str| mode.nodes.number(node, key);
        Some((source(node, "value")?, number(key)?, number("hysteresis").unwrap_or_default()))
    };
    let bounds = compare(high, "above").zip(compare(low, "below"));
    bounds.is_some_and(|((one, above, up), (other, below, down))| one == other && above - up >= below + down)
}

/// Returns why a comparison never sets its flag, and what mends it: it needs a larger force than a limit allows, or a value
/// that its port never has.
fn out_of_reach(arm: &Arm<'_>, mode: &ModeLaw<'_>, flag: &str) -> Option<(String, String)> {
    let node = mode.nodes.writer(flag).filter(|node| node.kind.text == "compare")?;
    let port = way(&mode.nodes, source(node, "value")?).measured;
    let [above, below] = ["above", "below"].map(|key| mode.nodes.number(node, key));
    let limit = mode.quantity_of(&port).and_then(|quantity| arm.force_limit(mode, quantity));
    let range = mode.nodes.output(&port).and_then(|port| port.range);
    let limited = above.zip(limit).filter(|(above, (limit, _))| above >= limit);
    let too_large = above.zip(range).filter(|(above, [_, max])| above >= max);
    let too_small = below.zip(range).filter(|(below, [min, _])| below <= min);
    let name = &node.name;
    let (asked, why, mend) = match (limited, too_large, too_small) {
        (Some((above, (limit, key))), ..) => (
            format!("above {above}"),
            format!("the limit `{key}` is {limit}"),
            format!("write `above` well below {limit} in `{name}`"),
        ),
        (_, Some((above, [_, max])), _) => (
            format!("above {above}"),
            format!("`{port}` is at most {max}"),
            format!("write `above` well below {max} in `{name}`"),
        ),
        (.., Some((below, [min, _]))) => (
            format!("below {below}"),
            format!("`{port}` is at least {min}"),
            format!("write `below` well above {min} in `{name}`"),
        ),
        _ => return None,
    };
    Some((format!("which is set {asked}, but {why}"), mend))
}

/// Returns whether a flag is the opposite of a contact.
fn is_without_contact(mode: &ModeLaw<'_>, flag: &str) -> bool {
    let not = mode.nodes.writer(flag).filter(|node| node.kind.text == "not");
    not.and_then(|not| source(not, "flag"))
        .and_then(|port| Some((port, mode.nodes.writer(port)?)))
        .is_some_and(|(port, node)| port.ends_with(".present") && node.kind.text == "label")
}
