//! Inserts facts of devices and values of `[limits]` into parameters.

use std::ops::Range;

use super::open::OpenedBench;
use crate::graph::net::{Net, Resolved};
use crate::graph::syntax::LIMITS;
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, Item, Value};

/// Replaces every `{ from = "role.fact" }` by the fact, and every `{ from = "limits.key" }` by the value in [limits].
///
/// Returns whether all of them are known.
pub(crate) fn fill_facts(
    value: &mut Value,
    net: &Net<'_>,
    opened: &OpenedBench,
    diagnostics: &mut Diagnostics,
) -> bool {
    let span = value.span.clone();
    let table = match &mut value.item {
        Item::Array(items) => {
            return items.iter_mut().fold(true, |good, item| fill_facts(item, net, opened, diagnostics) & good);
        }
        Item::Table(table) => table,
        _ => return true,
    };
    let from = table.get("from").filter(|_| table.is_fact());
    let word = from.and_then(|from| Some(Spanned { value: from.as_str()?.to_owned(), span: from.span.clone() }));
    let Some(word) = word else {
        return table
            .entries
            .iter_mut()
            .fold(true, |good, (_, item)| fill_facts(item, net, opened, diagnostics) & good);
    };
    match find_fact(&word, &span, net, opened) {
        Ok(fact) => *value = fact,
        Err(diagnostic) => {
            diagnostics.extend(diagnostic.map(|diagnostic| *diagnostic));
            return false;
        }
    }
    true
}

/// Returns the fact that a word names.
fn find_fact(word: &Spanned<String>, span: &Range<usize>, net: &Net<'_>, opened: &OpenedBench) -> Resolved<Value> {
    let unknown = |message: String| Diagnostic::new(Code::UnknownFact, word.span.clone(), message);
    let (role, name) = word.value.split_once('.').unwrap_or((&word.value, ""));
    if role == LIMITS {
        // A missing value is reported at the section.
        return net.flat.limits.as_ref().and_then(|(_, table)| table.get(name)).cloned().ok_or(None);
    }
    let roles = net.flat.role_names();
    let Some(index) = roles.clone().position(|known| known == role) else {
        return Diagnostic::unknown(Code::UnknownFact, "role", role, &word.span, roles).into_err();
    };
    // A device that could not be opened has its own diagnostic.
    let facts = &opened.roles[index].as_ref().ok_or(None)?.facts;
    let Some((_, value)) = facts.iter().find(|(fact, _)| fact == name) else {
        let message = format!("the device of role `{role}` has no fact `{name}`");
        return unknown(message).suggest(name, facts.iter().map(|(fact, _)| &**fact), "facts").into_err();
    };
    Ok(Value::from_toml(value, span))
}
