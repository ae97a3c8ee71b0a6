//! What of the modes cannot be right as a whole: where they start, and which of them is never entered.

use std::collections::BTreeSet;
use std::ops::Range;

use super::{ModeBlock, PlannedMode};
use crate::diagnostic::{Code, Diagnostic, closest};
use crate::node::Word;

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
                let help = closest(&word.text, names(), "modes");
                found.push(Diagnostic::new(Code::UnknownMode, word.span.clone(), message).help(help));
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
pub(crate) fn unreachable(start: usize, blocks: &[ModeBlock], modes: &[PlannedMode], found: &mut Vec<Diagnostic>) {
    let (mut reached, mut open) = (BTreeSet::from([start]), vec![start]);
    while let Some(mode) = open.pop() {
        let next = modes[mode].exits.iter().filter_map(|exit| exit.to);
        open.extend(next.filter(|to| reached.insert(*to)).collect::<Vec<_>>());
    }
    for (i, block) in blocks.iter().enumerate().filter(|(i, _)| !reached.contains(i)) {
        let message = format!("mode `{}` is never entered", block.key.name);
        let help = format!("add `go = {{ to = \"{}\", … }}` to a mode, or take it out", modes[i].name);
        found.push(Diagnostic::new(Code::UnreachableMode, block.key.span.clone(), message).help(help));
    }
}
