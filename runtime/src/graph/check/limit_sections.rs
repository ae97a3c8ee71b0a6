//! Checks the sections [limits] of the task, the bench, the robots and the command line against each other.

use std::collections::BTreeSet;

use crate::graph::net::Net;
use crate::graph::net::limits::{Form, form, is_looser, is_lower_bound, twin};
use crate::graph::plan::Producer;
use crate::graph::syntax::{LIMITS, LimitOwner, LimitSection};
use crate::source::{Code, Diagnostic, Diagnostics, Key, Table, Value};

/// Reports sections of unknown arms, values of different lengths, bounds that exclude each other, and assignments on
/// the command line that would loosen a limit.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    diagnostics.extend(net.flat.limits.iter().filter_map(|section| unknown_arm(net, section)));
    diagnostics.extend(net.flat.limits.iter().filter_map(|section| of_no_arm(net, section)));
    for arms in groups(net) {
        let names: BTreeSet<&str> = net.limit_sections(&arms).flat_map(names).collect();
        for name in names {
            let found = different_forms(net, &arms, name).or_else(|| excluded(net, &arms, name));
            diagnostics.extend(found.or_else(|| loosened(net, &arms, name)));
        }
    }
    diagnostics.extend(unread(net));
    // The same sections may hold for several arms.
    let mut seen: Diagnostics = Vec::new();
    for found in diagnostics.drain(..) {
        if !seen.contains(&found) {
            seen.push(found);
        }
    }
    *diagnostics = seen;
}

/// Returns the groups of arms for which limits hold at once: each arm alone, and those that a node moves.
fn groups(net: &Net<'_>) -> BTreeSet<Vec<usize>> {
    let alone = net.commands.iter().filter(|wire| !wire.is_report).map(|wire| vec![wire.role]);
    let reads = |node: &usize| {
        let tables = [&net.flat.nodes[*node].block.params].into_iter().chain(net.settings_of(*node));
        tables.flat_map(Value::facts).any(|fact| fact.word.split('.').next() == Some(LIMITS))
    };
    let moved = (0..net.flat.nodes.len()).filter(reads).map(|node| net.arms_of(node).to_vec());
    let all: BTreeSet<Vec<usize>> = alone.chain(moved).collect();
    if all.is_empty() { BTreeSet::from([Vec::new()]) } else { all }
}

fn names(section: &LimitSection) -> impl Iterator<Item = &str> {
    section.table.entries.iter().map(|(key, _)| key.name.as_str())
}

/// Reports a section [limits.ROLE] of which neither the task nor the bench has the role, or of a role without limits.
fn unknown_arm(net: &Net<'_>, section: &LimitSection) -> Option<Diagnostic> {
    let role = section.role.as_ref()?;
    let limited = |index: &usize| net.roles[*index].is_none_or(|role| !role.limits.is_empty());
    let is_bound = net.flat.bench.as_ref().is_some_and(|bench| bench.bind.position(&role.name).is_some());
    let is_own = |index: &usize| section.task == 0 || net.flat.tasks[section.task].roles.contains(index);
    let index = net.flat.roles.position(&role.name).filter(is_own);
    let is_observed = net.catalogue.roles().iter().any(|known| known.is_observed_as(&role.name));
    let is_of_another_task = index.is_none() && is_bound && !is_observed && section.owner == LimitOwner::Bench;
    if index.as_ref().is_some_and(limited) || is_of_another_task {
        return None;
    }
    let arms = (0..net.flat.roles.len()).filter(limited).filter(is_own).map(|index| net.name(Producer::Role(index)));
    Some(Diagnostic::unknown(Code::UnknownPort, "arm", &role.name, &role.span, arms))
}

/// Reports limits of a part that declares no arm: they would hold for none.
fn of_no_arm(net: &Net<'_>, section: &LimitSection) -> Option<Diagnostic> {
    let task = &net.flat.tasks[section.task];
    let is_arm = |role: &usize| net.roles[*role].is_none_or(|role| !role.limits.is_empty());
    let is_empty = section.role.is_some() || section.table.entries.is_empty();
    if section.task == 0 || is_empty || section.owner != LimitOwner::Task || task.roles.iter().any(is_arm) {
        return None;
    }
    let message = format!("the limits of part `{}` hold for no arm, because its file declares none", task.name());
    let help = "declare the arm in this file, as in `[roles]` with `arm = \"velocity_arm\"`";
    Some(Diagnostic::new(Code::UnknownPort, section.span.clone(), message).help(help))
}

/// Returns the values of a limit with their keys, in the order of the sections.
fn values<'n>(net: &'n Net<'_>, arms: &'n [usize], name: &'n str) -> impl Iterator<Item = &'n (Key, Value)> {
    net.limit_sections(arms).filter_map(move |section| section.table.entry(name))
}

/// Reports a limit that is a list in one section and a number, or a list of another length, in another one.
fn different_forms(net: &Net<'_>, arms: &[usize], name: &str) -> Option<Diagnostic> {
    let (_, first) = values(net, arms, name).next()?;
    let (_, other) = values(net, arms, name).find(|(_, value)| form(value) != form(first))?;
    let [described, elsewhere] = [other, first].map(|value| form(value).in_words());
    let message = format!("the limit `{name}` has {described}, but {elsewhere} elsewhere");
    let diagnostic = Diagnostic::new(Code::BadValue, other.span.clone(), message);
    Some(diagnostic.note(first.span.clone(), "it is stated here, too").help("state it in the same form everywhere"))
}

