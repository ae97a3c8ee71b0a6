//! Checks that [limits] and the parameters that read from it agree.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::graph::bench::OpenedBench;
use crate::graph::load::Entity;
use crate::graph::net::Net;
use crate::graph::net::limits::twin;
use crate::graph::plan::Producer;
use crate::graph::syntax::{LIMITS, LimitSection};
use crate::node::{ParamSpec, Spanned};
use crate::source::{Code, Diagnostic, Diagnostics, Edit, Key, SourceMap, Value, quoted, suggest_name};

/// A reference to a value of the section, as `{ from = "limits.KEY" }`.
struct LimitRef<'a> {
    /// The node that reads it.
    node: usize,
    key: String,
    /// The place of the key in the reference.
    span: Range<usize>,
    /// The parameter that uses it.
    spec: Option<&'a ParamSpec>,
    /// Whether the parameter can do without it.
    is_optional: bool,
}

/// Reports values that no node uses, and missing values.
///
/// A misspelt key is both unused and missing; it is reported once, where it is misspelt. While a limiter is missing, an
/// unused value may belong to it and is not reported. Returns each parameter that reads a misspelt
/// one, with the place of its node.
pub(crate) fn check(
    net: &Net<'_>,
    opened: &OpenedBench,
    sources: &SourceMap,
    diagnostics: &mut Diagnostics,
) -> Vec<(Range<usize>, String)> {
    let mut names = net.flat.scopes.iter().flat_map(|scope| scope.names.values());
    let has_unknown_part = names.any(|(_, entity)| matches!(entity, Entity::Unknown));
    let is_limited =
        !has_unknown_part && diagnostics.iter().all(|diagnostic| diagnostic.code != Code::UnlimitedCommand);
    let refs = find_refs(net);
    let given: Vec<&Key> = net.flat.all_limits().map(|(key, _)| key).collect();
    let mut wanted: BTreeMap<&str, Vec<&LimitRef<'_>>> = BTreeMap::new();
    for limit in refs.iter().filter(|limit| net.limit(net.arms_of(limit.node), &limit.key).is_none()) {
        wanted.entry(&limit.key).or_default().push(limit);
    }
    let mut unused: Vec<&Key> = given.iter().copied().filter(|key| !refs.iter().any(|r| r.key == key.name)).collect();
    let mut missing: Vec<&LimitRef<'_>> = Vec::new();
    let mut without = Vec::new();
    let is_optional = |limits: &[&LimitRef<'_>]| limits.iter().all(|limit| limit.is_optional);
    let required = wanted.values().filter(|limits| !is_optional(limits)).count();
    let is_single = (required, unused.len()) == (1, 1);
    for (name, limits) in &wanted {
        // A name that occurs once in all files is a misspelt reference to a limit that other parameters use.
        let is_alone = limits.len() == 1 && sources.occurrences(name) == 1;
        let is_needed = !is_optional(limits);
        let only = unused.first().copied().filter(|_| is_single && is_needed);
        // A limit that the built-in parts read is not meant for one that can be left out.
        let is_meant = |key: &&Key| is_needed || net.catalogue.limit_readers().find(&key.name).is_none();
        if let Some(key) = similar(name, &unused).filter(is_meant).or(only) {
            unused.retain(|other| other.name != key.name);
            let param = |limit: &&LimitRef<'_>| limit.spec.map_or_else(String::new, |spec| spec.name.to_owned());
            without.extend(limits.iter().map(|limit| (net.place(Producer::Node(limit.node)), param(limit))));
            diagnostics.push(misspelt(key, limits, net, sources));
        } else if let Some(key) = similar(name, &given).filter(|_| is_alone && is_needed) {
            diagnostics.push(misspelt_reference(key, limits));
        } else if is_needed {
            missing.extend(limits.iter().find(|limit| !limit.is_optional));
        }
    }
    // The robot of a device that could not be opened may state it.
    let is_open = |arm: &usize| opened.roles.get(*arm).is_some_and(Option::is_some);
    let moved = |limit: &LimitRef<'_>| match net.arms_of(limit.node) {
        [] => (0..net.roles.len()).filter(|role| net.is_arm(*role)).collect(),
        arms => arms.to_vec(),
    };
    missing.retain(|limit| moved(limit).iter().all(is_open));
    missing.sort_by_key(|limit| refs.iter().position(|other| other.span == limit.span));
    // A cell and a robot state what other tasks use, too.
    let is_of_task = |key: &Key| net.flat.limits.iter().any(|section| section.is_of_task() && section.has(key));
    unused.retain(|key| is_of_task(key) || net.catalogue.limit_readers().find(&key.name).is_none());
    diagnostics.extend(unused.into_iter().filter(|_| is_limited).filter_map(|key| unread(key, net)));
    diagnostics.extend(report_missing(net, &missing));
    without
}

/// Removes what nodes say of these parameters, which lack a limit: its misspelt key is reported.
pub(crate) fn tell_once(misspelt: &[(Range<usize>, String)], diagnostics: &mut Diagnostics) {
    diagnostics.retain(|found| {
        let is_about = |(place, param): &(Range<usize>, String)| {
            *place == found.span && found.message.contains(&format!("`{param}`"))
        };
        found.code != Code::MissingLimit || !misspelt.iter().any(is_about)
    });
}

