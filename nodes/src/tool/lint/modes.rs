//! Modes: rolling without force control, a position along a line, and setpoints that a limit or a threshold keeps a task
//! from.

use std::collections::BTreeSet;
use std::ops::Range;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::columns::line_axis;
use super::{Controlled, ModeLaw};
use crate::motion::COMPONENTS;
use crate::tool::control::law::{Feature, Guidance};

/// Nodes that guide the sensor along the object, and do not press.
const GUIDES: [&str; 6] = ["scan_guide", "ridge_guide", "hold_pose", "follow_path", "follow_surface", "park"];

/// Nodes that guide the sensor along a line.
const LINE_GUIDES: [&str; 2] = ["ridge_guide", "follow_path"];

pub(super) fn check(arm: &Controlled<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(rolling(mode));
        found.extend(along_line(mode));
        found.extend(mode.moving().filter_map(|feature| setpoint(arm, mode, feature)));
    }
}

/// Returns the warning about a mode that rolls the sensor over an object while nothing controls the force.
fn rolling(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let presses = |feature: &Feature| {
        let is_place = matches!(mode.quantity(feature), Some("x" | "y" | "orientation"));
        // `pid` warns of a force without a gain.
        feature.column[2] != 0.0 && !is_place
    };
    let mut guides = mode.law.guidance.iter();
    if mode.law.features.iter().any(presses) || guides.any(|it| it.passes[2] && !GUIDES.contains(&&*it.kind)) {
        return None;
    }
    let (name, i, place) = roller(mode)?;
    let message = format!(
        "{}`{name}` rolls the sensor with `{}`, but no feature of the force moves `vz`: the pad loses the contact, or presses \
         harder and harder",
        mode.named(),
        COMPONENTS[i]
    );
    let help = "control the pressure along `vz` in this mode, or select no rolling: 0 for `wx` and `wy`";
    Some(Diagnostic::new(Code::UnforcedRolling, place, message).help(help))
}

/// Returns what rolls the sensor: its name, the component, and its place. A constant motion counts where the mode has a
/// contact to lose, and does not press.
fn roller(mode: &ModeLaw<'_>) -> Option<(String, usize, Range<usize>)> {
    let rolls = |entries: &[f64; 6]| [3, 4].into_iter().find(|i| entries[*i] != 0.0);
    let feature = mode.moving().find_map(|feature| {
        let is_place = matches!(mode.quantity(feature), Some("x" | "y"));
        let i = rolls(&feature.column).filter(|_| is_place)?;
        Some((feature.name.clone(), i, mode.place_of_column(feature)))
    });
    let has_contact = || mode.exits("on_lost").next().is_some();
    let constant = || {
        let is_still = mode.law.constants.iter().all(|constant| constant.twist[2] == 0.0);
        mode.law.constants.iter().filter(|_| is_still && has_contact()).find_map(|constant| {
            Some((constant.node.clone(), rolls(&constant.twist)?, mode.place(&constant.node, "twist")))
        })
    };
    feature.or_else(constant)
}

/// Returns the warning about a position that a mode controls along a line, while it moves the sensor along this line.
///
/// A task that follows a line moves along it. Where the line is longer than the pad, the middle of its print is that of
/// the pad, and where it ends, the control of the position works against the motion.
fn along_line(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let axis = line_axis(mode)?;
    let i = usize::from(axis == "y");
    let constants = mode.law.constants.iter().filter(|constant| constant.twist[i] != 0.0);
    let guides = mode.law.guidance.iter().filter(|guide| guide.passes[i] && LINE_GUIDES.contains(&&*guide.kind));
    let mut followers = constants.map(|constant| &*constant.node).chain(guides.map(Guidance::node));
    let follower = followers.next()?;
    let is_held = |feature: &&Feature| mode.quantity(feature) == Some(axis) && feature.column[i] != 0.0;
    let feature = mode.moving().find(is_held)?;
    let message = format!(
        "{}`{}` is controlled along the line that `{}` follows: the middle of a long print says nothing about a position \
         along it",
        mode.named(),
        feature.name,
        follower
    );
    let help = format!("select 0 for `{}` in the projector behind the column of `{}`", COMPONENTS[i], feature.name);
    Some(Diagnostic::new(Code::LinePosition, mode.place_of_column(feature), message).help(help))
}

/// Returns the smallest limit of a force, and its key.
pub(super) fn force_limit(arm: &Controlled<'_>, mode: &ModeLaw<'_>, quantity: &str) -> Option<(f64, String)> {
    let limit = match quantity {
        "pressure" => "peak",
        "force" => "force",
        _ => return None,
    };
    let limiters = arm.limits.iter().filter(|limiter| limiter.kind.ends_with("contact_limit"));
    let limits = limiters.filter_map(|limiter| {
        let node = mode.nodes.node(&limiter.node)?;
        let keys = [format!("{limit}_n"), format!("{limit}_raw")];
        keys.into_iter().find_map(|key| Some((mode.nodes.number(node, &key)?, key)))
    });
    limits.min_by(|(one, _), (other, _)| one.total_cmp(other))
}

/// Returns the warning about a setpoint of a force that the task never reaches: above a limit, or below what the pad
/// feels.
fn setpoint(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let (quantity, setpoint) = (mode.quantity(feature)?, feature.setpoint?);
    let name = &feature.name;
    let (message, help) = match (force_limit(arm, mode, quantity)?, least_felt(mode, feature)) {
        ((most, key), _) if setpoint >= most => {
            let why = if quantity == "pressure" { "one tactel" } else { "the whole pad" };
            (
                format!(
                    "the setpoint of `{name}` is {setpoint}, but the limit `{key}` of {why} is {most}: it is never reached"
                ),
                format!("write a setpoint well below {most}, or raise `{key}` in [limits]"),
            )
        }
        (_, Some((threshold, node))) if quantity == "pressure" && setpoint <= threshold => (
            format!(
                "the setpoint of `{name}` is {setpoint}, but `{node}` drops tactels below {threshold}: the contact is lost \
                 before it is reached"
            ),
            format!("write a setpoint well above {threshold}, for example {}", (3e6 * threshold).round() / 1e6),
        ),
        _ => return None,
    };
    let node = feature.compared.as_deref()?;
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place(node, &format!("setpoint.{name}")), message).help(help))
}

/// Returns the smallest value of a tactel that a feature counts, and the node that drops smaller ones.
fn least_felt<'a>(mode: &ModeLaw<'a>, feature: &Feature) -> Option<(f64, &'a str)> {
    let mut open = vec![mode.nodes.writer(feature.measured.as_deref()?)?];
    let mut seen = BTreeSet::new();
    while let Some(node) = open.pop() {
        if node.kind.text == "binarize" {
            let value = |key: &str| mode.nodes.number(node, key);
            return Some((value("release").or_else(|| value("threshold"))?, &node.name));
        }
        if seen.insert(&*node.name) {
            open.extend(node.wires.iter().filter_map(|wire| mode.nodes.writer(&wire.source)));
        }
    }
    None
}
