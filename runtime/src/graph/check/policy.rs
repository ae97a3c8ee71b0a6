//! Policies of roles that the graph does not declare.

use crate::source::{Code, Diagnostic, Value};

/// Policies of roles that are not there.
pub(crate) fn unknown_roles<'n>(
    section: &Value,
    roles: impl Iterator<Item = &'n str> + Clone,
    found: &mut Vec<Diagnostic>,
) {
    let own = section.as_table().and_then(|table| table.get("roles")).and_then(Value::as_table);
    for (key, _) in own.iter().flat_map(|table| &table.entries) {
        if !roles.clone().any(|role| role == key.name) {
            let message = format!("there is no role `{}` to have a policy", key.name);
            found.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).suggest(
                &key.name,
                roles.clone(),
                "roles",
            ));
        }
    }
}
