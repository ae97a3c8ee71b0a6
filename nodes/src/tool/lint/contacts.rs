//! Contacts of a bench that cannot be read, or that name a feature otherwise than its port: no loop is checked over them.

use std::ops::Range;

use tactflow_runtime::graph::{NO_SPAN, Outline};
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit, Item, Value, suggest_name};

use super::arm::Arm;
use crate::tool::control::contacts::{Contact, contacts};
use crate::tool::control::law::Feature;

/// Returns the warning about the contacts of an arm that cannot be read, and why.
pub(super) fn unreadable(outline: &Outline, arm: &str, why: String) -> Diagnostic {
    let name = format!("{arm}.contacts");
    let value = outline.facts.iter().find(|(fact, _)| *fact == name).map(|(_, value)| value);
    let place = value.map_or(NO_SPAN, |value| place(&name, arm, value, &why));
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

/// Returns the place of the mistake: the key that is not known, or the smallest value without which the contacts can be
/// read, or else the first contact that cannot be read by itself.
fn place(name: &str, arm: &str, value: &Value, why: &str) -> Range<usize> {
    let is_wrong = |value: &Value| {
        let fact = toml::Value::try_from(value).map(|value| [(name.to_owned(), value)]);
        fact.is_ok_and(|fact| contacts(&fact, arm).is_err())
    };
    let alone = |entry: &&Value| is_wrong(&Value { item: Item::Array(vec![(*entry).clone()]), ..value.clone() });
    let entry = children(value).into_iter().find(alone).unwrap_or(value);
    let unknown = why.split_once("unknown field `").and_then(|(_, rest)| rest.split_once('`'));
    let key = unknown.and_then(|(key, _)| key_in(entry, key));
    key.unwrap_or_else(|| culprit(value, &is_wrong).unwrap_or(entry).span.clone())
}

/// Returns the innermost value without which the whole is right. In a list with several mistakes that is the first one:
/// what follows it is left out. `None` if there is no such value.
fn culprit<'a>(whole: &'a Value, is_wrong: &impl Fn(&Value) -> bool) -> Option<&'a Value> {
    let (mut at, mut path) = (None, Vec::new());
    loop {
        let inner = children(at.unwrap_or(whole));
        let mends = |i: &usize| !is_wrong(&edited(whole, &path, |item| remove(item, *i)));
        let Some(i) = (0..inner.len()).find(mends) else {
            let ends_well = |count: usize| !is_wrong(&edited(whole, &path, |item| truncate(item, count)));
            let first = (0..inner.len()).find(|i| ends_well(*i) && !ends_well(i + 1));
            return first.map(|i| inner[i]).or(at);
        };
        at = Some(inner[i]);
        path.push(i);
    }
}

/// Returns the values in a list or a table, in their order.
fn children(value: &Value) -> Vec<&Value> {
    match &value.item {
        Item::Array(items) => items.iter().collect(),
        Item::Table(table) => table.entries.iter().map(|(_, value)| value).collect(),
        _ => Vec::new(),
    }
}

/// Returns a value in which the item at a path of positions is changed.
fn edited(whole: &Value, path: &[usize], change: impl FnOnce(&mut Item)) -> Value {
    let mut rest = whole.clone();
    let mut at = &mut rest;
    for &i in path {
        at = match &mut at.item {
            Item::Array(items) => &mut items[i],
            Item::Table(table) => &mut table.entries[i].1,
            _ => return rest,
        };
    }
    change(&mut at.item);
    rest
}

fn remove(item: &mut Item, i: usize) {
    match item {
        Item::Array(items) => drop(items.remove(i)),
        Item::Table(table) => drop(table.entries.remove(i)),
        _ => {}
    }
}

fn truncate(item: &mut Item, count: usize) {
    if let Item::Array(items) = item {
        items.truncate(count);
    }
}

/// Returns the place of a key in a value.
fn key_in(value: &Value, wanted: &str) -> Option<Range<usize>> {
    let entries = &value.as_table()?.entries;
    let own = entries.iter().find(|(key, _)| key.name == wanted).map(|(key, _)| key.span.clone());
    own.or_else(|| entries.iter().find_map(|(_, value)| key_in(value, wanted)))
}
