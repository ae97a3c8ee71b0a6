//! Checks that [policy] names only declared roles.

use crate::graph::load::{Entity, Task};
use crate::graph::net::Net;
use crate::source::{Code, Diagnostic, Diagnostics, Value};

/// Reports each role in `policy.roles` that the file of the task does not declare.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) {
    net.flat.tasks.iter().for_each(|task| check_task(net, task, diagnostics));
}

fn check_task(net: &Net<'_>, task: &Task, diagnostics: &mut Diagnostics) {
    let Some((section, _)) = &task.policy else { return };
    let names = &net.flat.scopes[task.scope].names;
    let known =
        || names.iter().filter(|(_, (_, entity))| matches!(entity, Entity::Role(_))).map(|(name, _)| name.as_str());
    let roles = section.as_table().and_then(|table| table.get("roles")).and_then(Value::as_table);
    for (key, _) in roles.iter().flat_map(|table| &table.entries) {
        if !known().any(|name| name == key.name) {
            diagnostics.push(Diagnostic::unknown(Code::UnknownKey, "role", &key.name, &key.span, known()));
        }
    }
}
