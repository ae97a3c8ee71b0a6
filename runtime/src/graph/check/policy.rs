//! Checks that [policy] names only declared roles.

use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Value};

/// Reports each role in `policy.roles` that the graph does not declare.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    let Some((section, _)) = &net.flat.policy else { return };
    let roles = section.as_table().and_then(|table| table.get("roles")).and_then(Value::as_table);
    for (key, _) in roles.iter().flat_map(|table| &table.entries) {
        if !net.flat.role_names().any(|role| role == key.name) {
            let message = format!("there is no role `{}`", key.name);
            let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
            diagnostics.push(diagnostic.suggest(&key.name, net.flat.role_names(), "roles"));
        }
    }
}
