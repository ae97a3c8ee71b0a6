//! Facts of devices and numbers of `[limits]`, put where parameters ask for them.

use std::ops::Range;

use super::open::Opened;
use crate::graph::net::Net;
use crate::graph::syntax::LIMITS;
use crate::node::Word;
use crate::source::{Code, Diagnostic, Item, Value, closest};

/// Puts the facts of devices in the place of every `{ from = "role.fact" }`, and the numbers of [limits] in that of
/// `{ from = "limits.key" }`.
pub(crate) fn fill_facts(value: &mut Value, net: &Net<'_>, opened: &Opened, found: &mut Vec<Diagnostic>) -> bool {
    let span = value.span.clone();
    let table = match &mut value.item {
        Item::Array(items) => {
            return items.iter_mut().fold(true, |good, item| fill_facts(item, net, opened, found) & good);
        }
        Item::Table(table) => table,
        _ => return true,
    };
    let from = table.get("from").filter(|_| table.is_fact());
    let word = from.and_then(|from| Some(Word { text: from.as_str()?.to_owned(), span: from.span.clone() }));
    let Some(word) = word else {
        return table.entries.iter_mut().fold(true, |good, (_, item)| fill_facts(item, net, opened, found) & good);
    };
    match fact(&word, &span, net, opened) {
        Ok(Some(fact)) => *value = fact,
        Ok(None) => return false,
        Err(diagnostic) => {
            found.push(*diagnostic);
            return false;
        }
    }
    true
}

fn fact(word: &Word, span: &Range<usize>, net: &Net<'_>, opened: &Opened) -> Result<Option<Value>, Box<Diagnostic>> {
    let wrong = |message: String, help: String| {
        Err(Box::new(Diagnostic::new(Code::UnknownFact, word.span.clone(), message).help(help)))
    };
    let roles = || net.flat.roles.iter().map(|(key, _)| key.name.as_str());
    let (role, name) = word.text.split_once('.').unwrap_or((&word.text, ""));
    if role == LIMITS {
        // What is missing there has been told at the section.
        return Ok(net.flat.limits.as_ref().and_then(|(_, table)| table.get(name)).cloned());
    }
    let Some(index) = roles().position(|known| known == role) else {
        return wrong(format!("there is no role `{role}` to ask for a fact"), closest(role, roles(), "roles"));
    };
    // A device that could not be opened has had its say.
    let Some(bound) = &opened.roles[index] else { return Ok(None) };
    let facts = &bound.facts;
    match facts.iter().find(|(fact, _)| fact == name) {
        Some((_, value)) => Ok(Some(Value::from_toml(value, span))),
        None => {
            let help = closest(name, facts.iter().map(|(fact, _)| &**fact), "facts");
            wrong(format!("the device behind `{role}` states no `{name}`"), help)
        }
    }
}
