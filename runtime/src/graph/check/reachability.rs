//! What of the modes cannot be right as a whole: where they start, and which of them is never entered.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::syntax::ModeBlock;
use crate::node::Word;
use crate::source::{Code, Diagnostic, Item, Value};

/// The mode that the graph starts in; nothing for a graph without modes.
pub(crate) fn start(
    start: Option<&Word>,
    place: &Range<usize>,
    modes: &[ModeBlock],
    found: &mut Vec<Diagnostic>,
) -> Option<usize> {
    let names = || modes.iter().map(|mode| mode.key.name.as_str());
    match start {
        Some(word) => {
            let at = names().position(|name| name == word.text);
            if at.is_none() {
                let message = format!("there is no mode `{}` to start in", word.text);
                found.push(Diagnostic::new(Code::UnknownMode, word.span.clone(), message).suggest(
                    &word.text,
                    names(),
                    "modes",
                ));
            }
            at
        }
        None => {
            let first = names().next()?;
            let message = "the graph has modes, and does not say where it starts";
            let help = format!("add `start = \"{first}\"` under [graph]");
            found.push(Diagnostic::new(Code::MissingKey, place.clone(), message).help(help));
            None
        }
    }
}

/// Modes that no way leads to from the start.
pub(crate) fn unreachable(start: usize, modes: &[ModeBlock], found: &mut Vec<Diagnostic>) {
    let (mut reached, mut open) = (BTreeSet::from([start]), vec![start]);
    while let Some(mode) = open.pop() {
        // By their names: a way that has a mistake of its own leads there all the same.
        let mut names = Vec::new();
        modes[mode].table.entries.iter().for_each(|(_, value)| targets(value, &mut names));
        let next = names.iter().filter_map(|to| modes.iter().position(|mode| mode.key.name == **to));
        open.extend(next.filter(|to| reached.insert(*to)).collect::<Vec<_>>());
    }
    for (_, mode) in modes.iter().enumerate().filter(|(i, _)| !reached.contains(i)) {
        let name = &mode.key.name;
        let message = format!("mode `{name}` is never entered");
        let help = format!("add `go = {{ to = \"{name}\", … }}` to a mode, or take it out");
        found.push(Diagnostic::new(Code::UnreachableMode, mode.key.span.clone(), message).help(help));
    }
}

/// What is written behind every `to` of a value.
fn targets<'v>(value: &'v Value, names: &mut Vec<&'v str>) {
    match &value.item {
        Item::Array(items) => items.iter().for_each(|item| targets(item, names)),
        Item::Table(table) => names.extend(table.get("to").and_then(Value::as_str)),
        _ => {}
    }
}
