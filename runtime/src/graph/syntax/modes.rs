//! What a block `[modes.NAME]` says, before anything is looked up.

use std::ops::Range;

use crate::node::{At, Mistake, NonNegative, Param, Positive, Reader, Word};
use crate::source::{Code, Item, Key, Table, Value};

/// A mode: what it sets, and what ends it.
#[derive(Debug, Clone)]
pub(crate) struct ModeBlock {
    pub(crate) key: Key,
    /// The block as it is written.
    pub(crate) table: Table,
    /// Values laid over those of the nodes.
    pub(crate) set: Table,
    /// What ends it, with its sort and its place.
    pub(crate) exits: Vec<(Sort, Range<usize>, Exit)>,
}

/// What an exit of a mode does. In one tick the first of these wins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sort {
    /// Ends the run with a fault.
    Fail,
    /// Goes to another mode because a signal is lost.
    OnLost,
    /// Ends the run.
    Done,
    /// Goes to another mode.
    Go,
}

impl Sort {
    /// Its key in a mode.
    pub(crate) const fn key(self) -> &'static str {
        match self {
            Self::Fail => "fail",
            Self::OnLost => "on_lost",
            Self::Done => "done",
            Self::Go => "go",
        }
    }
}

/// What a condition asks of a port beside a bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Is {
    New,
    Absent,
    Present,
    True,
    False,
}

impl Is {
    const WORDS: [(&'static str, Self); 5] = [
        ("new", Self::New),
        ("absent", Self::Absent),
        ("present", Self::Present),
        ("true", Self::True),
        ("false", Self::False),
    ];
}

impl Param for Is {
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
        let found = Self::WORDS.iter().find(|(known, _)| *known == word).map(|(_, is)| *is);
        if found.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        found
    }
}

crate::params! { Exit:
    /// Mode to go to.
    to: Option<Word>,
    /// Port that is looked at: `node.port`, or `node.port.feature`; a flag has to be set.
    when: Option<Word>,
    /// What it has to be.
    is: Option<Is>,
    /// It has to be greater [its unit].
    above: Option<f64>,
    /// It has to be less [its unit].
    below: Option<f64>,
    /// Its size has to be less [its unit].
    within: Option<Positive>,
    /// How far it may fall back behind the bound before it counts as fallen back [its unit].
    hysteresis: Option<NonNegative>,
    /// How long that has to last, through new samples [ms].
    for_ms: Option<NonNegative>,
    /// Time in the mode; for `on_lost` how long the signal has to be away, five periods of the graph unless given [ms].
    after_ms: Option<Positive>,
    /// Way of the sensor in the mode [mm].
    after_travel_mm: Option<Positive>,
    /// Signal that `on_lost` watches; for a way the pose that is meant, if there are several.
    of: Option<Word>,
    /// Word from outside that is waited for.
    on: Option<Word>,
    /// Which of two that hold at once wins: the greater.
    priority: Option<u64>,
}

/// The modes of a graph file.
pub(crate) fn modes(tables: Vec<(Key, Table)>, reader: &mut Reader<'_>) -> Vec<ModeBlock> {
    tables.into_iter().map(|(key, table)| mode(key, table, reader)).collect()
}

fn mode(key: Key, mut table: Table, reader: &mut Reader<'_>) -> ModeBlock {
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
    for sort in [Sort::Fail, Sort::OnLost, Sort::Done, Sort::Go] {
        let Some((_, value)) = table.remove(sort.key()) else { continue };
        let several = matches!(sort, Sort::Go | Sort::Done | Sort::Fail);
        match &value.item {
            Item::Array(items) if several => items.iter().for_each(|item| exits.extend(exit(sort, item, reader))),
            _ => exits.extend(exit(sort, &value, reader)),
        }
    }
    for (other, _) in table.entries {
        let message = format!("`{}` means nothing in a mode", other.name);
        let help = crate::source::closest(&other.name, ["set", "go", "on_lost", "done", "fail"].into_iter(), "keys");
        reader.mistakes.push(Mistake::new(Code::UnknownKey, At::Span(other.span), message).help(help));
    }
    ModeBlock { key, table: whole, set, exits }
}

/// The exits of one table: a bound on the time and one on the way may stand together, and the first of them counts.
fn exit(sort: Sort, value: &Value, reader: &mut Reader<'_>) -> Vec<(Sort, Range<usize>, Exit)> {
    let Some(exit) = Exit::read(value, reader) else { return Vec::new() };
    let place = value.span.clone();
    if exit.after_ms.is_none() || exit.after_travel_mm.is_none() {
        return vec![(sort, place, exit)];
    }
    let time = Exit { after_travel_mm: None, of: None, ..exit.clone() };
    vec![(sort, place.clone(), time), (sort, place, Exit { after_ms: None, ..exit })]
}
