//! Checks that every command of a role has a wire.

use std::collections::BTreeSet;

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Edit};

/// Reports each command that nothing drives.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    let wires = net.flat.commands.iter().map(|entry| (entry.role.name.as_str(), entry.wire.key.name.as_str()));
    let driven: BTreeSet<(&str, &str)> = wires.clone().collect();
    // A wire to an unknown role or command, or to one that has a wire, has its own diagnostic, and may be meant for any
    // that has none.
    let has_misspelt_role =
        net.has_two_drivers() || driven.iter().any(|(role, _)| net.flat.roles.position(role).is_none());
    let has_port = |(role, port): &(&str, &str)| {
        let kind = net.flat.roles.position(role).and_then(|role| net.roles[role]);
        kind.is_some_and(|kind| kind.commands.iter().chain(&kind.reports).any(|known| known.name == *port))
    };
    let misspelt: BTreeSet<&str> = wires.filter(|wire| !has_port(wire)).map(|(role, _)| role).collect();
    for ((key, kind), role) in net.flat.roles.iter().zip(&net.roles) {
        if has_misspelt_role || misspelt.contains(&*key.name) {
            continue;
        }
        for command in role.iter().flat_map(|role| &role.commands) {
            if !driven.contains(&(&*key.name, &*command.name)) {
                let message = format!("nothing drives `{}.{}`", key.name, command.name);
                let diagnostic = Diagnostic::new(Code::UndrivenCommand, key.span.clone(), message);
                // With two arms, the port of that name may move the other one.
                let is_only = net.flat.roles.iter().filter(|(_, other)| other.value == kind.value).count() == 1;
                diagnostics.push(match net.find_candidate(0, None, command).filter(|_| is_only) {
                    Some(port) => {
                        let line = format!("{}.{} = \"{port}\"", key.name, command.name);
                        let last = net.flat.commands.last().map(|entry| &entry.wire.key.span);
                        let edit = match last.or(net.flat.empty_commands.as_ref()) {
                            Some(span) => Edit::Below(span.clone(), line.clone()),
                            None => Edit::Append(key.span.clone(), format!("\n[commands]\n{line}")),
                        };
                        diagnostic.help(format!("add `{line}` under [commands]")).edit(edit)
                    }
                    None => diagnostic.help(format!("wire {} to it under [commands]", command.kind.with_article())),
                });
            }
        }
    }
}
