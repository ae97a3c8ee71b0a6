//! The wires of a block and of the section `[commands]`, before names are resolved.

use std::collections::BTreeSet;

use super::policy::{AgeLimit, WireTable};
use super::read::read_table;
use crate::node::{Param, Reader, Spanned};
use crate::source::{Key, Table, Value, suggest_name};

/// A wire: its input or command, and the port that it reads.
#[derive(Debug, Clone)]
pub(crate) struct WireEntry {
    pub(crate) key: Key,
    pub(crate) from: Spanned<String>,
    pub(crate) age: Option<AgeLimit>,
}

/// A wire to a command or a report of a role.
#[derive(Debug, Clone)]
pub(crate) struct CommandEntry {
    /// The task whose file has the wire.
    pub(crate) task: usize,
    /// The role of the graph, where the file names it.
    pub(crate) role: Key,
    pub(crate) wire: WireEntry,
}

/// The table `in` of a block.
#[derive(Debug, Clone, Default)]
pub(crate) struct InputWires {
    pub(crate) valid: Vec<WireEntry>,
    /// Inputs whose wire is invalid and has its own diagnostic.
    pub(super) invalid: Vec<Key>,
}

impl InputWires {
    /// Reads a table whose values are wires, each a port or a table with an age limit.
    pub(super) fn read(value: Option<&Value>, reader: &mut Reader) -> Self {
        let mut wires = Self::default();
        for (key, value) in read_table(value, reader).entries {
            let wire = match value.as_table() {
                Some(table) => aged_wire(&value, table, reader),
                None => Spanned::read(&value, reader).map(|from| (from, None)),
            };
            match wire {
                Some((from, age)) => wires.valid.push(WireEntry { key, from, age }),
                None => wires.invalid.push(key),
            }
        }
        wires
    }

    /// Returns whether a wire is invalid and has its own diagnostic.
    pub(crate) fn has_invalid(&self) -> bool {
        !self.invalid.is_empty()
    }

    /// Returns the only `required` input without a wire, if one wire leads to none of the `known` inputs: it was meant.
    pub(crate) fn only_lacks<'n>(
        &self,
        known: impl Iterator<Item = &'n str>,
        required: impl Iterator<Item = &'n str>,
    ) -> Option<&'n str> {
        let names: BTreeSet<&str> = known.collect();
        let keys = || self.valid.iter().map(|wire| &wire.key).chain(&self.invalid).map(|key| key.name.as_str());
        let wired: BTreeSet<&str> = keys().collect();
        let strange = keys().filter(|key| !names.contains(key)).count();
        let mut open = required.filter(|name| !wired.contains(name));
        open.next().filter(|_| strange == 1 && open.next().is_none())
    }

    /// Returns the `known` inputs that have no wire. A wire to a misspelt name counts, since it has its own diagnostic.
    pub(crate) fn lacking<'n>(&self, known: impl Iterator<Item = &'n str> + Clone) -> BTreeSet<&'n str> {
        let names: BTreeSet<&str> = known.clone().collect();
        let keys = || self.valid.iter().map(|wire| &wire.key).chain(&self.invalid).map(|key| key.name.as_str());
        let wired: BTreeSet<&str> = keys().collect();
        let mut lacking = names.clone();
        lacking.retain(|name| !wired.contains(name));
        for strange in keys().filter(|key| !names.contains(key)) {
            if lacking.is_empty() {
                break;
            }
            suggest_name(strange, known.clone()).map(|meant| lacking.remove(meant));
        }
        lacking
    }
}

/// Reads a wire with an age limit.
fn aged_wire(value: &Value, table: &Table, reader: &mut Reader) -> Option<(Spanned<String>, Option<AgeLimit>)> {
    if let Some(wire) = WireTable::read(value, reader) {
        let age = AgeLimit::of(&wire);
        return Some((wire.from, Some(age)));
    }
    // The table has a diagnostic; its port is still resolved, to report a second mistake there.
    let from = table.get("from")?;
    Some((Spanned { value: from.as_str()?.to_owned(), span: from.span.clone() }, None))
}
