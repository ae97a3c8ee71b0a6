//! A mode that waits for a contact, and that nothing moves.

use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::source::{Code, Diagnostic};

use super::arm::Arm;
use super::mode_law::ModeLaw;

/// Returns the warning about a mode that waits for a contact, and whose constant motion no projector passes.
pub(super) fn check(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
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
