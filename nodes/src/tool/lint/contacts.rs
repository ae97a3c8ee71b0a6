//! Contacts of a bench that cannot be read, or that name a feature otherwise than its port: no loop is checked over them.

use std::ops::Range;

use tactflow_runtime::graph::{NO_SPAN, Outline};
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit, Item, Key, Table, Value, suggest_name};

use super::arm::Arm;
use crate::tool::control::contacts::{Contact, contacts, wrong_point};
use crate::tool::control::law::Feature;

/// Returns the warning about the contacts of an arm that cannot be read, and why.
pub(super) fn unreadable(outline: &Outline, arm: &str, why: String) -> Diagnostic {
    let name = format!("{arm}.contacts");
    let value = outline.facts.iter().find(|(fact, _)| *fact == name).map(|(_, value)| value);
    let read = |value: &Value| {
        let fact = toml::Value::try_from(value).map(|value| [(name.clone(), value)]);
        fact.map_or(Ok(()), |fact| contacts(&fact, arm).map(drop))
    };
    let whole = value.map_or(NO_SPAN, |value| value.span.clone());
    let (place, why) = value.and_then(|value| wrong(value, &read)).unwrap_or((whole, why));
    let message = format!("no loop of `{arm}` is checked over a contact, because its contacts cannot be read");
    Diagnostic::new(Code::UnusualValue, place, message).help(why)
}

/// Returns the warnings about features that the contacts of an arm call otherwise than their ports are called: as the
/// graph calls them, or misspelt.
pub(super) fn misnamed(arm: &Arm<'_>) -> Diagnostics {
    let (outline, fact) = (arm.outline, format!("{}.contacts", arm.name));
    let Some((_, value)) = outline.facts.iter().find(|(name, _)| *name == fact) else { return Diagnostics::new() };
    let is_port = |name: &str| {
        let mut ports = outline.nodes.iter().flat_map(|node| &node.outputs);
        ports.any(|port| port.name.rsplit('.').next() == Some(name))
    };
    let features = || arm.modes.iter().flat_map(|mode| mode.moving());
    let meant = |key: &str, contact: &Contact| {
        let own = features().find(|one| one.name == key).and_then(Feature::quantity);
        let near = suggest_name(key, features().filter_map(Feature::quantity)).filter(|_| !key.is_empty());
        own.or(near).filter(|quantity| !contact.features.contains_key(*quantity))
    };
    let entries = match &value.item {
        Item::Array(entries) => &entries[..],
        _ => &[],
    };
    let contacts = arm.contacts.iter().zip(entries);
    let each = contacts.flat_map(|(contact, entry)| contact.features.keys().map(move |key| (key, contact, entry)));
    let found = each.filter(|(key, ..)| !is_port(key)).filter_map(|(key, contact, entry)| {
        let (quantity, place) = (meant(key, contact)?, key_in(entry, key)?);
        let message =
            format!("no port is called `{key}`, so no loop is checked with this answer of `{}`", contact.object);
        let help = format!("a contact names the port that is measured: write `{quantity}`");
        let edit = Edit::Replace(place.clone(), quantity.to_owned());
        Some(Diagnostic::new(Code::UnusualValue, place, message).help(help).edit(edit))
    });
    found.collect()
}

/// Returns the first contact that cannot be read, with the place of the mistake in it and why.
fn wrong(value: &Value, read: &impl Fn(&Value) -> Result<(), String>) -> Option<(Range<usize>, String)> {
    let Item::Array(entries) = &value.item else { return None };
    let alone = |entry: &Value| Value { item: Item::Array(vec![entry.clone()]), span: value.span.clone() };
    let (entry, why) = entries.iter().find_map(|entry| Some((entry, read(&alone(entry)).err()?)))?;
    let unknown = why.split_once("unknown field `").and_then(|(_, rest)| rest.split_once('`'));
    let key = unknown.and_then(|(key, _)| key_in(entry, key));
    let is_wrong = |entry: &Value| read(&alone(entry)).is_err();
    Some((key.unwrap_or_else(|| innermost(entry, &is_wrong).span.clone()), why))
}

/// Returns the innermost value with which a contact alone is wrong: a point of a response, a number, or a feature.
fn innermost<'a>(entry: &'a Value, is_wrong: &impl Fn(&Value) -> bool) -> &'a Value {
    let table = |entries: Vec<(Key, Value)>| Value { item: Item::Table(Table { entries }), span: entry.span.clone() };
    let object = || of(entry).iter().filter(|(key, _)| key.name == OBJECT).cloned();
    if is_wrong(&table(object().collect())) {
        return entry.as_table().and_then(|table| table.get(OBJECT)).unwrap_or(entry);
    }
    let beside = |key: &Key, value: Value| table(object().chain([(key.clone(), value)]).collect());
    let features = of(entry).iter().filter(|(key, _)| key.name != OBJECT);
    let Some((key, feature)) = features.into_iter().find(|(key, value)| is_wrong(&beside(key, value.clone()))) else {
        return entry;
    };
    let is_wrong_alone = |one: &&(Key, Value)| is_wrong(&beside(key, table(vec![(*one).clone()])));
    let Some((_, number)) = of(feature).iter().find(is_wrong_alone) else { return feature };
    let Item::Array(points) = &number.item else { return number };
    let read: Vec<Option<[f64; 3]>> = points.iter().map(Value::read).collect();
    let known: Vec<[f64; 3]> = read.iter().copied().map_while(|point| point).collect();
    let wrong = if known.len() < points.len() { Some(known.len()) } else { wrong_point(&known) };
    wrong.map_or(number, |i| &points[i])
}

/// Key of the name of an object.
const OBJECT: &str = "object";

/// Returns the entries of a table.
fn of(value: &Value) -> &[(Key, Value)] {
    value.as_table().map_or(&[], |table| &table.entries)
}

/// Returns the place of a key in a value.
fn key_in(value: &Value, wanted: &str) -> Option<Range<usize>> {
    let entries = &value.as_table()?.entries;
    let own = entries.iter().find(|(key, _)| key.name == wanted).map(|(key, _)| key.span.clone());
    own.or_else(|| entries.iter().find_map(|(_, value)| key_in(value, wanted)))
}
