//! Modes: rolling without force control, a position along a line, an approach without a motion, and setpoints that a limit
//! or a threshold keeps a task from.

use std::collections::BTreeSet;
use std::ops::Range;

use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::columns::line_positions;
use super::{Controlled, ModeLaw};
use crate::motion::COMPONENTS;
use crate::tool::control::law::{Feature, Guidance};

/// Nodes that guide the sensor along the object, and do not press.
pub(super) const GUIDES: [&str; 6] =
    ["scan_guide", "ridge_guide", "hold_pose", "follow_path", "follow_surface", "park"];

/// Nodes that guide the sensor along a line.
const LINE_GUIDES: [&str; 2] = ["ridge_guide", "follow_path"];

pub(super) fn check(arm: &Controlled<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(rolling(arm, mode));
        found.extend(along_line(mode));
        found.extend(motionless(arm, mode));
        found.extend(mode.moving().filter_map(|feature| setpoint(arm, mode, feature)));
    }
}

/// Returns the warning about a mode that waits for a contact, and whose constant motion no projector passes.
fn motionless(arm: &Controlled<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    if !mode.waits_for_contact() || (0..6).any(|i| mode.law.moves(i)) {
        return None;
    }
    let moves = |node: &&OutlinedBlock| {
        let twist = mode.nodes.value(node, "twist").and_then(|twist| twist.value.read::<[f64; 6]>());
        node.kind.text == "twist_source" && twist.is_some_and(|twist| twist.iter().any(|part| *part != 0.0))
    };
    // It may rest until it is touched, and move in another mode.
    let rests = |node: &&OutlinedBlock| {
        let mut constants = arm.modes.iter().flat_map(|mode| &mode.law.constants);
        constants.all(|constant| constant.node != node.name)
    };
    let node = upstream(mode, &arm.twist).into_iter().filter(moves).find(rests)?;
    let (name, own) = (&node.name, mode.mode?.name.as_str());
    let message = format!("mode `{own}` waits for a contact, but no projector passes the motion of `{name}`");
    let help = format!("select the components of `{name}` in this mode, or add its twist behind the projector");
    Some(Diagnostic::new(Code::NoApproach, mode.place(name, "twist"), message).help(help))
}

/// Returns the nodes that a port depends on.
fn upstream<'a>(mode: &ModeLaw<'a>, port: &str) -> Vec<&'a OutlinedBlock> {
    let mut open: Vec<&OutlinedBlock> = mode.nodes.writer(port).into_iter().collect();
    let (mut seen, mut found) = (BTreeSet::new(), Vec::new());
    while let Some(node) = open.pop() {
        if seen.insert(&*node.name) {
            found.push(node);
            open.extend(node.wires.iter().filter_map(|wire| mode.nodes.writer(&wire.source)));
        }
    }
    found
}

/// Returns the warning about a mode that rolls the sensor over an object while nothing controls the force.
fn rolling(arm: &Controlled<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let presses = |feature: &Feature| {
        let is_place = matches!(mode.quantity(feature), Some("x" | "y" | "offset" | "orientation"));
        // A force without a gain in any mode has its own warning.
        feature.column[2] != 0.0 && (feature.has_gain() || !arm.has_gain(feature)) && !is_place
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
        let is_place = matches!(mode.quantity(feature), Some("x" | "y" | "offset"));
        let i = rolls(&feature.column).filter(|_| is_place)?;
        Some((feature.name.clone(), i, mode.place_of_column(feature)))
    });
    let has_contact = || mode.exits("on_lost").next().is_some();
    // A generated motion, such as a sine.
    let generated = || {
        let mut composed = mode.law.guidance.iter().filter(|guide| guide.kind == "compose_twist" && has_contact());
        composed.find_map(|guide| {
            let i = [3, 4].into_iter().find(|i| guide.passes[*i])?;
            Some((guide.node().to_owned(), i, mode.nodes.node(guide.node())?.span.clone()))
        })
    };
    let constant = || {
        let is_still = mode.law.constants.iter().all(|constant| constant.twist[2] == 0.0);
        mode.law.constants.iter().filter(|_| is_still && has_contact()).find_map(|constant| {
            Some((constant.node.clone(), rolls(&constant.twist)?, mode.place(&constant.node, "twist")))
        })
    };
    feature.or_else(constant).or_else(generated)
}

/// Returns the warning about a position that a mode controls along a line, while it moves the sensor along this line.
///
/// A task that follows a line moves along it. Where the line is longer than the pad, the middle of its print is that of
/// the pad, and where it ends, the control of the position works against the motion.
fn along_line(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let positions = line_positions(mode);
    let along = |moves: &dyn Fn(usize) -> bool| {
        let mut axes = positions.iter().map(|axis| usize::from(*axis == "y"));
        !positions.is_empty() && axes.all(moves)
    };
    let mut constants = mode.law.constants.iter().filter(|constant| along(&|i| constant.twist[i] != 0.0));
    let is_guide =
        |guide: &&Guidance| LINE_GUIDES.contains(&&*guide.kind) && !mode.rests(guide) && along(&|i| guide.passes[i]);
    let guide = || mode.law.guidance.iter().find(is_guide).map(Guidance::node);
    let follower = constants.next().map(|constant| &*constant.node).or_else(guide)?;
    let held = |i: usize| {
        let axis = ["x", "y"][i];
        mode.moving().find(|feature| mode.quantity(feature) == Some(axis) && feature.column[i] != 0.0)
    };
    let feature = held(usize::from(positions[0] == "y")).filter(|_| along(&|i| held(i).is_some()))?;
    let message = format!(
        "{}`{}` is controlled along the line that `{}` follows: the middle of a long print says nothing about a position \
         along it",
        mode.named(),
        feature.name,
        follower
    );
    let help = match positions[..] {
        ["x", "y"] => {
            "let the setpoint of the angle turn the line along `x` or `y`, and control the position across it only"
                .to_owned()
        }
        [axis, ..] => format!("select 0 for `v{axis}` in the projector behind the column of `{}`", feature.name),
        [] => return None,
    };
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
pub(super) fn setpoint(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
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
        (_, Some((threshold, node)))
            if quantity == "pressure" && setpoint <= threshold && mode.releases().next().is_none() =>
        {
            (
                format!(
                    "the setpoint of `{name}` is {setpoint}, but `{node}` drops tactels below {threshold}: the contact is lost \
                 before it is reached"
                ),
                format!("write a setpoint well above {threshold}, for example {}", (3e6 * threshold).round() / 1e6),
            )
        }
        _ => return None,
    };
    let node = feature.compared.as_deref()?;
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place(node, &format!("setpoint.{name}")), message).help(help))
}

/// Returns the smallest value of a tactel that a feature counts, and the node that drops smaller ones.
fn least_felt<'a>(mode: &ModeLaw<'a>, feature: &Feature) -> Option<(f64, &'a str)> {
    let nodes = upstream(mode, feature.measured.as_deref()?);
    let node = nodes.into_iter().find(|node| node.kind.text == "binarize")?;
    let value = |key: &str| mode.nodes.number(node, key);
    Some((value("release").or_else(|| value("threshold"))?, &node.name))
}
