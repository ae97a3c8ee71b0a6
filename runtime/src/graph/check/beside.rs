//! Checks that every input of a node that computes beside the tick has a wire.

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports each input without a wire. A wire to an unknown input may be meant for it, and has its own diagnostic.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for (index, (key, _)) in net.flat.roles.iter().enumerate().filter(|(index, _)| net.is_beside(*index)) {
        let written = || net.flat.commands.iter().filter(|entry| entry.role.name == key.name);
        let reports = net.roles[index].iter().flat_map(|role| &role.reports);
        let is_known = |name: &str| reports.clone().any(|report| report.name == name);
        if !written().all(|entry| is_known(&entry.wire.key.name)) {
            continue;
        }
        for report in reports.clone().filter(|report| report.need.must_be_wired) {
            if !written().any(|entry| entry.wire.key.name == report.name) {
                let message = format!("`{}` needs a wire to `in.{}`", key.name, report.name);
                let help = format!("wire {} to it: `in.{} = \"node.port\"`", report.kind.with_article(), report.name);
                diagnostics.push(Diagnostic::new(Code::MissingInput, key.span.clone(), message).help(help));
            }
        }
    }
}
