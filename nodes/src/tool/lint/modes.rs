//! Modes: rolling without force control, and an approach without a motion.

use std::ops::Range;

use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::motion::COMPONENTS;
use crate::tool::control::law::Feature;

/// Nodes that guide the sensor along the object, and do not press.
pub(super) const GUIDES: [&str; 6] =
    ["scan_guide", "ridge_guide", "hold_pose", "follow_path", "follow_surface", "park"];

pub(super) fn check(arm: &Arm<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(rolling(arm, mode));
        found.extend(motionless(arm, mode));
    }
}

/// Returns the warning about a mode that waits for a contact, and whose constant motion no projector passes.
fn motionless(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
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
    let node = mode.nodes.upstream(&arm.twist).into_iter().filter(moves).find(rests)?;
    let (name, own) = (&node.name, mode.mode?.name.as_str());
    let message = format!("mode `{own}` waits for a contact, but no projector passes the motion of `{name}`");
    let help = format!("select the components of `{name}` in this mode, or add its twist behind the projector");
    Some(Diagnostic::new(Code::NoApproach, mode.place(name, "twist"), message).help(help))
}

/// Returns the warning about a mode that rolls the sensor over an object while nothing controls the force.
fn rolling(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
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