/// Returns the references in the order of the nodes.
fn find_refs<'a>(net: &Net<'a>) -> Vec<LimitRef<'a>> {
    let mut refs = Vec::new();
    for (i, node) in net.flat.nodes.iter().enumerate() {
        let specs = net.spec(i).map_or(&[][..], |spec| &spec.params);
        let tables = [&node.block.params].into_iter().chain(net.settings_of(i)).filter_map(Value::as_table);
        for (key, value) in tables.flat_map(|table| &table.entries) {
            let spec = specs.iter().find(|spec| spec.name == key.name);
            let limits = value.facts().into_iter().filter_map(|fact| match fact.word.split_once('.')? {
                (LIMITS, key) => {
                    let word = Spanned { value: fact.word.to_owned(), span: fact.place.clone() };
                    let span = word.part(fact.word.len() - key.len()..fact.word.len());
                    Some(LimitRef { node: i, key: key.to_owned(), span, spec, is_optional: fact.is_optional })
                }
                _ => None,
            });
            refs.extend(limits);
        }
    }
    refs
}

/// Returns the key whose name is like `name`.
fn similar<'k>(name: &str, keys: &[&'k Key]) -> Option<&'k Key> {
    let found = suggest_name(name, keys.iter().map(|key| key.name.as_str()))?;
    keys.iter().copied().find(|key| key.name == found)
}

/// Reports an unused key of [limits] or the references to a missing one, whichever is misspelt: the name that the
/// built-in parts do not use, or that occurs less often.
fn misspelt(key: &Key, limits: &[&LimitRef<'_>], net: &Net<'_>, sources: &SourceMap) -> Diagnostic {
    let wanted = &limits[0].key;
    let rank = |name: &str| (net.catalogue.limit_readers().find(name).is_some(), sources.occurrences(name));
    if limits.len() == 1 && rank(&key.name) > rank(wanted) {
        return misspelt_reference(key, limits);
    }
    let message = format!("no node uses the limit `{}`, and `{wanted}` is missing", key.name);
    let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
    diagnostic.note(limits[0].span.clone(), format!("`{wanted}` is used here")).instead(&key.name, wanted)
}

/// Reports references to a missing limit that mean the given `key`.
fn misspelt_reference(key: &Key, limits: &[&LimitRef<'_>]) -> Diagnostic {
    let wanted = &limits[0].key;
    let message = format!("[limits] has no `{wanted}`");
    let diagnostic = Diagnostic::new(Code::MissingLimit, limits[0].span.clone(), message).instead(wanted, &key.name);
    limits[1..].iter().fold(diagnostic, |diagnostic, limit| {
        let edit = Edit::Replace(limit.span.clone(), key.name.clone());
        diagnostic.note(limit.span.clone(), "and here").edit(edit)
    })
}

/// Reports a limit that no node uses, with the limiter that should. A limiter that lacks a required parameter has its own
/// diagnostic.
fn unread(key: &Key, net: &Net<'_>) -> Option<Diagnostic> {
    let name = &key.name;
    let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), format!("no node uses the limit `{name}`"));
    let line = |param: &str| format!("{param} = {{ from = \"{LIMITS}.{name}\" }}");
    let Some((kind, param)) = net.catalogue.limit_readers().find(name) else {
        let help = format!("let a parameter of a limiter read it: `{}`", line("PARAMETER"));
        return Some(diagnostic.help(help));
    };
    let mut nodes = net.flat.nodes.iter().enumerate();
    let limiter = nodes.find(|(i, _)| net.spec(*i).is_some_and(|spec| spec.name == kind));
    let Some((index, limiter)) = limiter else {
        return Some(diagnostic.help(format!("it is for a `{kind}`, which the graph lacks, with `{}`", line(param))));
    };
    let diagnostic = diagnostic.help(format!("write `{}` in `{}`", line(param), limiter.name));
    let is_required = |spec: &ParamSpec| spec.name == param && !spec.is_optional;
    match limiter.block.params.as_table().and_then(|table| table.get(param)) {
        Some(value) => {
            let place = value.span.clone();
            let diagnostic = diagnostic.note(place.clone(), format!("`{}` has another value here", limiter.name));
            Some(diagnostic.edit(Edit::Replace(place, format!("{{ from = \"{LIMITS}.{name}\" }}"))))
        }
        None if net.spec(index).is_some_and(|spec| spec.params.iter().any(is_required)) => None,
        None => Some(diagnostic.edit(Edit::Below(limiter.block.key.span.clone(), line(param)))),
    }
}

/// Reports all missing values in one diagnostic.
fn report_missing(net: &Net<'_>, missing: &[&LimitRef<'_>]) -> Option<Diagnostic> {
    let first = missing.first()?;
    let lines = missing.iter().map(|limit| {
        let doc = limit.spec.map(ParamSpec::doc_with_unit).unwrap_or_default();
        format!("\n- `{}`: {}", limit.key, doc.trim_end_matches('.'))
    });
    let names = quoted(missing.iter().map(|limit| &limit.key));
    let beside = missing.iter().find_map(|limit| {
        let twin = twin(&limit.key)?;
        net.flat.limits.iter().find(|section| section.table.get(&twin).is_some())
    });
    let (span, message) = match beside.or_else(|| net.flat.task_limits()) {
        Some(LimitSection { span, .. }) => (span.clone(), format!("[limits] lacks {names}")),
        None => (net.flat.root().place.clone(), format!("the graph has no section [limits]; it needs {names}")),
    };
    let diagnostic = Diagnostic::new(Code::MissingLimit, span, message).note(first.span.clone(), "used here");
    let lines: String = lines.collect();
    Some(diagnostic.help(format!("write a value for each under [limits] of the task, the bench or the robot:{lines}")))
}
