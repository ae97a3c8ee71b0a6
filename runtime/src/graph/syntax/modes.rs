//! Parses a block `[modes.NAME]`, before names are resolved.

use std::ops::Range;
use std::slice;

use super::correct::{correct_facts, correct_keys};
use super::read::{read_table, read_word};
use crate::node::{Amount, Param, Reader, Spanned};
use crate::source::{Diagnostic, Item, Key, Table, Value};

/// A mode: the parameters it sets and its exits.
#[derive(Debug, Clone)]
pub(crate) struct ModeBlock {
    /// The task of which it is a mode.
    pub(crate) task: usize,
    pub(crate) key: Key,
    /// The block as written.
    pub(crate) table: Table,
    /// Values that override those of the nodes.
    pub(crate) set: Table,
    pub(crate) exits: Vec<ModeExit>,
}

impl ModeBlock {
    /// Returns the target modes of the exits as they are written, so also of exits with a mistake.
    pub(crate) fn written_targets(&self) -> impl Iterator<Item = &Value> {
        let exits = self.table.entries.iter().flat_map(|(_, value)| match &value.item {
            Item::Array(items) => items,
            _ => slice::from_ref(value),
        });
        exits.filter_map(|exit| exit.as_table()?.get("to"))
    }

    /// Returns whether the block has one of the diagnostics, so that an exit may be missing.
    pub(crate) fn has_any(&self, diagnostics: &[Diagnostic]) -> bool {
        let holds = |(key, value): &(Key, Value), span: &Range<usize>| {
            key.span.start <= span.start && span.end <= value.span.end.max(key.span.end)
        };
        diagnostics.iter().any(|diagnostic| self.table.entries.iter().any(|entry| holds(entry, &diagnostic.span)))
    }
}

/// An exit of a mode.
#[derive(Debug, Clone)]
pub(crate) struct ModeExit {
    pub(crate) kind: ExitKind,
    pub(crate) span: Range<usize>,
    pub(crate) table: ExitTable,
}

/// What an exit of a mode does. If several exits hold in one tick, the first of these kinds wins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Param)]
pub(crate) enum ExitKind {
    /// Ends the run with a fault.
    Fail,
    /// Goes to another mode because a signal is lost.
    OnLost,
    /// Ends the run.
    Done,
    /// Goes to another mode.
    Go,
}

impl ExitKind {
    /// Returns the key in the block of a mode.
    pub(crate) const fn key(self) -> &'static str {
        Self::CONTENTS.words[self as usize].0
    }
}

/// The state of a port that a condition requires with `is`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PortState {
    New,
    Absent,
    Present,
    True,
    False,
}

impl PortState {
    const WORDS: [(&'static str, Self); 5] = [
        ("new", Self::New),
        ("absent", Self::Absent),
        ("present", Self::Present),
        ("true", Self::True),
        ("false", Self::False),
    ];

    /// Returns the word in a graph file.
    pub(crate) fn word(self) -> &'static str {
        Self::WORDS.iter().find(|(_, state)| *state == self).map_or("", |(word, _)| word)
    }
}

impl Param for PortState {
    const EXPECTS: &'static str = "`new`, `absent`, `present`, `true` or `false`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        read_word(value, &Self::WORDS, Self::EXPECTS, reader)
    }
}

/// The table of an exit: its condition and its target.
#[derive(Debug, Clone, Param)]
pub(crate) struct ExitTable {
    /// Mode to go to.
    pub(crate) to: Option<Spanned<String>>,
    /// Port to watch: `node.port` or `node.port.feature`. A flag must be true unless `is` is given.
    pub(crate) when: Option<Spanned<String>>,
    /// Required state of the port.
    pub(crate) is: Option<PortState>,
    /// Lower bound of the port.
    #[param(unit = "_")]
    pub(crate) above: Option<Amount>,
    /// Upper bound of the port.
    #[param(unit = "_")]
    pub(crate) below: Option<Amount>,
    /// Upper bound of the absolute value of the port.
    #[param(unit = "_", above = 0.0)]
    pub(crate) within: Option<Amount>,
    /// How far the port may cross back over a bound before the condition ends.
    #[param(unit = "_", range = 0.0..)]
    pub(crate) hysteresis: Option<Amount>,
    /// How long the condition must hold, counted from new sample to new sample.
    #[param(unit = "ms", range = 0.0..=3.6e6)]
    pub(crate) for_ms: Option<f64>,
    /// Time in the mode; for `on_lost`, how long the signal must be lost. The default of `on_lost` is five periods of
    /// the slowest device behind the signal.
    #[param(unit = "ms", range = 0.001..=3.6e6)]
    pub(crate) after_ms: Option<f64>,
    /// Distance that the sensor travels in the mode.
    #[param(unit = "mm", range = 0.001..=1e4, usual = 0.1..=5000.0)]
    pub(crate) after_travel_mm: Option<f64>,
    /// Signal that `on_lost` watches; for `after_travel_mm`, the pose to measure if the graph has several.
    pub(crate) of: Option<Spanned<String>>,
    /// Operator word that triggers the exit.
    pub(crate) on: Option<Spanned<String>>,
    /// Priority among `go` exits that hold at once: the greatest wins.
    pub(crate) priority: Option<u64>,
}

impl ExitTable {
    /// Returns the numbers in the unit of the port.
    pub(crate) fn amounts_mut(&mut self) -> impl Iterator<Item = &mut Amount> {
        [&mut self.above, &mut self.below, &mut self.within, &mut self.hysteresis].into_iter().flatten()
    }
}

/// Reads the block of a mode.
pub(super) fn read_mode(key: Key, mut table: Table, reader: &mut Reader<'_>) -> ModeBlock {
    correct_keys(&mut table, &["set", "go", "on_lost", "done", "fail"], " in a mode", reader);
    let whole = table.clone();
    let mut set = table.remove("set");
    set.iter_mut().for_each(|(_, value)| correct_facts(value, reader));
    let set = read_table(set.as_ref().map(|(_, value)| value), reader);
    let mut exits = Vec::new();
    for kind in [ExitKind::Fail, ExitKind::OnLost, ExitKind::Done, ExitKind::Go] {
        let Some((_, value)) = table.remove(kind.key()) else { continue };
        match &value.item {
            Item::Array(items) if kind != ExitKind::OnLost => {
                items.iter().for_each(|item| exits.extend(read_exits(kind, item, reader)));
            }
            _ => exits.extend(read_exits(kind, &value, reader)),
        }
    }
    ModeBlock { task: 0, key, table: whole, set, exits }
}

/// Reads the exits of one table. `after_ms` and `after_travel_mm` together make two exits, one for each.
fn read_exits(kind: ExitKind, value: &Value, reader: &mut Reader<'_>) -> Vec<ModeExit> {
    let before = reader.mistakes.len();
    let table = ExitTable::read(value, reader);
    // After an unknown key, the condition may be incomplete.
    let is_complete = reader.mistakes[before..].iter().all(|mistake| mistake.instead.is_some());
    let Some(table) = table.filter(|_| is_complete) else { return Vec::new() };
    let exit = |table| ModeExit { kind, span: value.span.clone(), table };
    if table.after_ms.is_none() || table.after_travel_mm.is_none() {
        return vec![exit(table)];
    }
    let time = ExitTable { after_travel_mm: None, of: None, ..table.clone() };
    vec![exit(time), exit(ExitTable { after_ms: None, ..table })]
}
