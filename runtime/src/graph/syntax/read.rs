//! Reads tables and words: what the sections have in common.

use crate::node::Reader;
use crate::source::{Item, Table, Value};

/// Reads a table; one that is missing or invalid is empty.
pub(super) fn read_table(value: Option<&Value>, reader: &mut Reader<'_>) -> Table {
    let read = |value: &Value| value.as_table().cloned().or_else(|| reader.wrong_type(value, "a table"));
    value.and_then(read).unwrap_or_default()
}

/// Reads one of a few words; `expects` lists them for a message. `true` and `false` are words too.
pub(super) fn read_word<T: Copy>(
    value: &Value,
    words: &[(&str, T)],
    expects: &str,
    reader: &mut Reader<'_>,
) -> Option<T> {
    let word = match &value.item {
        Item::Boolean(true) => "true",
        Item::Boolean(false) => "false",
        _ => value.as_str().unwrap_or_default(),
    };
    let found = words.iter().find(|(known, _)| *known == word).map(|(_, meaning)| *meaning);
    found.or_else(|| reader.unknown_word(value, words.iter().map(|(known, _)| *known), expects))
}
