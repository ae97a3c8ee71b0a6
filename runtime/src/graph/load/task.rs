//! Tasks: the graph itself, and each part with roles, modes, commands or limits of its own.

use std::ops::Range;

use crate::graph::syntax::{GraphTable, PolicyTable};
use crate::source::{Code, Diagnostic, Value};

/// The graph itself, or a part that is a task.
#[derive(Debug, Default)]
pub(crate) struct Task {
    /// Its full name with a dot behind it; empty for the graph itself.
    pub(crate) prefix: String,
    /// The task that contains it; `None` for the graph itself.
    pub(crate) parent: Option<usize>,
    /// The scope of its file.
    pub(crate) scope: usize,
    /// The section [graph], if it is there and valid.
    pub(crate) table: Option<GraphTable>,
    /// The section [graph] as written.
    pub(crate) settings: Option<Value>,
    /// Span for diagnostics about the task as a whole.
    pub(crate) place: Range<usize>,
    /// The roles of the graph that its file declares.
    pub(crate) roles: Vec<usize>,
    /// The section [policy] as written, and parsed if it is valid.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    /// Whether it has modes.
    pub(crate) has_modes: bool,
    /// Whether its failure ends the run.
    pub(crate) ends_run: bool,
}

impl Task {
    /// Returns the name of the task, which is empty for the graph itself.
    pub(crate) fn name(&self) -> &str {
        self.prefix.strip_suffix('.').unwrap_or_default()
    }

    /// Returns whether a setting of the section [graph] is unknown or wrong: a missing one may be the one that was meant, or
    /// be lost with it.
    pub(crate) fn has_wrong_setting(&self, diagnostics: &[Diagnostic]) -> bool {
        let entries = || self.settings.iter().filter_map(Value::as_table).flat_map(|table| &table.entries);
        let is_unknown =
            |found: &Diagnostic| found.code == Code::UnknownKey && entries().any(|(key, _)| key.span == found.span);
        let is_in_value = |found: &Diagnostic| entries().any(|(_, value)| value.span.contains(&found.span.start));
        diagnostics.iter().any(|found| is_unknown(found) || self.table.is_none() && is_in_value(found))
    }
}
