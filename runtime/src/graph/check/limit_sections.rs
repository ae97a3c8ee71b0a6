//! Checks the sections [limits] of the task, the bench, the robots and the command line against each other.

use std::collections::BTreeSet;

use crate::graph::net::Net;
use crate::graph::net::limits::{is_looser, length, twin};
use crate::graph::plan::Producer;
use crate::graph::syntax::{LimitOwner, LimitSection};
use crate::source::{Code, Diagnostic, Diagnostics, Key, Value};

/// Reports sections of unknown arms, values of different lengths, bounds that exclude each other, and assignments on
/// the command line that would loosen a limit.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    diagnostics.extend(net.flat.limits.iter().filter_map(|section| unknown_arm(net, section)));
    for arms in groups(net) {
        let names: BTreeSet<&str> = net.limit_sections(&arms).flat_map(names).collect();
        for name in names {
            let found = different_lengths(net, &arms, name).or_else(|| excluded(net, &arms, name));
            diagnostics.extend(found.or_else(|| loosened(net, &arms, name)));
        }
    }
    let mut seen = BTreeSet::new();
    diagnostics.retain(|found| found.code != Code::LooseLimit || seen.insert(found.span.start));
}

/// Returns each arm alone, or one empty group if the graph moves none.
fn groups(net: &Net<'_>) -> Vec<Vec<usize>> {
    let arms: BTreeSet<usize> = net.commands.iter().filter(|wire| !wire.is_report).map(|wire| wire.role).collect();
    if arms.is_empty() { vec![Vec::new()] } else { arms.into_iter().map(|arm| vec![arm]).collect() }
}

fn names(section: &LimitSection) -> impl Iterator<Item = &str> {
    section.table.entries.iter().map(|(key, _)| key.name.as_str())
}

/// Reports a section [limits.ROLE] of which neither the task nor the bench has the role, or of a role without limits.
fn unknown_arm(net: &Net<'_>, section: &LimitSection) -> Option<Diagnostic> {
    let role = section.role.as_ref()?;
    let limited = |index: &usize| net.roles[*index].is_none_or(|role| !role.limits.is_empty());
    let is_bound = net.flat.bench.as_ref().is_some_and(|bench| bench.bind.position(&role.name).is_some());
    let index = net.flat.roles.position(&role.name);
    if index.as_ref().is_some_and(limited) || index.is_none() && is_bound && section.owner == LimitOwner::Bench {
        return None;
    }
    let arms = (0..net.flat.roles.len()).filter(limited).map(|index| net.name(Producer::Role(index)));
    Some(Diagnostic::unknown(Code::UnknownPort, "arm", &role.name, &role.span, arms))
}

/// Returns the values of a limit with their keys, in the order of the sections.
fn values<'n>(net: &'n Net<'_>, arms: &'n [usize], name: &'n str) -> impl Iterator<Item = &'n (Key, Value)> {
    net.limit_sections(arms).filter_map(move |section| section.table.entry(name))
}

/// Reports a limit that is a list in one section and a number, or a list of another length, in another one.
fn different_lengths(net: &Net<'_>, arms: &[usize], name: &str) -> Option<Diagnostic> {
    let described = |value: &Value| length(value).map_or("one value".to_owned(), |length| format!("{length} values"));
    let (_, first) = values(net, arms, name).next()?;
    let (_, other) = values(net, arms, name).find(|(_, value)| length(value) != length(first))?;
    let message = format!("the limit `{name}` has {}, but {} elsewhere", described(other), described(first));
    let diagnostic = Diagnostic::new(Code::BadValue, other.span.clone(), message);
    Some(diagnostic.note(first.span.clone(), "it is stated here, too").help("state it in the same form everywhere"))
}

/// Reports a lower bound and an upper bound of different sections between which there is nothing.
fn excluded(net: &Net<'_>, arms: &[usize], name: &str) -> Option<Diagnostic> {
    let upper = twin(name).filter(|_| name.split('_').any(|word| word == "min"))?;
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

/// Reports an assignment on the command line that is looser than what the files state.
fn loosened(net: &Net<'_>, arms: &[usize], name: &str) -> Option<Diagnostic> {
    let is_set = |section: &&LimitSection| section.owner == LimitOwner::CommandLine;
    let (key, value) = net.limit_sections(arms).filter(is_set).find_map(|section| section.table.entry(name))?;
    let files = net.limit_sections(arms).filter(|section| !is_set(section));
    let stated = files.filter_map(|section| Some((section, section.table.get(name)?)));
    let (section, bound) = stated.into_iter().find(|(_, bound)| is_looser(name, value, bound))?;
    let message = format!("`--set` cannot loosen the limit `{}`, which {} states", key.name, section.owner.name());
    let diagnostic = Diagnostic::new(Code::LooseLimit, value.span.clone(), message);
    Some(diagnostic.note(bound.span.clone(), "the limit is here").help("change the limit in its file"))
}
