//! What a mode asks for and never gets: a setpoint beyond a limit, below a threshold or beside a window, and a threshold
//! of a node beyond a limit.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::deadbands::always_resting;
use super::exit_bounds::exit_bounds;
use super::mode_law::ModeLaw;
use crate::tool::control::digits::to_three_digits;
use crate::tool::control::exits::Exit;
use crate::tool::control::law::Feature;
use crate::tool::control::nodes::source;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| unreachable_setpoint(arm, mode, feature)));
        found.extend(mode.moving().filter_map(|feature| always_resting(arm, mode, feature)));
        found.extend(mode.moving().filter_map(|feature| beside_window(mode, feature)));
        found.extend(exit_bounds(arm, mode));
        found.extend(thresholds(arm, mode));
    }
    found
}

/// Parameters of nodes that need a force, by their type.
const LEAST_FORCES: [(&str, &str); 2] = [("label", "min_force"), ("friction_margin", "least_force")];

/// Returns the warnings about nodes that need a larger force than a limit allows.
fn thresholds(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    let nodes = mode.nodes.upstream(&arm.twist);
    let never = nodes.into_iter().filter_map(|node| {
        let (_, key) = LEAST_FORCES.into_iter().find(|(kind, _)| node.kind.text == *kind)?;
        let (limit, limit_key) = arm.force_limit(mode, "force").filter(|(_, key)| key.ends_with("_n"))?;
        let least = mode.nodes.number(node, key).filter(|least| *least >= limit)?;
        let message = format!(
            "`{}` needs {least} N, but the limit `{limit_key}` is {limit}: the sensor never presses that hard",
            node.name
        );
        let help = format!("write `{key}` well below {limit}, or raise `{limit_key}` in [limits]");
        Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place(&node.name, key), message).help(help))
    });
    never.collect()
}

/// Multiple of a threshold up to which a pressure hardly keeps its contact [1].
const ABOVE: f64 = 1.15;

/// Share of a limit from which on noise and overshoot reach it at a setpoint [1].
const NEAR: f64 = 0.95;

/// Why a task never reaches the setpoint of a force.
pub(super) enum Unreachable<'a> {
    /// It is not below a limit, or hardly.
    AboveLimit {
        /// The limit, in the unit of the setpoint.
        most: f64,
        /// Its key in `[limits]`.
        key: String,
    },
    /// The pad feels the contact at larger values only.
    BelowThreshold {
        /// The smallest value that counts, in the unit of the setpoint.
        threshold: f64,
        /// The node that drops smaller ones, and its key.
        node: &'a str,
        key: &'static str,
        /// What it drops.
        what: &'static str,
    },
}

/// What is dropped before a feature is measured.
struct Dropped {
    quantity: &'static str,
    /// The type of the node that drops it, and the keys of its bound, of which the first one that is given counts.
    kind: &'static str,
    keys: &'static [&'static str],
    what: &'static str,
}

const DROPPED: [Dropped; 3] = [
    Dropped { quantity: "pressure", kind: "binarize", keys: &["release", "threshold"], what: "tactels" },
    Dropped { quantity: "force", kind: "label", keys: &["min_force"], what: "contacts" },
    Dropped { quantity: "area", kind: "label", keys: &["min_area"], what: "contacts" },
];

/// Returns why a task never reaches the setpoint of a feature; `None` if it may reach it.
pub(super) fn unreachable<'a>(arm: &Arm<'_>, mode: &ModeLaw<'a>, feature: &Feature) -> Option<Unreachable<'a>> {
    let (quantity, setpoint) = (mode.quantity(feature)?, feature.setpoint?);
    if let Some((most, key)) = arm.force_limit(mode, quantity).filter(|(most, _)| setpoint >= *most) {
        return Some(Unreachable::AboveLimit { most, key });
    }
    let dropped = DROPPED.iter().find(|dropped| dropped.quantity == quantity)?;
    let (threshold, node, key) = least_felt(mode, feature, dropped)?;
    // The mean of the tactels that are still there lies above the threshold.
    let is_below = setpoint < threshold || quantity == "pressure" && setpoint <= ABOVE * threshold;
    (is_below && !lets_go(arm, mode)).then_some(Unreachable::BelowThreshold {
        threshold,
        node,
        key,
        what: dropped.what,
    })
}