/// Reports a lower bound and an upper bound of different sections between which there is nothing.
fn excluded(net: &Net<'_>, arms: &[usize], name: &str) -> Option<Diagnostic> {
    let upper = twin(name).filter(|_| is_lower_bound(name))?;
    if !net.excludes_all(arms, name) {
        return None;
    }
    let owned = |name: &str| {
        let sections = net.limit_sections(arms).filter_map(|section| Some((section, section.table.get(name)?)));
        sections.map(|(section, value)| (section.owner.name(), value.span.clone())).collect::<Vec<_>>()
    };
    let (lower, upper_places) = (owned(name), owned(&upper));
    let message = format!("no value is between `{name}` and `{upper}`: the sections [limits] exclude each other");
    let mut places = lower.into_iter().chain(upper_places);
    let (_, first) = places.next()?;
    let diagnostic = Diagnostic::new(Code::BadValue, first, message);
    let diagnostic = places.fold(diagnostic, |found, (owner, place)| found.note(place, format!("{owner} states this")));
    Some(diagnostic.help("all of them hold at once: let their boxes overlap"))
}

/// Reports an assignment on the command line that is looser than what the files state. Rows are added to those of the
/// files, so they loosen nothing.
fn loosened(net: &Net<'_>, arms: &[usize], name: &str) -> Option<Diagnostic> {
    let is_set = |section: &&LimitSection| section.owner == LimitOwner::CommandLine;
    let (key, value) = net.limit_sections(arms).filter(is_set).find_map(|section| section.table.entry(name))?;
    if form(value) == Form::Rows {
        return None;
    }
    let files = net.limit_sections(arms).filter(|section| !is_set(section));
    let stated = files.filter_map(|section| Some((section, section.table.get(name)?)));
    let (section, bound) = stated.into_iter().find(|(_, bound)| is_looser(name, value, bound))?;
    let message = format!("`--set` cannot loosen the limit `{}`, which {} states", key.name, section.owner.name());
    let diagnostic = Diagnostic::new(Code::LooseLimit, value.span.clone(), message);
    Some(diagnostic.note(bound.span.clone(), "the limit is here").help("change the limit in its file"))
}

/// Reports limits that are stated for an arm and that the limiters on its path do not read, although they could.
fn unread(net: &Net<'_>) -> Vec<Diagnostic> {
    let readers = net.catalogue.limit_readers();
    let mut found = Vec::new();
    for wire in net.commands.iter().filter(|wire| !wire.is_report) {
        let path = net.motion_path(wire).unwrap_or_default();
        let limits =
            path.iter().flat_map(|stop| readers.limits_of(&stop.spec.name).map(move |limit| (stop.node, limit)));
        let stated = limits.filter(|(_, limit)| net.limit(&[wire.role], limit).is_some());
        let is_read = |limit: &str| path.iter().any(|stop| enforces(net, stop.node, limit));
        let stated = stated.filter(|(node, _)| !has_unknown_key(net, *node));
        let mut open: Vec<(usize, &str)> = stated.filter(|(_, limit)| !is_read(limit)).collect();
        open.dedup();
        found.extend(open.into_iter().map(|(node, limit)| report_unread(net, node, limit)));
    }
    found
}

/// Returns whether a parameter of a limiter reads a limit, or has a value of its own, which is compared with the limit.
fn enforces(net: &Net<'_>, node: usize, limit: &str) -> bool {
    let kind = net.spec(node).map_or("", |spec| &spec.name);
    let params = net.flat.nodes[node].block.params.as_table();
    let mut entries = params.into_iter().flat_map(|table| &table.entries);
    entries.any(|(key, value)| {
        let is_for_limit = net.catalogue.limit_readers().limit_of(kind, &key.name) == Some(limit);
        let fact = value.as_table().and_then(Table::fact);
        let is_certain = fact.is_none_or(|fact| !fact.is_optional || fact.word == format!("{LIMITS}.{limit}"));
        is_for_limit && is_certain
    })
}

/// Returns whether a limiter has a key that is no parameter. That has a message of its own, and the key that was meant may
/// be the one that reads the limit.
fn has_unknown_key(net: &Net<'_>, node: usize) -> bool {
    let known = net.spec(node).map_or(&[][..], |spec| &spec.params);
    let mut keys = net.flat.nodes[node].block.params.as_table().into_iter().flat_map(|table| &table.entries);
    keys.any(|(key, _)| known.iter().all(|param| param.name != key.name))
}

fn report_unread(net: &Net<'_>, node: usize, limit: &str) -> Diagnostic {
    let (kind, specs) = net.spec(node).map_or(("", &[][..]), |spec| (&spec.name, &spec.params));
    let reads = |param: &&str| net.catalogue.limit_readers().limit_of(kind, param) == Some(limit);
    let param = specs.iter().map(|param| param.name).find(reads).unwrap_or("PARAMETER");
    let message = format!("`{}` does not read the limit `{limit}` of its arm", net.flat.nodes[node].name);
    let diagnostic = net.diagnostic_at(node, Code::LooseLimit, message);
    let bound = net.limit(net.arms_of(node), limit);
    let diagnostic = bound.into_iter().fold(diagnostic, |found, bound| found.note(bound.span, "the limit is here"));
    diagnostic.help(format!("write `{param} = {{ from = \"{LIMITS}.{limit}\" }}` in it"))
}
