//! Places the mistakes of nodes and devices: each in its block, its wires or a data file.

use std::ops::Range;

use crate::graph::syntax::WireEntry;
use crate::node::Mistake;
use crate::source::{Code, Diagnostic, Diagnostics, Item, SourceMap, Value};

/// Converts the mistakes of a node or device into diagnostics, with spans in its block, its wires or a data file.
pub(crate) fn place_mistakes(
    mistakes: Vec<Mistake>,
    block: &Value,
    wires: &[WireEntry],
    sources: &mut SourceMap,
    diagnostics: &mut Diagnostics,
) {
    use crate::node::At;
    for Mistake { code, at, message, help, instead } in mistakes {
        let mut notes = Vec::new();
        let span = match at {
            At::Span(span) => span,
            At::Node => block.span.clone(),
            At::Param(path) => find_spans(block, &path).map_or(block.span.clone(), |(_, value)| value),
            At::Key(path) => find_spans(block, &path).map_or(block.span.clone(), |(key, _)| key),
            At::Input(name) => {
                wires.iter().find(|wire| wire.key.name == name).map_or(&block.span, |wire| &wire.from.span).clone()
            }
            At::Data { file, text, span } => {
                notes.push((file.span.clone(), "the file is named here".to_owned()));
                let base = sources.add_file(&file.path, &*text).base;
                base + span.start..base + span.end
            }
        };
        let diagnostic = Diagnostic { notes, ..Diagnostic::new(code, span, message).with_help(help) };
        diagnostics.push(match instead {
            Some(names) => misspelt_wire(&diagnostic, wires, (&names.0, &names.1), sources).unwrap_or_else(|| {
                let help = diagnostic.help.clone();
                diagnostic.instead(&names.0, &names.1).with_help(help)
            }),
            None => diagnostic,
        });
    }
}

/// Returns the diagnostic of a wire whose name, which is `best`, is misspelt, and not the `name` that a parameter has.
fn misspelt_wire(
    diagnostic: &Diagnostic,
    wires: &[WireEntry],
    (name, best): (&str, &str),
    sources: &SourceMap,
) -> Option<Diagnostic> {
    let wire = wires.iter().find(|wire| wire.key.name == best)?;
    let is_rarer = sources.occurrences(best) == 1 && sources.occurrences(name) > 1;
    let message = format!("the parameters name `{name}`, and no wire is called so");
    let wrong = Diagnostic::new(Code::UnknownInput, wire.key.span.clone(), message);
    is_rarer.then(|| wrong.note(diagnostic.span.clone(), "it is named here").instead(best, name))
}

/// Returns the spans of the key and of the value at a dotted path. An entry of a list is named by its number, from 0.
fn find_spans(block: &Value, path: &str) -> Option<(Range<usize>, Range<usize>)> {
    let mut value = block;
    let mut key = block.span.clone();
    for name in path.split('.') {
        (key, value) = match &value.item {
            Item::Array(items) => {
                let item = items.get(name.parse::<usize>().ok()?)?;
                (item.span.clone(), item)
            }
            _ => {
                let (entry_key, inner) = value.as_table()?.entry(name)?;
                (entry_key.span.clone(), inner)
            }
        };
    }
    Some((key, value.span.clone()))
}
