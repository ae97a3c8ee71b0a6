//! The section `[live]`: the parameters that may change while the graph runs, each with its range and its rate.

use super::reserved::LIVE;
use super::sections::Sections;
use crate::node::{Param, Spanned};
use crate::source::{Item, Key, Table, Value};

/// An entry of `[live]`, before its name is resolved.
#[derive(Debug, Clone)]
pub(crate) struct LiveEntry {
    /// Name `node.param` with the place of its last word.
    pub(crate) name: Spanned<String>,
    pub(crate) range: LiveRange,
}

/// The range of a parameter that may change while the graph runs.
#[derive(Debug, Clone, Param)]
pub(crate) struct LiveRange {
    /// Smallest value, in the unit of the parameter.
    pub(crate) min: Spanned<f64>,
    /// Largest value, in the unit of the parameter.
    pub(crate) max: Spanned<f64>,
    /// Largest change in one second, in the unit of the parameter.
    #[param(above = 0.0)]
    pub(crate) rate: f64,
}

impl Sections<'_> {
    /// Reads the section [live] of a graph, or of a part whose nodes have names with a prefix. A name may be quoted or
    /// not: its dots separate words in both cases.
    pub(crate) fn live(&mut self, root: &Table, prefix: &str) -> Vec<LiveEntry> {
        let mut entries = Vec::new();
        match root.get(LIVE).map(|value| (value, &value.item)) {
            None => {}
            Some((_, Item::Table(table))) => self.live_entries(prefix, table, &mut entries),
            Some((value, _)) => {
                self.reader.wrong_type::<()>(value, "a table");
            }
        }
        entries
    }

    fn live_entries(&mut self, prefix: &str, table: &Table, entries: &mut Vec<LiveEntry>) {
        for (key, value) in &table.entries {
            let name = format!("{prefix}{}", key.name);
            match value.as_table() {
                Some(inner) if is_prefix(inner) => self.live_entries(&format!("{name}."), inner, entries),
                _ => self.live_entry(name, key, value, entries),
            }
        }
    }

    fn live_entry(&mut self, name: String, key: &Key, value: &Value, entries: &mut Vec<LiveEntry>) {
        let Some(range) = LiveRange::read(value, &mut self.reader) else { return };
        if range.min.value >= range.max.value {
            let message = format!("`min` of `{name}` is not smaller than its `max`");
            self.reader.bad::<()>(range.min.span, message);
            return;
        }
        entries.push(LiveEntry { name: Spanned { value: name, span: key.span.clone() }, range });
    }
}

/// Whether a table is the first part of a dotted name, and not a range.
fn is_prefix(table: &Table) -> bool {
    !table.entries.is_empty() && table.entries.iter().all(|(_, value)| value.as_table().is_some())
}
