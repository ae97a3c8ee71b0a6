//! Checks that [limits] and the parameters that read from it agree.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::load::FlatGraph;
use crate::graph::net::Net;
use crate::graph::syntax::LIMITS;
use crate::node::ParamSpec;
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// A reference to a value of the section, as `{ from = "limits.KEY" }`.
struct LimitRef<'a> {
    key: String,
    span: Range<usize>,
    /// The parameter that uses it.
    spec: Option<&'a ParamSpec>,
    is_optional: bool,
}

/// Reports values that no node uses, values in another unit than their parameter, and missing values.
///
/// While a limiter is missing, an unused value may belong to it and is not reported.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    let is_limited = diagnostics.iter().all(|diagnostic| diagnostic.code != Code::UnlimitedCommand);
    let mut refs = Vec::new();
    for (i, node) in net.flat.nodes.iter().enumerate() {
        let specs = net.spec(i).map_or(&[][..], |spec| &spec.params);
        let entries = node.block.params.as_table().into_iter().flat_map(|table| &table.entries);
        for (key, value) in entries {
            let spec = specs.iter().find(|spec| spec.name == key.name);
            let limits = value.facts().into_iter().filter_map(|fact| match fact.word.split_once('.')? {
                (LIMITS, key) => {
                    let (key, span) = (key.to_owned(), fact.place.clone());
                    Some(LimitRef { key, span, spec, is_optional: fact.is_optional })
                }
                _ => None,
            });
            refs.extend(limits);
        }
    }
    let given = || net.flat.limits.iter().flat_map(|(_, table)| &table.entries);
    let names: BTreeSet<&str> = refs.iter().map(|limit| limit.key.as_str()).collect();
    for (key, _) in given().filter(|(key, _)| is_limited && !names.contains(key.name.as_str())) {
        let message = format!("no node uses the limit `{}`", key.name);
        let missing: Vec<&str> =
            names.iter().copied().filter(|name| !given().any(|(key, _)| key.name == *name)).collect();
        let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
        diagnostics.push(match missing.is_empty() {
            true => diagnostic.help("remove it"),
            false => diagnostic.suggest(&key.name, missing.into_iter(), "missing limits"),
        });
    }
    diagnostics.extend(refs.iter().filter_map(unit_mismatch));
    diagnostics.extend(missing(net.flat, &refs));
}

/// Reports all missing values in one diagnostic.
fn missing(flat: &FlatGraph, refs: &[LimitRef<'_>]) -> Option<Diagnostic> {
    let mut seen = BTreeSet::new();
    let is_given = |key: &str| flat.limits.as_ref().is_some_and(|(_, table)| table.get(key).is_some());
    let missing: Vec<&LimitRef<'_>> = refs
        .iter()
        .filter(|limit| !limit.is_optional && !is_given(&limit.key) && seen.insert(limit.key.as_str()))
        .collect();
    let first = missing.first()?;
    let lines = missing.iter().map(|limit| {
        let doc = limit.spec.map(ParamSpec::doc_with_unit).unwrap_or_default();
        format!("\n{} = …   # {}", limit.key, doc.trim_end_matches('.'))
    });
    let names = quoted(missing.iter().map(|limit| &limit.key));
    let (span, message) = match &flat.limits {
        Some((span, _)) => (span.clone(), format!("[limits] lacks {names}")),
        None => (flat.place.clone(), format!("the graph has no section [limits]; it needs {names}")),
    };
    let diagnostic = Diagnostic::new(Code::MissingLimit, span, message).note(first.span.clone(), "used here");
    Some(diagnostic.help(format!("add under [limits]:{}", lines.collect::<String>())))
}

/// Reports a value whose name ends with another unit than that of its parameter.
fn unit_mismatch(limit: &LimitRef<'_>) -> Option<Diagnostic> {
    const UNITS: [(&str, &str); 7] = [
        ("_m_per_s2", "m/s²"),
        ("_rad_per_s2", "rad/s²"),
        ("_m_per_s", "m/s"),
        ("_rad_per_s", "rad/s"),
        ("_n", "N"),
        ("_rad", "rad"),
        ("_m", "m"),
    ];
    let (_, has) = UNITS.iter().find(|(end, _)| limit.key.ends_with(end))?;
    let spec = limit.spec?;
    let takes = spec.unit.as_deref()?.split(';').next()?.trim();
    let is_known = UNITS.iter().any(|(_, unit)| *unit == takes);
    let message = format!("`{}` is in {has}, but `{}` takes {takes}", limit.key, spec.name);
    (is_known && takes != *has).then(|| Diagnostic::new(Code::UnitMismatch, limit.span.clone(), message))
}
