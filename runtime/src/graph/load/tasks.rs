//! Adds the tasks to the flat graph: the roles, commands, modes and limits of a file, under the names of the graph.

use super::flat::{FlatGraph, Scope};
use super::loader::Loader;
use super::task::Task;
use crate::graph::syntax::{Allowance, CommandEntry, GraphDocument, LimitSection, ModeBlock, NO_ARM, WireEntry};
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Key};

impl Loader {
    /// Adds the task of a document, whose file has that scope, and moves the sections of the task there.
    pub(super) fn add_task(&mut self, document: &GraphDocument, mut task: Task, scope: &Scope, flat: &mut FlatGraph) {
        let number = flat.tasks.len();
        let outer = |name: &str| scope.roles.get(name).map_or(name, String::as_str).to_owned();
        let named = |key: &Key| Key { name: outer(&key.name), span: key.span.clone() };
        if let Some((span, table)) = &document.graph {
            (task.place, task.table) = (span.clone(), table.clone());
        }
        task.policy.clone_from(&document.policy);
        task.roles = document.roles.names().filter_map(|name| flat.roles.position(&outer(name))).collect();
        task.has_modes = !document.modes.is_empty();
        self.add_carriers(document, &outer, flat);
        let command =
            |(role, wire): &(Key, WireEntry)| CommandEntry { task: number, role: named(role), wire: wire.clone() };
        flat.commands.extend(document.commands.iter().map(command));
        if number == 0 {
            flat.empty_commands.clone_from(&document.empty_commands);
        }
        flat.modes.extend(document.modes.iter().map(|mode| ModeBlock { task: number, ..mode.clone() }));
        flat.limits.extend(document.limits.iter().map(|section| LimitSection {
            task: number,
            role: section.role.as_ref().map(named),
            ..section.clone()
        }));
        let within = (number > 0).then(|| scope.text.clone());
        flat.allow.extend(document.allow.iter().map(|entry| Allowance { within: within.clone(), ..entry.clone() }));
        flat.tasks.push(task);
    }

    /// Adds the arms that the sensors of a document are on, unless the file around it says it.
    fn add_carriers(&mut self, document: &GraphDocument, outer: &dyn Fn(&str) -> String, flat: &mut FlatGraph) {
        for (key, on) in document.carriers.iter() {
            let (sensor, arm) =
                (outer(&key.name), if on.value == NO_ARM { on.value.clone() } else { outer(&on.value) });
            match flat.carriers.get(&sensor) {
                Some(known) if known.value != arm => {
                    let message =
                        format!("`{sensor}` is on `{arm}` here, and on `{}` in the file around it", known.value);
                    let diagnostic = Diagnostic::new(Code::WrongRole, on.span.clone(), message);
                    let help = "name the role of another sensor or arm under `roles` of the part";
                    self.diagnostics.push(diagnostic.note(known.span.clone(), "there").help(help));
                }
                Some(_) => {}
                None => {
                    let key = Key { name: sensor, span: key.span.clone() };
                    flat.carriers.push(key, Spanned { value: arm, span: on.span.clone() });
                }
            }
        }
    }
}
