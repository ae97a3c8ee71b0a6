//! Checks that a node takes facts only of the roles that it reads: the model of one arm does not fit another one.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::net::Net;
use crate::graph::plan::Producer;
use crate::graph::syntax::LIMITS;
use crate::source::{Code, Diagnostic, Diagnostics, FactRef, Value, quoted};

/// A fact of a role that the node does not read.
struct ForeignFact<'a> {
    /// The parameter, with the facts in it.
    param: &'a str,
    role: &'a str,
    fact: &'a str,
    place: &'a Range<usize>,
}

/// Reports facts of roles that are not upstream of their node, one diagnostic for each node and role.
///
/// A node that reads no role generates its outputs, and may use the facts of any role.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for (node, flat) in net.flat.nodes.iter().enumerate() {
        let upstream: BTreeSet<&str> =
            net.roles_of(Producer::Node(node)).map(|role| net.name(Producer::Role(role))).collect();
        let tables = [&flat.block.params].into_iter().chain(net.settings_of(node));
        let foreign: Vec<ForeignFact<'_>> = tables.flat_map(|table| find_foreign(net, table, &upstream)).collect();
        let roles: BTreeSet<&str> = foreign.iter().map(|fact| fact.role).filter(|_| !upstream.is_empty()).collect();
        for role in roles {
            let facts: Vec<_> = foreign.iter().filter(|fact| fact.role == role).collect();
            diagnostics.push(report(net, node, &facts, &upstream));
        }
    }
}

/// Returns the facts in a table of parameters that are not of the given roles. Unknown roles have their own diagnostic.
fn find_foreign<'a>(net: &Net<'_>, table: &'a Value, upstream: &BTreeSet<&str>) -> Vec<ForeignFact<'a>> {
    let entries = table.as_table().into_iter().flat_map(|table| &table.entries);
    let facts = entries.flat_map(|(key, value)| value.facts().into_iter().map(move |fact| (key.name.as_str(), fact)));
    let foreign = facts.filter_map(|(param, FactRef { word, place, .. })| {
        let (role, fact) = word.split_once('.')?;
        let is_foreign = role != LIMITS && net.flat.role_names().any(|name| name == role) && !upstream.contains(role);
        is_foreign.then_some(ForeignFact { param, role, fact, place })
    });
    foreign.collect()
}

fn report(net: &Net<'_>, node: usize, facts: &[&ForeignFact<'_>], upstream: &BTreeSet<&str>) -> Diagnostic {
    let (name, role) = (&net.flat.nodes[node].name, facts[0].role);
    let params = quoted(facts.iter().map(|fact| fact.param));
    let reads = quoted(upstream);
    let message = format!("`{name}` takes {params} from the facts of `{role}`, but it reads only {reads}");
    let place = facts[0].place.clone();
    let part = name.split_once('.');
    let used = part.and_then(|(part, _)| net.flat.scopes[0].names.get(part)).map(|(key, _)| key.span.clone());
    let diagnostic = match used {
        Some(used) => Diagnostic::new(Code::ForeignFact, used, message).note(place, "the part takes it here"),
        None => Diagnostic::new(Code::ForeignFact, place, message),
    };
    let kind =
        |role: &str| net.flat.roles.iter().find(|(key, _)| key.name == role).map(|(_, kind)| kind.value.as_str());
    let Some(own) = upstream.iter().find(|own| kind(own) == kind(role)) else { return diagnostic };
    let path = part.map(|(_, inner)| format!("set.{inner}.")).unwrap_or_default();
    let lines = facts.iter().map(|fact| format!("\n{path}{} = {{ from = \"{own}.{}\" }}", fact.param, fact.fact));
    let lines: String = lines.collect();
    diagnostic.help(match part {
        Some((part, _)) => format!("add to [parts.{part}]:{lines}"),
        None => format!("write in [nodes.{name}]:{lines}"),
    })
}
