//! Checks that the graph has a start mode, and that every mode can be reached from it.

use std::collections::BTreeSet;

use crate::graph::load::FlatGraph;
use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Item, Value};

/// Reports modes that are never entered, and returns the index of the start mode.
///
/// Returns `None` for a graph without modes.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) -> Option<usize> {
    let start = find_start(net, diagnostics)?;
    let modes = &net.flat.modes;
    let reached = reachable(start, net.flat);
    for (_, mode) in modes.iter().enumerate().filter(|(i, _)| !reached.contains(i)) {
        let name = &mode.key.name;
        let message = format!("mode `{name}` is never entered");
        let help = format!("add `go = {{ to = \"{name}\", … }}` to another mode, or remove this mode");
        diagnostics.push(Diagnostic::new(Code::UnreachableMode, mode.key.span.clone(), message).help(help));
    }
    Some(start)
}

fn find_start(net: &Net<'_>, diagnostics: &mut Diagnostics) -> Option<usize> {
    let mut names = net.flat.mode_names();
    let Some(word) = net.flat.table.as_ref().and_then(|table| table.start.as_ref()) else {
        let help = format!("add `start = \"{}\"` under [graph]", names.next()?);
        let message = "the graph has modes but no start mode";
        diagnostics.push(Diagnostic::new(Code::MissingKey, net.flat.place.clone(), message).help(help));
        return None;
    };
    let start = names.clone().position(|name| name == word.value);
    if start.is_none() {
        diagnostics.push(Diagnostic::unknown(Code::UnknownMode, "mode", &word.value, &word.span, names));
    }
    start
}

/// Returns the modes that can be reached from the start mode.
fn reachable(start: usize, flat: &FlatGraph) -> BTreeSet<usize> {
    let (modes, numbers) = (&flat.modes, flat.mode_numbers());
    let (mut reached, mut open) = (BTreeSet::from([start]), vec![start]);
    while let Some(mode) = open.pop() {
        // The written targets count, so that a mistake in an exit does not make its target unreachable too.
        let mut names = Vec::new();
        modes[mode].table.entries.iter().for_each(|(_, value)| collect_targets(value, &mut names));
        let next = names.iter().filter_map(|to| numbers.get(to).copied());
        open.extend(next.filter(|to| reached.insert(*to)));
    }
    reached
}

/// Collects the target modes of the exits in a value.
fn collect_targets<'v>(value: &'v Value, names: &mut Vec<&'v str>) {
    match &value.item {
        Item::Array(items) => items.iter().for_each(|item| collect_targets(item, names)),
        Item::Table(table) => names.extend(table.get("to").and_then(Value::as_str)),
        _ => {}
    }
}
