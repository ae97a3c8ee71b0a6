//! Checks that [policy] names only declared roles.

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Value};

/// Reports each role in `policy.roles` that the graph does not declare.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    let Some((section, _)) = &net.flat.policy else { return };
    let roles = section.as_table().and_then(|table| table.get("roles")).and_then(Value::as_table);
    for (key, _) in roles.iter().flat_map(|table| &table.entries) {
        if net.flat.roles.position(&key.name).is_none() {
            let known = net.flat.roles.names();
            diagnostics.push(Diagnostic::unknown(Code::UnknownKey, "role", &key.name, &key.span, known));
        }
    }
}
