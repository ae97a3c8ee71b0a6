//! Inserts facts of devices and values of `[limits]` into parameters.

use std::ops::Range;

use super::open::OpenedBench;
use crate::graph::net::limits::unit_of_limit;
use crate::graph::net::{Net, Resolved, report};
use crate::graph::syntax::LIMITS;
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, FactRef, Item, Table, Value};

/// Replaces every `{ from = "role.fact" }` by the fact, and every `{ from = "limits.key" }` by the value in [limits].
/// An optional one that is not there, or that is of a role which `node` does not read, is left out.
///
/// Returns whether all of them are known.
pub(crate) fn fill_facts(
    value: &mut Value,
    node: Option<usize>,
    net: &Net<'_>,
    opened: &OpenedBench,
    diagnostics: &mut Diagnostics,
) -> bool {
    let Some(fact) = value.as_table().and_then(Table::fact) else {
        if let Item::Table(table) = &mut value.item {
            table.entries.retain(|(_, item)| !is_left_out(item, node, net, opened));
        }
        let mut fill = |item| fill_facts(item, node, net, opened, diagnostics);
        return match &mut value.item {
            Item::Array(items) => items.iter_mut().fold(true, |good, item| fill(item) & good),
            Item::Table(table) => table.entries.iter_mut().fold(true, |good, (_, item)| fill(item) & good),
            _ => true,
        };
    };
    let fact = find_fact(&fact, &value.span, node, net, opened);
    report(fact, diagnostics).map(|fact| *value = fact).is_some()
}

/// Adds a unit to the plain numbers in a value, so that a parameter of another unit refuses them.
fn with_unit(value: Value, unit: &str) -> Value {
    let item = match value.item {
        Item::Integer(number) => Item::String(format!("{number} {unit}")),
        Item::Float(number) if number.is_finite() => Item::String(format!("{number} {unit}")),
        Item::Array(items) => Item::Array(items.into_iter().map(|item| with_unit(item, unit)).collect()),
        other => other,
    };
    Value { item, ..value }
}

/// Returns whether a value is an optional fact that is not there, or that is of a role which the node does not read.
fn is_left_out(value: &Value, node: Option<usize>, net: &Net<'_>, opened: &OpenedBench) -> bool {
    let Some(fact) = value.as_table().and_then(Table::fact).filter(|fact| fact.is_optional) else { return false };
    let role = fact.word.split_once('.').map_or(fact.word, |(role, _)| role);
    let is_foreign = |node: usize| !net.reads(node, net.role_at(Some(node), role, fact.place.start));
    if role == LIMITS {
        let arms = node.map_or(&[][..], |node| net.arms_of(node));
        return net.limit(arms, fact.word.split_once('.').map_or("", |(_, name)| name)).is_none();
    }
    // What is no role at all has no facts that may be missing.
    if net.flat.roles.position(net.role_at(node, role, fact.place.start)).is_none() {
        return false;
    }
    // A misspelt name of a fact that is there is not one that may be missing.
    let is_missing = || match find_fact(&fact, &value.span, node, net, opened) {
        Ok(_) => false,
        Err(unknown) => unknown.is_none_or(|unknown| unknown.fix.is_empty()),
    };
    node.is_some_and(is_foreign) || is_missing()
}

/// Returns the fact that a reference in a parameter of `node` names, as a value at `span`.
fn find_fact(
    FactRef { word, place, .. }: &FactRef<'_>,
    span: &Range<usize>,
    node: Option<usize>,
    net: &Net<'_>,
    opened: &OpenedBench,
) -> Resolved<Value> {
    let (role, name) = word.split_once('.').unwrap_or((word, ""));
    let part = |range: Range<usize>| Spanned { value: (*word).to_owned(), span: (*place).clone() }.part(range);
    if role == LIMITS {
        // A missing value is reported at the section, and a contradiction between sections too.
        let arms = node.map_or(&[][..], |node| net.arms_of(node));
        let value = net.limit(arms, name).filter(|_| !net.contradicts(arms, name)).ok_or(None)?;
        return Ok(match unit_of_limit(name) {
            Some(unit) => with_unit(value, unit),
            None => value,
        });
    }
    let (roles, length) = (&net.flat.roles, role.len());
    let role = net.role_at(node, role, place.start);
    let Some(index) = roles.position(role) else {
        let place = part(0..length);
        return Diagnostic::unknown(Code::UnknownFact, "role", role, &place, roles.names().chain([LIMITS])).into_err();
    };
    // A device that could not be opened has its own diagnostic.
    let facts = &opened.roles[index].as_ref().ok_or(None)?.facts;
    let Some((_, value)) = facts.iter().find(|(fact, _)| fact == name) else {
        let message = format!("the device of role `{role}` has no fact `{name}`");
        let unknown = Diagnostic::new(Code::UnknownFact, part(word.len() - name.len()..word.len()), message);
        let unknown = unknown.suggest(name, facts.iter().map(|(fact, _)| &**fact), "facts");
        let listed = unknown.help.clone().filter(|_| unknown.fix.is_empty());
        return match listed {
            Some(facts) => unknown.help(format!("{facts}; a bench can state others under [facts.{role}]")).into_err(),
            None => unknown.into_err(),
        };
    };
    Ok(Value::from_toml(value, span))
}