/// Returns the limit that a setpoint nearly reaches, in a mode that does not end before.
fn near_limit<'a>(arm: &Arm<'_>, mode: &ModeLaw<'a>, feature: &Feature) -> Option<Unreachable<'a>> {
    let (quantity, setpoint) = (mode.quantity(feature)?, feature.setpoint?);
    let (most, key) = arm.force_limit(mode, quantity)?;
    let ends_before = mode.conditions().any(|exit| {
        let is_of_it = exit.when().and_then(|when| arm.watched(mode, when)).as_deref() == Some(quantity);
        is_of_it && exit.number("above").is_some_and(|above| above < NEAR * most)
    });
    (setpoint >= NEAR * most && !ends_before).then_some(Unreachable::AboveLimit { most, key })
}

/// Returns the warning about a setpoint of a force that the task never reaches.
pub(super) fn unreachable_setpoint(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let (name, setpoint) = (&feature.name, feature.setpoint?);
    let (message, help) = match unreachable(arm, mode, feature).or_else(|| near_limit(arm, mode, feature))? {
        Unreachable::AboveLimit { most, key } => {
            let why = if setpoint >= most { "it is never reached" } else { "noise and overshoot reach the limit" };
            let of = if mode.quantity(feature)? == "pressure" { "one tactel" } else { "the whole pad" };
            (
                format!("the setpoint of `{name}` is {setpoint}, but the limit `{key}` of {of} is {most}: {why}"),
                format!("write a setpoint well below {most}, or raise `{key}` in [limits]"),
            )
        }
        Unreachable::BelowThreshold { threshold, node, key, what } => (
            format!(
                "the setpoint of `{name}` is {setpoint}, but `{node}` drops {what} below {threshold}: {}",
                if setpoint > threshold {
                    let ratio = to_three_digits(setpoint / threshold);
                    format!("with {ratio} times the threshold, the contact ends again and again")
                } else {
                    "the contact is lost before it is reached".to_owned()
                }
            ),
            format!(
                "write a setpoint well above {threshold}{}, or a smaller `{key}` of `{node}`",
                example(arm, mode, feature, threshold).unwrap_or_default()
            ),
        ),
    };
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place_of_setpoint(feature)?, message).help(help))
}

/// Returns a setpoint well above a threshold for a help; `None` if it comes near a limit.
fn example(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature, threshold: f64) -> Option<String> {
    let setpoint = (3e6 * threshold).round() / 1e6;
    let limit = arm.force_limit(mode, mode.quantity(feature)?);
    limit.is_none_or(|(most, _)| setpoint < NEAR * most).then(|| format!(", for example {setpoint}"))
}

/// Returns the warning about a place outside of the window in which it is measured.
pub(super) fn beside_window(mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let axis = ["x", "y"].iter().position(|axis| mode.quantity(feature) == Some(axis))?;
    let windows = mode.nodes.upstream(feature.measured.as_deref()?);
    let window = windows.into_iter().find(|node| node.kind.text == "image_window")?;
    // A window that follows a point goes with the contact.
    if source(window, "x").is_some() || source(window, "y").is_some() {
        return None;
    }
    let pair = |key: &str| mode.nodes.value(window, key).and_then(|value| value.value.read::<[f64; 2]>());
    let (size, centre) = (pair("size")?[axis], pair("centre").unwrap_or_default()[axis]);
    let setpoint = feature.setpoint.filter(|setpoint| (setpoint - centre).abs() > size / 2.0)?;
    let (name, [from, to]) = (&feature.name, [-0.5, 0.5].map(|side| ((centre + side * size) * 1e6).round() / 1e6));
    let message = format!(
        "the setpoint of `{name}` is {setpoint} m, but `{}` shows the pad from {from} to {to} m: it is never reached",
        window.name
    );
    let help = format!("write a setpoint well inside of {from} to {to}, or a larger `size` of `{}`", window.name);
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place_of_setpoint(feature)?, message).help(help))
}

/// Returns whether a mode is meant to end without a contact: an exit waits for that, or the sensor moves away after it.
fn lets_go(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> bool {
    mode.releases().next().is_some() || mode.lost().filter_map(Exit::to).any(|to| arm.leaves(to))
}

/// Returns the smallest value that counts upstream of a feature, the node that drops smaller ones, and its key.
fn least_felt<'a>(mode: &ModeLaw<'a>, feature: &Feature, dropped: &Dropped) -> Option<(f64, &'a str, &'static str)> {
    let nodes = mode.nodes.upstream(feature.measured.as_deref()?);
    let node = nodes.into_iter().find(|node| node.kind.text == dropped.kind)?;
    let (value, key) = dropped.keys.iter().find_map(|key| Some((mode.nodes.number(node, key)?, *key)))?;
    Some((value, &node.name, key))
}
