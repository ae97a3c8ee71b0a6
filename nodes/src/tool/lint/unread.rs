//! Contacts of a bench that cannot be read, so that no loop is checked over them.

use std::ops::Range;

use tactflow_runtime::graph::{NO_SPAN, Outline};
use tactflow_runtime::source::{Code, Diagnostic, Item, Value};

use crate::tool::control::contacts::contacts;

/// Returns the warning about the contacts of an arm.
pub(super) fn check(outline: &Outline, facts: &[(String, toml::Value)], arm: &str) -> Option<Diagnostic> {
    let why = contacts(facts, arm).err()?;
    let name = format!("{arm}.contacts");
    let value = outline.facts.iter().find(|(fact, _)| *fact == name).map(|(_, value)| value);
    let place = value.map_or(NO_SPAN, |value| place(&name, arm, value, &why));
    let message = format!("no loop of `{arm}` is checked over a contact, because its contacts cannot be read");
    Some(Diagnostic::new(Code::UnusualValue, place, message).help(why))
}

/// Returns the place of the mistake: the key that is not known, or the contact that cannot be read.
fn place(name: &str, arm: &str, value: &Value, why: &str) -> Range<usize> {
    let Item::Array(entries) = &value.item else { return value.span.clone() };
    let is_wrong = |entry: &&Value| {
        let alone = toml::Value::try_from(*entry).map(|entry| toml::Value::Array(vec![entry]));
        alone.is_ok_and(|alone| contacts(&[(name.to_owned(), alone)], arm).is_err())
    };
    let Some(entry) = entries.iter().find(is_wrong) else { return value.span.clone() };
    let unknown = why.split_once("unknown field `").and_then(|(_, rest)| rest.split_once('`'));
    unknown.and_then(|(key, _)| key_in(entry, key)).unwrap_or_else(|| entry.span.clone())
}

/// Returns the place of a key in a value.
fn key_in(value: &Value, wanted: &str) -> Option<Range<usize>> {
    let entries = &value.as_table()?.entries;
    let own = entries.iter().find(|(key, _)| key.name == wanted).map(|(key, _)| key.span.clone());
    own.or_else(|| entries.iter().find_map(|(_, value)| key_in(value, wanted)))
}
