//! Checks that no condition watches a port that is absent in its mode.

use std::collections::BTreeMap;

use crate::graph::plan::{Condition, PlannedMode, PortRef, Producer, Test, WatchedPort};
use crate::graph::syntax::PortState;
use crate::node::Components;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports each condition on a port that is absent because nothing reads it in its mode.
///
/// `reads` returns the components that a mode reads of a node's port. `freezes` holds which nodes make unused components
/// absent.
pub(crate) fn check(
    modes: &[PlannedMode],
    reads: &dyn Fn(usize, usize, usize) -> Components,
    freezes: &BTreeMap<usize, bool>,
    diagnostics: &mut Diagnostics,
) {
    for (number, mode) in modes.iter().enumerate() {
        for exit in &mode.exits {
            let (Condition::Port(watched, _) | Condition::Lost(watched, _)) = &exit.condition else { continue };
            let WatchedPort { source: PortRef { producer: Producer::Node(node), port }, feature } = *watched else {
                continue;
            };
            let read = reads(number, node, port);
            let is_read = feature.map_or(!read.is_empty(), |feature| read.has(feature));
            if is_read || !freezes.get(&node).copied().unwrap_or(false) {
                continue;
            }
            let what = if matches!(exit.condition, Condition::Port(_, Test::Is(PortState::Absent))) {
                "always"
            } else {
                "never"
            };
            let name = exit.text.split('`').nth(1).unwrap_or_default();
            let message = format!(
                "nothing reads `{name}` in mode `{}`, so it is absent there and this condition {what} holds",
                mode.name
            );
            let help = "select the feature in this mode, or watch a port upstream of it";
            diagnostics.push(Diagnostic::new(Code::AbsentPort, exit.span.clone(), message).help(help));
        }
    }
}
