//! Checks that every command of a role has a wire.

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Edit, Key};

/// Reports each command that nothing drives.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    for ((key, _), role) in net.flat.roles.iter().zip(&net.roles) {
        for command in role.iter().flat_map(|role| &role.commands) {
            let is_driven = |role: &Key, driven: &Key| role.name == key.name && driven.name == command.name;
            // A wire to an unknown role or command has its own diagnostic, and may be meant for this one.
            let is_misspelt = |role: &Key, driven: &Key| {
                let roles = || net.flat.roles.iter().zip(&net.roles).filter(|((key, _), _)| key.name == role.name);
                let mut ports =
                    roles().filter_map(|(_, kind)| *kind).flat_map(|kind| kind.commands.iter().chain(&kind.reports));
                !ports.any(|port| port.name == driven.name) && (role.name == key.name || roles().next().is_none())
            };
            if !net.flat.commands.iter().any(|(role, wire)| is_driven(role, &wire.key) || is_misspelt(role, &wire.key))
            {
                let message = format!("nothing drives `{}.{}`", key.name, command.name);
                let diagnostic = Diagnostic::new(Code::UndrivenCommand, key.span.clone(), message);
                diagnostics.push(match net.find_candidate(0, usize::MAX, command) {
                    Some(port) => {
                        let line = format!("{}.{} = \"{port}\"", key.name, command.name);
                        let edit = match net.flat.commands.last() {
                            Some((_, wire)) => Edit::Below(wire.key.span.clone(), line.clone()),
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
