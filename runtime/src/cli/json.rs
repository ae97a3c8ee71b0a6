//! Diagnostics, places and values for a program.

use std::ops::Range;

use serde::Serialize;

use crate::source::{Diagnostic, Report};
use crate::source::{Item, SourceMap, Value};

/// A diagnostic with its place.
#[derive(Debug, Serialize)]
pub(super) struct Diagnosed {
    severity: &'static str,
    code: &'static str,
    message: String,
    #[serde(flatten)]
    place: Place,
    help: Option<String>,
    notes: Vec<Note>,
}

/// A place in a file.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(super) struct Place {
    file: String,
    /// From 1.
    line: usize,
    /// From 1, in characters.
    column: usize,
    /// In characters.
    length: usize,
}

#[derive(Debug, Serialize)]
struct Note {
    message: String,
    #[serde(flatten)]
    place: Place,
}

/// All diagnostics of a report, in its order.
pub(super) fn diagnosed(report: &Report) -> Vec<Diagnosed> {
    let one = |diagnostic: &Diagnostic| Diagnosed {
        severity: diagnostic.code.severity().name(),
        code: diagnostic.code.name(),
        message: diagnostic.message.clone(),
        place: place(&report.sources, &diagnostic.span),
        help: diagnostic.help.clone(),
        notes: diagnostic
            .notes
            .iter()
            .map(|(span, message)| Note { message: message.clone(), place: place(&report.sources, span) })
            .collect(),
    };
    report.diagnostics.iter().map(one).collect()
}

/// Where a span stands.
pub(super) fn place(sources: &SourceMap, span: &Range<usize>) -> Place {
    let file = sources.file_at(span.start);
    let (line, column) = file.line_column(span.start);
    let length = file.text[file.local(span)].chars().count();
    Place { file: file.name.clone(), line, column, length }
}

/// A value of a graph file.
pub(super) fn json(value: &Value) -> serde_json::Value {
    match &value.item {
        Item::String(text) | Item::Datetime(text) => text.as_str().into(),
        Item::Integer(number) => (*number).into(),
        Item::Float(number) => (*number).into(),
        Item::Boolean(value) => (*value).into(),
        Item::Array(items) => items.iter().map(json).collect(),
        Item::Table(table) => table.entries.iter().map(|(key, value)| (key.name.clone(), json(value))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_place_counts_characters() {
        let mut sources = SourceMap::default();
        sources.add_file(Path::new("a.toml"), "x = 1\n");
        let base = sources.add_file(Path::new("b.toml"), "y = 2\nµ = \"é\"\n").base;
        let expected = Place { file: "b.toml".into(), line: 2, column: 5, length: 3 };
        assert_eq!(place(&sources, &(base + 11..base + 15)), expected);
    }
}
