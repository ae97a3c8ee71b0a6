//! Moves mistakes that show inside a built-in part to the user's file.
//!
//! A built-in part is right by itself, so what causes such a mistake is a wire into the part, or a parameter that the
//! graph should set.

use std::ops::Range;

use crate::graph::load::{FlatGraph, FlatNode};
use crate::source::{Diagnostic, Diagnostics, SourceMap};

/// Moves each diagnostic in a built-in part to the block of the part, with the key that sets the wrong parameter.
pub(crate) fn move_out(flat: &FlatGraph, sources: &SourceMap, diagnostics: Diagnostics) -> Diagnostics {
    let is_builtin = |span: &Range<usize>| sources.file_at(span.start).is_builtin();
    let moved = diagnostics.into_iter().map(|diagnostic| {
        if !is_builtin(&diagnostic.span) {
            return diagnostic;
        }
        let node = node_at(flat, sources, &diagnostic);
        let moved = node.and_then(|node| Some((node, outermost(flat, node, &is_builtin)?)));
        match moved {
            Some((node, (part, path))) => at_part(diagnostic, node, part, &path),
            None => diagnostic,
        }
    });
    moved.collect()
}

/// Returns the node whose block contains the place of a diagnostic: the last one that starts before it in the same file.
///
/// Several parts may have the same file. Then it is the node of the part of which the message names a node first.
fn node_at<'f>(flat: &'f FlatGraph, sources: &SourceMap, diagnostic: &Diagnostic) -> Option<&'f FlatNode> {
    let Diagnostic { span, message, .. } = diagnostic;
    let file = sources.file_at(span.start).span();
    let start = |node: &FlatNode| node.block.key.span.start;
    let starts = |node: &&FlatNode| file.contains(&start(node)) && start(node) <= span.start;
    let last = flat.nodes.iter().filter(starts).map(start).max()?;
    let named = |node: &&FlatNode| {
        let part = &node.name[..node.name.len() - node.block.key.name.len()];
        message.find(&format!("`{part}")).unwrap_or(usize::MAX)
    };
    flat.nodes.iter().filter(|node| start(node) == last).min_by_key(named)
}

/// Returns the place of the innermost part around a node that is written in the user's file, and the path from it to
/// the node.
fn outermost(
    flat: &FlatGraph,
    node: &FlatNode,
    is_builtin: &dyn Fn(&Range<usize>) -> bool,
) -> Option<(Range<usize>, String)> {
    let (mut scope, mut path) = (&flat.scopes[node.scope], node.block.key.name.clone());
    loop {
        let part = scope.part.as_ref()?;
        if !is_builtin(&part.span) {
            return Some((part.span.clone(), path));
        }
        path = format!("{}.{path}", part.name);
        scope = &flat.scopes[scope.parent?];
    }
}

fn at_part(diagnostic: Diagnostic, node: &FlatNode, part: Range<usize>, path: &str) -> Diagnostic {
    let Diagnostic { code, message, span, notes, help, .. } = diagnostic;
    let params = node.block.params.as_table().into_iter().flat_map(|table| &table.entries);
    let holds = |value: &Range<usize>| value.start <= span.start && span.end <= value.end;
    let param = params.into_iter().find(|(key, value)| holds(&value.span) || holds(&key.span));
    let set = param.map(|(key, _)| format!("set it in this block with the key `set.{path}.{}`", key.name));
    let help: Vec<String> = help.into_iter().chain(set).collect();
    let mut moved = Diagnostic::new(code, part, message).note(span, "the part uses it here");
    moved.notes.extend(notes);
    moved.with_help((!help.is_empty()).then(|| help.join("\n")))
}
