//! Columns behind a mount that turns them, and over contacts that answer along another axis than geometry says.

use super::variant::{Variant, variant};

/// The pose of a mount that is turned by half a turn about z.
const MOUNT: [&str; 4] = [
    "set nodes.mount.type=\"static_pose\"",
    "set nodes.mount.rpy=[0, 0, 3.14159265]",
    "set nodes.turned.type=\"adjoint\"",
    "set nodes.turned.in.pose=\"mount.pose\"",
];
/// Columns that are right behind it.
const TURNED: [&str; 2] = ["columns.x = [1, 0, 0, 0, 0, 0]", "columns.y = [0, 1, 0, 0, 0, 0]"];
/// The same for half a turn about x.
const FLIPPED: [&str; 4] = [
    "set nodes.mount.rpy=[3.14159265, 0, 0]",
    "columns.y = [0, 1, 0, 0, 0, 0]",
    "columns.pressure = [0, 0, -1, 0, 0, 0]",
    "set modes.approach.set.reach.twist=[0, 0, -0.008, 0, 0, 0]",
];
/// The mount before the sum, behind it, and directly before the limits.
const PLACES: [&[&str]; 3] = [
    &["set nodes.turned.in.twist=\"projector.twist\"", "set nodes.sum.in.touch=\"turned.twist\""],
    &["set nodes.turned.in.twist=\"sum.twist\"", "set nodes.damping.in.twist=\"turned.twist\""],
    &["set nodes.turned.in.twist=\"damping.twist\"", "set parts.move.in.twist=\"turned.twist\""],
];
/// The inverse of the pose of the mount, and twice this pose.
const INVERSE: [&str; 3] = [
    "set nodes.back.type=\"inverse_pose\"",
    "set nodes.back.in.pose=\"mount.pose\"",
    "set nodes.turned.in.pose=\"back.pose\"",
];
const TWICE: [&str; 4] = [
    "set nodes.twice.type=\"compose_poses\"",
    "set nodes.twice.in.outer=\"mount.pose\"",
    "set nodes.twice.in.inner=\"mount.pose\"",
    "set nodes.turned.in.pose=\"twice.pose\"",
];
/// A node between the features and the sum that passes on their motion.
const GUARD: [&str; 6] = [
    "set nodes.guard.type=\"edge_guard\"",
    "set nodes.guard.in.twist=\"projector.twist\"",
    "set nodes.guard.in.x=\"touch.x\"",
    "set nodes.guard.in.y=\"touch.y\"",
    "set nodes.guard.in.image=\"touch.image\"",
    "set nodes.sum.in.touch=\"guard.twist\"",
];
/// A bench that has measured that the places answer along the other axis.
const EXCHANGED: &str =
    "set facts.arm.contacts=[{ object = \"ball\", latency_ms = 4.0, x = { vy = -1.0 }, y = { vx = 1.0 } }]";

/// The motion of the features passes a mount that is turned by half a turn about z.
pub(super) fn half_turn() -> Vec<&'static str> {
    [&MOUNT[..], PLACES[0]].concat()
}

pub(super) fn poor_mounts() -> Vec<(&'static str, Variant)> {
    let turned = PLACES.iter().map(|place| variant("hybrid", &[&MOUNT[..], place].concat()));
    let quarter = "set nodes.mount.rpy=[0, 0, 1.5707963]";
    let others = [
        variant("hybrid", &[&half_turn()[..], &[quarter]].concat()),
        variant("hybrid", &[&half_turn()[..], &INVERSE].concat()),
        variant("hybrid", &[&half_turn()[..], &[quarter], &TWICE].concat()),
        variant("hybrid", &[&GUARD[..], &["columns.x = [1, 0, 0, 0, 20, 0]"]].concat()),
        variant("hybrid", &[EXCHANGED, "columns.x = [0, 1, 0, 0, 0, 0]", "columns.y = [1, 0, 0, 0, 0, 0]"]),
        // A bench that states how far the contact sticks says nothing of an axis.
        variant(
            "hybrid",
            &[
                "set facts.arm.contacts=[{ object = \"ball\", x = { play = 0.001 } }]",
                "columns.x = [0, -1, 0, 20, 0, 0]",
            ],
        ),
    ];
    turned.chain(others).map(|variant| ("wrong-column", variant)).collect()
}

pub(super) fn good_mounts() -> Vec<Variant> {
    let quarter = "set nodes.mount.rpy=[0, 0, 1.5707963]";
    let turned = PLACES.iter().map(|place| variant("hybrid", &[&MOUNT[..], place, &TURNED].concat()));
    let others = [
        variant("hybrid", &GUARD),
        variant("hybrid", &[&half_turn()[..], &INVERSE, &TURNED].concat()),
        variant("hybrid", &[&half_turn()[..], &[quarter], &TWICE, &TURNED].concat()),
        // Turned about x, so that the approach moves along -z before the mount.
        variant("hybrid", &[&MOUNT[..], PLACES[1], &FLIPPED].concat()),
        variant("hybrid", &[EXCHANGED, "columns.x = [0, -1, 0, 0, 0, 0]", "columns.y = [1, 0, 0, 0, 0, 0]"]),
    ];
    turned.chain(others).collect()
}
