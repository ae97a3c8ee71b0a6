//! What the nodes that guide an arm by a law of their own do with it, by their types.

use crate::tool::control::law::Guidance;
use crate::tool::control::nodes::{Nodes, source};

/// Types that guide the sensor along the object, and do not press.
const LIGHT: [&str; 6] = ["scan_guide", "ridge_guide", "hold_pose", "follow_path", "follow_surface", "park"];
/// Types that guide the sensor along a line.
const ALONG_LINES: [&str; 2] = ["ridge_guide", "follow_path"];

/// Returns whether a node may move the sensor into the object.
pub(super) fn may_press(guide: &Guidance) -> bool {
    guide.passes[2] && !LIGHT.contains(&&*guide.kind)
}

/// Returns whether a node follows a line.
pub(super) fn follows_line(guide: &Guidance) -> bool {
    ALONG_LINES.contains(&&*guide.kind)
}

/// Returns whether a node makes a twist of scalars, such as a sine.
pub(super) fn is_composed(guide: &Guidance) -> bool {
    guide.kind == "compose_twist"
}

/// Returns whether a node rolls the sensor over a surface, or lets somebody roll it during a contact.
pub(super) fn rolls_along(nodes: &Nodes<'_>, guide: &Guidance) -> bool {
    let lets_roll = || {
        let node = nodes.node(guide.node()).filter(|_| guide.kind == "guidance")?;
        let is_open = source(node, "gate").is_none_or(|gate| nodes.is_open_in_contact(gate));
        Some(is_open && nodes.number(node, "angular_rad_per_s") != Some(0.0))
    };
    guide.kind == "follow_surface" || lets_roll() == Some(true)
}

/// Returns whether a node moves the sensor away from the object to its place of rest. Its gate may be closed.
pub(super) fn parks(nodes: &Nodes<'_>, guide: &Guidance) -> bool {
    guide.kind == "park" && guide.passes[2] && !rests(nodes, guide)
}

/// Returns whether a node has a speed of 0 in this mode.
pub(super) fn rests(nodes: &Nodes<'_>, guide: &Guidance) -> bool {
    let node = nodes.node(guide.node());
    node.and_then(|node| nodes.number(node, "speed_m_per_s")) == Some(0.0)
}

/// Returns the components in which a node holds the sensor at a place; `None` if it holds none, or if its gate may be closed
/// during a contact.
pub(super) fn holds(nodes: &Nodes<'_>, guide: &Guidance) -> Option<[bool; 6]> {
    let node = nodes.node(guide.node())?;
    let moves = |key: &str| nodes.number(node, key).is_some_and(|speed| speed > 0.0);
    let (linear, angular) = (moves("speed_m_per_s"), moves("speed_rad_per_s"));
    match guide.kind.as_str() {
        "hold_pose" if source(node, "gate").is_none_or(|gate| nodes.is_open_in_contact(gate)) => {
            Some(std::array::from_fn(|i| if i < 3 { linear } else { angular }))
        }
        "follow_path" => {
            // A path in the plane of the pad leaves z to the control of the force.
            let is_in_plane = nodes.value(node, "in_plane").and_then(|value| value.value.read()).unwrap_or(false);
            Some([linear, linear, linear && !is_in_plane, false, false, false])
        }
        _ => None,
    }
}
