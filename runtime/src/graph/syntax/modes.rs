//! Parses a block `[modes.NAME]`, before names are resolved.

use std::ops::Range;

use crate::node::{At, Mistake, Param, Reader, Spanned};
use crate::source::{Code, Item, Key, Table, Value, suggestion};

/// A mode: the parameters it sets and its exits.
#[derive(Debug, Clone)]
pub(crate) struct ModeBlock {
    pub(crate) key: Key,
    /// The block as written.
    pub(crate) table: Table,
    /// Values that override those of the nodes.
    pub(crate) set: Table,
    /// Its exits, each with its kind and its span.
    pub(crate) exits: Vec<(ExitKind, Range<usize>, Exit)>,
}

/// What an exit of a mode does. If several exits hold in one tick, the first of these kinds wins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
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
        match self {
            Self::Fail => "fail",
            Self::OnLost => "on_lost",
            Self::Done => "done",
            Self::Go => "go",
        }
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
}

impl Param for PortState {
    const EXPECTS: &'static str = "`new`, `absent`, `present`, `true` or `false`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let word = match &value.item {
            Item::Boolean(is) => {
                if *is {
                    "true"
                } else {
                    "false"
                }
            }
            _ => value.as_str().unwrap_or_default(),
        };
        let state = Self::WORDS.iter().find(|(known, _)| *known == word).map(|(_, is)| *is);
        if state.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        state
    }
}

/// An exit of a mode: its condition and its target.
#[derive(Debug, Clone, Param)]
pub(crate) struct Exit {
    /// Mode to go to.
    pub(crate) to: Option<Spanned<String>>,
    /// Port to watch: `node.port` or `node.port.feature`. A flag must be true unless `is` is given.
    pub(crate) when: Option<Spanned<String>>,
    /// Required state of the port.
    pub(crate) is: Option<PortState>,
    /// Lower bound of the port.
    #[param(unit = "_")]
    pub(crate) above: Option<f64>,
    /// Upper bound of the port.
    #[param(unit = "_")]
    pub(crate) below: Option<f64>,
    /// Upper bound of the absolute value of the port.
    #[param(unit = "_", above = 0.0)]
    pub(crate) within: Option<f64>,
    /// How far the port may cross back over a bound before the condition ends.
    #[param(unit = "_", range = 0.0..)]
    pub(crate) hysteresis: Option<f64>,
    /// How long the condition must hold, counted from new sample to new sample.
    #[param(unit = "ms", range = 0.0..)]
    pub(crate) for_ms: Option<f64>,
    /// Time in the mode; for `on_lost`, how long the signal must be lost. The default of `on_lost` is five periods of the graph.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) after_ms: Option<f64>,
    /// Distance that the sensor travels in the mode.
    #[param(unit = "mm", above = 0.0)]
    pub(crate) after_travel_mm: Option<f64>,
    /// Signal that `on_lost` watches; for `after_travel_mm`, the pose to measure if the graph has several.
    pub(crate) of: Option<Spanned<String>>,
    /// Operator word that triggers the exit.
    pub(crate) on: Option<Spanned<String>>,
    /// Priority among `go` exits that hold at once: the greatest wins.
    pub(crate) priority: Option<u64>,
}

/// Reads the modes of a graph file.
pub(crate) fn read_modes(tables: Vec<(Key, Table)>, reader: &mut Reader<'_>) -> Vec<ModeBlock> {
    tables.into_iter().map(|(key, table)| read_mode(key, table, reader)).collect()
}

fn read_mode(key: Key, mut table: Table, reader: &mut Reader<'_>) -> ModeBlock {
    let whole = table.clone();
    let set = match table.remove("set") {
        Some((_, Value { item: Item::Table(set), .. })) => set,
        Some((_, value)) => {
            reader.wrong_type(&value, "a table");
            Table::default()
        }
        None => Table::default(),
    };
    let mut exits = Vec::new();
    for kind in [ExitKind::Fail, ExitKind::OnLost, ExitKind::Done, ExitKind::Go] {
        let Some((_, value)) = table.remove(kind.key()) else { continue };
        let several = matches!(kind, ExitKind::Go | ExitKind::Done | ExitKind::Fail);
        match &value.item {
            Item::Array(items) if several => items.iter().for_each(|item| exits.extend(read_exits(kind, item, reader))),
            _ => exits.extend(read_exits(kind, &value, reader)),
        }
    }
    for (other, _) in table.entries {
        let message = format!("unknown key `{}` in a mode", other.name);
        let help = suggestion(&other.name, ["set", "go", "on_lost", "done", "fail"].into_iter(), "keys");
        reader.mistakes.push(Mistake::new(Code::UnknownKey, At::Span(other.span), message).help(help));
    }
    ModeBlock { key, table: whole, set, exits }
}

/// Reads the exits of one table. `after_ms` and `after_travel_mm` together make two exits, one for each.
fn read_exits(kind: ExitKind, value: &Value, reader: &mut Reader<'_>) -> Vec<(ExitKind, Range<usize>, Exit)> {
    let Some(exit) = Exit::read(value, reader) else { return Vec::new() };
    let span = value.span.clone();
    if exit.after_ms.is_none() || exit.after_travel_mm.is_none() {
        return vec![(kind, span, exit)];
    }
    let time = Exit { after_travel_mm: None, of: None, ..exit.clone() };
    vec![(kind, span.clone(), time), (kind, span, Exit { after_ms: None, ..exit })]
}
