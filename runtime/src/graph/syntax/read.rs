//! Reads tables, words and keys: what the sections have in common.

use crate::node::{At, Mistake, Reader};
use crate::source::{Code, Item, Table, Value, suggestion};

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
    found.or_else(|| reader.wrong_type(value, expects))
}

/// Reports each key of a table that is not `known`. `place` ends the message, for example ` in a mode`.
pub(super) fn check_keys(table: &Table, known: &[&str], place: &str, reader: &mut Reader<'_>) {
    for (key, _) in table.entries.iter().filter(|(key, _)| !known.contains(&key.name.as_str())) {
        let message = format!("unknown key `{}`{place}", key.name);
        let help = suggestion(&key.name, known.iter().copied(), "keys");
        reader.mistakes.push(Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message).help(help));
    }
}
