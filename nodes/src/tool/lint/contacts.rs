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
