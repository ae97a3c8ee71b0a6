//! A mode that rolls the sensor over an object while nothing controls the force.

use std::ops::Range;

use tactflow_runtime::source::{Code, Diagnostic};

use super::arm::Arm;
use super::guides::{is_composed, may_press, rolls_along};
use super::mode_law::ModeLaw;
use crate::motion::COMPONENTS;
use crate::tool::control::law::{Feature, Guidance};

/// Returns the warning about a mode that rolls the sensor over an object while nothing controls the force.
pub(super) fn check(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let presses = |feature: &Feature| {
        let is_place = matches!(mode.quantity(feature), Some("x" | "y" | "offset" | "orientation"));
        // A force without a gain in any mode has its own warning.
        feature.column[2] != 0.0 && (feature.has_gain() || !arm.has_gain(feature)) && !is_place
    };
    if mode.law.features.iter().any(presses) || mode.law.guidance.iter().any(may_press) {
        return None;
    }
    let (name, i, place) = roller(mode)?;
    let message = format!(
        "{}`{name}` rolls the sensor with `{}`, but no feature of the force moves `vz`: the pad loses the contact, or presses \
         harder and harder",
        mode.prefix(),
        COMPONENTS[i]
    );
    let help = "control the pressure along `vz` in this mode, or let nothing roll: select 0 for `wx` and `wy` of all that moves \
                the sensor";
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
    let is_still = mode.law.constants.iter().all(|constant| constant.twist[2] == 0.0);
    let has_contact = || mode.exits("on_lost").next().is_some();
    // A generated motion, such as a sine, or a motion over a surface.
    let generated = || {
        let rolls = |guide: &&Guidance| rolls_along(&mode.nodes, guide) && is_still;
        let is_roller = |guide: &&Guidance| (rolls(guide) || is_composed(guide)) && has_contact();
        mode.law.guidance.iter().filter(is_roller).find_map(|guide| {
            let i = [3, 4].into_iter().find(|i| guide.passes[*i])?;
            Some((guide.node().to_owned(), i, mode.nodes.node(guide.node())?.span.clone()))
        })
    };
    let constant = || {
        mode.law.constants.iter().filter(|_| is_still && has_contact()).find_map(|constant| {
            Some((constant.node.clone(), rolls(&constant.twist)?, mode.place(&constant.node, "twist")))
        })
    };
    feature.or_else(constant).or_else(generated)
}
