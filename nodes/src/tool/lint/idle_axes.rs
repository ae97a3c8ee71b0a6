//! Components that a projector selects and that nothing moves.

use std::collections::BTreeSet;

use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit, Item};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::motion::COMPONENTS;
use crate::tool::control::collect::{law, projectors};
use crate::tool::control::law::Law;
use crate::tool::control::nodes::source;

/// Returns the warnings about components that a projector selects and that nothing moves.
pub(super) fn check<'a>(arm: &Arm<'a>, mode: &ModeLaw<'a>) -> Diagnostics {
    let all = projectors(&mode.nodes, &arm.twist);
    all.into_iter().flat_map(|projector| idle_axes(arm, mode, projector, &dropped(arm, mode, projector))).collect()
}

/// Returns the components that all readers of a projector drop.
fn dropped(arm: &Arm<'_>, mode: &ModeLaw<'_>, projector: &OutlinedBlock) -> [bool; 6] {
    let twist = projector.outputs.first().map(|port| &port.name);
    let reads = |node: &&OutlinedBlock| node.wires.iter().any(|wire| Some(&wire.source) == twist);
    let select = |node: &OutlinedBlock| {
        let select = mode.nodes.value(node, "select").filter(|_| node.kind.text == "projector");
        select.and_then(|select| select.value.read::<[f64; 6]>()).unwrap_or([1.0; 6])
    };
    let readers: Vec<[f64; 6]> = arm.outline.nodes.iter().filter(reads).map(select).collect();
    std::array::from_fn(|i| !readers.is_empty() && readers.iter().all(|select| select[i] == 0.0))
}

fn idle_axes<'a>(arm: &Arm<'a>, mode: &ModeLaw<'a>, projector: &'a OutlinedBlock, dropped: &[bool; 6]) -> Diagnostics {
    let select = mode.nodes.value(projector, "select");
    let behind = source(projector, "twist").map(|twist| law(&mode.nodes, twist));
    let Some((setting, behind)) = select.zip(behind) else { return Diagnostics::new() };
    let Some(select) = setting.value.read::<[f64; 6]>() else { return Diagnostics::new() };
    // A projector that passes all components makes no choice.
    let selects_all = select.iter().all(|entry| *entry != 0.0);
    if selects_all || !behind.guidance.is_empty() || behind.features.is_empty() {
        return Diagnostics::new();
    }
    // A component without a motion here may be selected for that of another mode.
    let twist = source(projector, "twist").unwrap_or_default();
    let laws: Vec<Law> = arm.modes.iter().map(|mode| law(&mode.nodes, twist)).collect();
    let is_driven = |i: usize| laws.iter().flat_map(|law| &law.constants).any(|constant| constant.twist[i] != 0.0);
    let columns = || laws.iter().flat_map(|law| &law.features).map(|feature| &feature.column);
    let moves = |i: usize| columns().any(|column| column[i] != 0.0) || is_driven(i);
    let is_idle = |i: &usize| select[*i] != 0.0 && !dropped[*i] && !moves(*i);
    let jacobians: BTreeSet<&str> = behind.features.iter().map(|feature| &*feature.jacobian).collect();
    let jacobians: Vec<String> = jacobians.into_iter().map(|name| format!("`{name}`")).collect();
    let report = |i: usize| {
        let name = COMPONENTS[i];
        let entry = match &setting.value.item {
            Item::Array(entries) => entries.get(i),
            _ => None,
        };
        let place = entry.map_or_else(|| setting.value.span.clone(), |entry| entry.span.clone());
        let (projector, jacobians) = (&projector.name, jacobians.join(" and "));
        let message = format!("`{projector}` selects `{name}`, but no column of {jacobians} moves it");
        let help = format!("write 0 for `{name}`, or add an entry to the column of the feature that it should control");
        let diagnostic = Diagnostic::new(Code::IdleAxis, place.clone(), message).help(help);
        match entry {
            Some(_) => diagnostic.edit(Edit::Replace(place, "0".into())),
            None => diagnostic,
        }
    };
    (0..6).filter(is_idle).map(report).collect()
}
