//! Checks that a node takes facts only of the roles that it reads: the model of one arm does not fit another one.

use std::collections::BTreeSet;
use std::iter::successors;
use std::ops::Range;

use crate::graph::net::Net;
use crate::graph::plan::Producer;
use crate::graph::syntax::LIMITS;
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, Edit, FactRef, Key, SourceMap, Table, Value, quoted, suggest_name};

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
pub(crate) fn check(net: &Net<'_>, sources: &SourceMap, diagnostics: &mut Diagnostics) {
    for (node, flat) in net.flat.nodes.iter().enumerate() {
        diagnostics.extend(task_values(net, node));
        let tables = [&flat.block.params].into_iter().chain(net.settings_of(node));
        let foreign: Vec<ForeignFact<'_>> = tables.flat_map(|table| find_foreign(net, node, table)).collect();
        let roles: BTreeSet<&str> = foreign.iter().map(|fact| fact.role).collect();
        diagnostics.extend(misspelt_roles(net, sources, node));
        for role in roles {
            let facts: Vec<_> = foreign.iter().filter(|fact| fact.role == role).collect();
            diagnostics.push(report(net, node, &facts));
        }
    }
}

/// Reports optional facts of a role that does not exist, if its name is misspelt: it occurs once, and a role is similar.
fn misspelt_roles(net: &Net<'_>, sources: &SourceMap, node: usize) -> Vec<Diagnostic> {
    let tables = [&net.flat.nodes[node].block.params].into_iter().chain(net.settings_of(node));
    let optional = tables.flat_map(Value::facts).filter(|fact| fact.is_optional);
    let report = |fact: FactRef<'_>| {
        let (role, known) = (fact.word.split_once('.')?.0, net.flat.roles.names().chain([LIMITS]));
        let is_known = known.clone().any(|name| name == net.role_at(Some(node), role, fact.place.start));
        suggest_name(role, known.clone()).filter(|_| !is_known && sources.occurrences(role) == 1)?;
        let place = Spanned { value: fact.word.to_owned(), span: fact.place.clone() }.part(0..role.len());
        Some(Diagnostic::unknown(Code::UnknownFact, "role", role, &place, known))
    };
    optional.filter_map(report).collect()
}

/// Reports parameters that only a fact can set, and that the task sets itself.
fn task_values(net: &Net<'_>, node: usize) -> Vec<Diagnostic> {
    let specs = net.spec(node).map_or(&[][..], |spec| &spec.params);
    let tables = [&net.flat.nodes[node].block.params].into_iter().chain(net.settings_of(node));
    let entries = tables.flat_map(|table| table.as_table().into_iter().flat_map(|table| &table.entries));
    let is_fact = |value: &Value| {
        let role = value.as_table().and_then(Table::fact).and_then(|fact| fact.word.split_once('.'));
        role.is_some_and(|(role, _)| role != LIMITS)
    };
    let is_for_bench = |name: &str| specs.iter().any(|spec| spec.name == name && spec.is_from_bench);
    let own = entries.filter(|(key, value)| is_for_bench(&key.name) && !is_fact(value));
    let report = |(key, value): &(Key, Value)| {
        let name = &key.name;
        let message = format!("only the bench can set `{name}`, as a fact of a role");
        let diagnostic = Diagnostic::new(Code::BadValue, value.span.clone(), message);
        diagnostic.help(format!(
            "write `{{ from = \"ROLE.{name}\", optional = true }}`, and state it under [facts.ROLE] in the bench"
        ))
    };
    own.map(report).collect()
}

/// Returns the facts in a table of parameters that are of roles which the node does not read. Unknown roles have their
/// own diagnostic, and optional facts are left out.
fn find_foreign<'a>(net: &'a Net<'_>, node: usize, table: &'a Value) -> Vec<ForeignFact<'a>> {
    let entries = table.as_table().into_iter().flat_map(|table| &table.entries);
    let facts = entries.flat_map(|(key, value)| value.facts().into_iter().map(move |fact| (key.name.as_str(), fact)));
    let foreign = facts.filter_map(|(param, FactRef { word, place, is_optional })| {
        let (role, fact) = word.split_once('.')?;
        let role = net.role_at(Some(node), role, place.start);
        let is_role = role != LIMITS && net.flat.roles.position(role).is_some();
        let is_foreign = !net.reads(node, role) || is_of_other_sensor(net, node, role);
        (is_role && !is_optional && is_foreign).then_some(ForeignFact { param, role, fact, place })
    });
    foreign.collect()
}

