//! Checks that a mode sets only live parameters.

use crate::node::NodeSpec;
use crate::source::{Code, Diagnostic, Diagnostics, Table, quoted};

/// Reports each entry that a mode cannot set of a node, and removes it.
pub(crate) fn check(spec: &NodeSpec, node: &str, set: &mut Table, diagnostics: &mut Diagnostics) {
    let live = quoted(spec.params.iter().filter(|param| param.is_live).map(|param| param.name));
    set.entries.retain(|(key, _)| {
        let param = spec.params.iter().find(|param| param.name == key.name);
        let message = match (key.name.as_str(), param) {
            ("type" | "in", _) => format!("`{}` cannot change in a mode: a mode sets only parameters", key.name),
            (_, Some(param)) if !param.is_live => {
                format!("`{}` of `{node}` is fixed at load and cannot change in a mode", key.name)
            }
            _ => return true,
        };
        let help = match live.as_str() {
            "" => format!("no parameter of `{}` can change in a mode", spec.name),
            live => format!("a mode can set: {live}"),
        };
        diagnostics.push(Diagnostic::new(Code::NotLive, key.span.clone(), message).help(help));
        false
    });
}
