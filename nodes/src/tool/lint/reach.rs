//! What a mode asks for or waits for and never gets: it lies beyond a limit, below a threshold, beside a window, or within a
//! deadband.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::tool::control::digits::to_two_digits;
use crate::tool::control::exits::Exit;
use crate::tool::control::law::Feature;
use crate::tool::control::settings::source;

pub(super) fn check(arm: &Arm<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| setpoint(arm, mode, feature)));
        found.extend(mode.moving().filter_map(|feature| always_resting(arm, mode, feature)));
        found.extend(mode.moving().filter_map(|feature| beside_window(mode, feature)));
        found.extend(exit_bounds(arm, mode));
    }
    found.extend(arm.modes.first().into_iter().flat_map(|mode| thresholds(arm, mode)));
}

/// Returns the warnings about exits that wait for a larger force than a limit allows.
fn exit_bounds(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    let never = mode.conditions().filter_map(|exit| {
        let (when, above) = (exit.when()?, exit.entry("above")?);
        // Only something that pushes the pad gives more, and then the sensor is right to leave.
        if exit.to().is_some_and(|to| leaves(arm, to)) {
            return None;
        }
        let quantity = arm.watched(mode, when)?;
        let (limit, key) = arm.force_limit(mode, &quantity)?;
        let bound = above.read::<f64>().filter(|bound| *bound >= limit)?;
        let message = format!(
            "an exit of mode `{}` waits for `{when}` above {bound}, but the limit `{key}` is {limit}: the sensor never presses \
             that hard",
            mode.own_name()
        );
        let help = format!("write a bound well below {limit}, or raise `{key}` in [limits]");
        Some(Diagnostic::new(Code::UnreachableSetpoint, above.span.clone(), message).help(help))
    });
    never.collect()
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

/// Returns the warning about a setpoint of a force that the task never reaches: above a limit, or below what the pad
/// feels.
pub(super) fn setpoint(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let (quantity, setpoint) = (mode.quantity(feature)?, feature.setpoint?);
    let name = &feature.name;
    let (message, help) = match (arm.force_limit(mode, quantity)?, least_felt(mode, feature)) {
        ((most, key), _) if setpoint >= most => {
            let why = if quantity == "pressure" { "one tactel" } else { "the whole pad" };
            (
                format!(
                    "the setpoint of `{name}` is {setpoint}, but the limit `{key}` of {why} is {most}: it is never reached"
                ),
                format!("write a setpoint well below {most}, or raise `{key}` in [limits]"),
            )
        }
        (_, Some((threshold, node))) if quantity == "pressure" && setpoint <= threshold && !lets_go(arm, mode) => (
            format!(
                "the setpoint of `{name}` is {setpoint}, but `{node}` drops tactels below {threshold}: the contact is lost \
                 before it is reached"
            ),
            format!("write a setpoint well above {threshold}, for example {}", (3e6 * threshold).round() / 1e6),
        ),
        _ => return None,
    };
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place_of_setpoint(feature)?, message).help(help))
}

/// Returns the warning about a deadband in which a feature always rests, or for good once the contact is lost.
fn always_resting(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let band = mode.deadband(feature)?;
    let (name, path) = (&feature.name, format!("width.{}.outer", feature.name));
    let outer = mode.nodes.number(band, &path)?;
    let largest = arm.largest_error(mode, feature);
    let why = match mode.quantity(feature)? {
        "pressure" | "force" if feature.setpoint == Some(largest) => {
            format!("without a contact its error is {largest}, so once it rests it presses no more")
        }
        _ => format!("no error is larger than {largest}, so it rests wherever the contact is"),
    };
    if outer < largest {
        return None;
    }
    let message = format!("`{name}` rests up to an error of {outer}, but {why}");
    let [inner, outer] = [0.05, 0.1].map(|share| to_two_digits(share * largest, libm::floor));
    let help = format!("write widths well below {largest}: `width.{name} = {{ inner = {inner}, outer = {outer} }}`");
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place(&band.name, &path), message).help(help))
}

/// Returns the warning about a place outside of the window in which it is measured.
fn beside_window(mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
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
    let help = format!("write a setpoint between {from} and {to}, or a larger `size` of `{}`", window.name);
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place_of_setpoint(feature)?, message).help(help))
}

/// Returns whether a mode is meant to end without a contact: an exit waits for that, or the sensor moves away after it.
fn lets_go(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> bool {
    mode.releases().next().is_some() || mode.lost().filter_map(Exit::to).any(|to| leaves(arm, to))
}

/// Returns whether the sensor moves away from the object in a mode.
fn leaves(arm: &Arm<'_>, mode: &str) -> bool {
    arm.mode(mode).is_some_and(ModeLaw::backs_off)
}

/// Returns the smallest value of a tactel that a feature counts, and the node that drops smaller ones.
fn least_felt<'a>(mode: &ModeLaw<'a>, feature: &Feature) -> Option<(f64, &'a str)> {
    let nodes = mode.nodes.upstream(feature.measured.as_deref()?);
    let node = nodes.into_iter().find(|node| node.kind.text == "binarize")?;
    let value = |key: &str| mode.nodes.number(node, key);
    Some((value("release").or_else(|| value("threshold"))?, &node.name))
}