/// Returns whether a sensor is not the one in whose frame a node works: a pose of one pad with the mount of another.
fn is_of_other_sensor(net: &Net<'_>, node: usize, role: &str) -> bool {
    let Some(sensor) = net.flat.roles.position(role).filter(|role| !net.is_arm(*role)) else { return false };
    let frames = net.named_frames(node);
    // An unknown frame has its own diagnostic.
    let names_role = frames.iter().any(|frame| net.flat.roles.position(frame).is_some());
    names_role && !frames.contains(&role) && !net.roles_of(Producer::Node(node)).any(|read| read == sensor)
}

fn report(net: &Net<'_>, node: usize, facts: &[&ForeignFact<'_>]) -> Diagnostic {
    let (name, role, part) = (&net.flat.nodes[node].name, facts[0].role, net.part_of(node));
    let upstream: Vec<&str> = net.roles_of(Producer::Node(node)).map(|role| net.name(Producer::Role(role))).collect();
    let (params, reads) = (quoted(facts.iter().map(|fact| fact.param)), quoted(&upstream));
    let why = match net.reads(node, role) {
        true => format!("it works in the frame of {}", quoted(net.named_frames(node))),
        false => format!("it reads only {reads}"),
    };
    let message = format!("`{name}` takes {params} from the facts of `{role}`, but {why}");
    let place = facts[0].place.clone();
    let is_set_around = is_set_around(net, node, &place);
    let diagnostic = match part.filter(|_| !is_set_around) {
        Some(part) => {
            Diagnostic::new(Code::ForeignFact, part.span.clone(), message).note(place, "the part takes it here")
        }
        None => Diagnostic::new(Code::ForeignFact, place, message),
    };
    if let Some(sensor) =
        net.flat.roles.position(role).filter(|role| !net.is_arm(*role) && net.carrier(*role).is_none())
    {
        let (name, kind) = (net.name(Producer::Role(sensor)), &net.flat.roles[sensor].1.value);
        let arm = first_arm(&upstream, net).unwrap_or("ARM");
        return diagnostic
            .help(format!("say which arm carries it: `{name} = {{ type = \"{kind}\", on = \"{arm}\" }}`"));
    }
    let kind = |role: &str| net.flat.roles.get(role).map(|kind| kind.value.as_str());
    let mut known = upstream.into_iter().chain(net.named_frames(node));
    let Some(own) = known.find(|own| kind(own) == kind(role)) else { return diagnostic };
    if is_set_around {
        let facts = quoted(facts.iter().map(|fact| format!("{{ from = \"{own}.{}\" }}", fact.fact)));
        return diagnostic.help(format!("write {facts}"));
    }
    // The file of a task has names of its own for its nodes and its roles.
    let task = net.flat.scopes[net.flat.nodes[node].scope].task;
    let name = &name[net.flat.tasks[task].prefix.len()..];
    let own = net.flat.roles.position(own).map_or(own, |own| net.flat.role_in(task, own));
    let path = part.and(name.split_once('.')).map(|(_, inner)| format!("set.{inner}.")).unwrap_or_default();
    let line = |fact: &&ForeignFact<'_>| format!("\n{path}{} = {{ from = \"{own}.{}\" }}", fact.param, fact.fact);
    let lines: String = facts.iter().map(line).collect();
    match part {
        Some(part) => diagnostic
            .help(format!("add to [parts.{}]:{lines}", part.name))
            .edit(Edit::Below(part.span.clone(), lines.trim_start().to_owned())),
        None => diagnostic.help(format!("write in [nodes.{name}]:{lines}")),
    }
}

/// Returns whether a parameter of a node was written in a file around that of its task, or on the command line.
fn is_set_around(net: &Net<'_>, node: usize, place: &Range<usize>) -> bool {
    let flat = net.flat;
    let (scope, task) = (flat.nodes[node].scope, net.task_of(node).scope);
    let around = successors(Some(scope), |scope| flat.scopes[*scope].parent.filter(|_| *scope != task));
    task > 0 && !around.into_iter().any(|scope| flat.scopes[scope].text.contains(&place.start))
}

/// Returns the first of some roles that is an arm.
fn first_arm<'r>(roles: &[&'r str], net: &Net<'_>) -> Option<&'r str> {
    roles.iter().copied().find(|role| net.flat.roles.position(role).is_some_and(|role| net.is_arm(role)))
}
