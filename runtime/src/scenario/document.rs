//! What a scenario file holds, and what is wrong with it before anything is looked up.

use std::ops::Range;

use crate::node::{At, FilePath, Map, Mistake, NonNegative, Param, Positive, Reader, Word};
use crate::source::{Code, Diagnostic};
use crate::source::{Item, Key, SourceMap, Table, Value};

crate::params! { ScenarioTable:
    /// Task that runs.
    graph: FilePath,
    /// Bench that it runs on; the task's own unless given.
    bench: Option<FilePath>,
    /// How many seeds, from 1 on, or a list of them; each is set as the `seed` of every device that has one.
    seeds: Option<Seeds>,
    /// Length of a run [s].
    for_s: Positive,
    /// Flag that is set for the first time at time 0 of all figures; the start of the run unless given.
    from: Option<Word>,
    /// Flag that is there and set from time 0 to the end.
    never_lost: Option<Word>,
    /// Mode that is reached and not left any more.
    stays_in: Option<Word>,
    /// Mode in which the run ends, or `done` if a mode says that it is.
    ends_in: Option<Word>,
    /// Facts of devices, as `role.fact`, and what they are set to, as `devices.NAME.key`, to print beside the figures.
    tells: Vec<Word> = vec![],
}

crate::params! { CheckTable:
    /// Port, or part of one, as the record names it or as the task's wires do.
    of: Word,
    /// Port, or part of one, that is taken off it: the truth off what was measured, say.
    minus: Option<Word>,
    /// What it settles to [unit of the check].
    settles_to: Option<f64>,
    /// How near that is near enough [unit of the check].
    within: Option<Positive>,
    /// Bound on the response [s].
    response_below_s: Option<Positive>,
    /// Bound on the steady-state error [unit of the check].
    steady_state_error_below: Option<Positive>,
    /// Length of the end that the steady state is taken from; 10 unless given [s].
    steady_s: Option<Positive>,
    /// Bound on the standard deviation [unit of the check].
    std_below: Option<Positive>,
    /// What it never exceeds [unit of the check].
    never_above: Option<f64>,
    /// What it never falls below [unit of the check].
    never_below: Option<f64>,
    /// From when on it is looked at; the response and the steady state have their own times [s].
    after_s: Option<NonNegative>,
    /// Unit of all numbers of the check: its name, and how much it is in the port's unit.
    unit: Option<Map<Positive>>,
    /// What the paper reports, to print beside the figures [unit of the check].
    paper: Option<PaperTable>,
}

crate::params! { PaperTable:
    /// Response time [s].
    response_s: Option<f64>,
    /// Steady-state error [unit of the check].
    error: Option<f64>,
    /// Mean [unit of the check].
    mean: Option<f64>,
    /// Standard deviation [unit of the check].
    std: Option<f64>,
    /// Greatest value [unit of the check].
    max: Option<f64>,
    /// Least value [unit of the check].
    min: Option<f64>,
}

/// The seeds, and where they stand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds {
    pub(super) list: Vec<u64>,
    pub(super) span: Range<usize>,
}

/// As many seeds a scenario has at most.
const MOST: i64 = 10_000;

impl Param for Seeds {
    const EXPECTS: &'static str = "a number of seeds from 1 to 10000, or a list of whole numbers, each once";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let list = match &value.item {
            Item::Integer(count) if (1..=MOST).contains(count) => Some((1..=*count as u64).collect::<Vec<_>>()),
            Item::Array(items) if !items.is_empty() => {
                let seeds = items.iter().map(|item| match item.item {
                    Item::Integer(seed) => u64::try_from(seed).ok(),
                    _ => None,
                });
                let seeds: Option<Vec<u64>> = seeds.collect();
                seeds.filter(|seeds| (1..seeds.len()).all(|i| !seeds[..i].contains(&seeds[i])))
            }
            _ => None,
        };
        if list.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        Some(Self { list: list?, span: value.span.clone() })
    }
}

/// A check as it is written.
pub(super) struct CheckBlock {
    pub(super) key: Key,
    pub(super) value: Value,
    /// Nothing, if it has mistakes that are told.
    pub(super) table: Option<CheckTable>,
}

/// A scenario file.
pub(super) struct Document {
    /// The section [scenario] as it is written.
    section: Value,
    /// Nothing, if it has mistakes that are told.
    pub(super) scenario: Option<ScenarioTable>,
    pub(super) checks: Vec<CheckBlock>,
}

impl Document {
    /// The task, and the bench if one is named: they are looked into whatever else is wrong with the section.
    pub(super) fn files(&self, sources: &SourceMap) -> Vec<FilePath> {
        // What is wrong with them has been told.
        let mut reader = Reader::new(sources);
        let mut file = |key: &str| FilePath::read(self.section.as_table()?.get(key)?, &mut reader);
        let (graph, bench) = (file("graph"), file("bench"));
        graph.into_iter().flat_map(|graph| [Some(graph), bench.clone()]).flatten().collect()
    }
}

/// Reads the sections of a scenario file.
pub(super) fn document(root: &Table, reader: &mut Reader<'_>) -> Document {
    for (key, _) in root.entries.iter().filter(|(key, _)| !["scenario", "check"].contains(&key.name.as_str())) {
        let message = format!("`{}` means nothing here", key.name);
        let help = match key.name.as_str() {
            "set" | "nodes" | "parts" | "devices" | "bind" => {
                "a scenario patches neither the task nor the bench: write a bench, or a task, of its own".to_owned()
            }
            name => crate::source::suggestion(name, ["scenario", "check"].into_iter(), "sections"),
        };
        reader.mistakes.push(Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message).help(help));
    }
    // What is missing is shown at the section's name.
    let section = root.entry("scenario").map(|(key, value)| match value.item {
        Item::Table(_) => Value { span: key.span.clone(), ..value.clone() },
        _ => value.clone(),
    });
    let section = section.unwrap_or(Value { span: 0..0, item: Item::Table(Table::default()) });
    let scenario = ScenarioTable::read(&section, reader);
    let checks = match root.get("check").map(|value| (value, value.as_table())) {
        Some((_, Some(table))) => table.entries.iter().map(|(key, value)| check(key, value, reader)).collect(),
        Some((value, None)) => {
            reader.wrong_type(value, "a table of checks");
            Vec::new()
        }
        None => Vec::new(),
    };
    Document { section, scenario, checks }
}

fn check(key: &Key, value: &Value, reader: &mut Reader<'_>) -> CheckBlock {
    let value = match value.item {
        Item::Table(_) => Value { span: key.span.clone(), ..value.clone() },
        _ => value.clone(),
    };
    let table = CheckTable::read(&value, reader);
    CheckBlock { key: key.clone(), value, table }
}

impl CheckBlock {
    /// Place of a key of the check.
    pub(super) fn place(&self, key: &str) -> Range<usize> {
        let entry = self.value.as_table().and_then(|table| table.entry(key));
        entry.map_or(self.value.span.clone(), |(key, _)| key.span.clone())
    }

    /// What its keys ask for that cannot be.
    pub(super) fn mistakes(&self, for_s: Option<f64>) -> Vec<Diagnostic> {
        let Some(table) = &self.table else { return Vec::new() };
        let mut found = Vec::new();
        let mut wrong = |code: Code, key: &str, message: String, help: &str| {
            found.push(Diagnostic::new(code, self.place(key), message).help(help));
        };
        let (target, within) = (table.settles_to, table.within);
        let needs_target = [
            ("within", within.is_some()),
            ("response_below_s", table.response_below_s.is_some()),
            ("steady_state_error_below", table.steady_state_error_below.is_some()),
            ("steady_s", table.steady_s.is_some()),
        ];
        for (key, _) in needs_target.into_iter().filter(|(_, is_given)| *is_given && target.is_none()) {
            let help = "add `settles_to`: what the port shall come to";
            wrong(Code::MissingKey, key, format!("`{key}` needs `settles_to`"), help);
        }
        if target.is_some() && within.is_none() {
            let help = "add `within`: how near it has to come, and to stay";
            wrong(Code::MissingKey, "settles_to", "`settles_to` needs `within`".into(), help);
        }
        if let (Some(above), Some(below)) = (table.never_above, table.never_below)
            && below > above
        {
            let message = format!("nothing is at least {below} and at most {above}");
            wrong(Code::BadValue, "never_below", message, "exchange the two");
        }
        if let (Some(after), Some(for_s)) = (table.after_s, for_s)
            && *after >= for_s
        {
            let message = format!("the run is over after {for_s} s: nothing is left after {} s", *after);
            wrong(Code::BadValue, "after_s", message, "look from an earlier time on, or run longer");
        }
        if table.unit.as_ref().is_some_and(|unit| unit.0.len() != 1) {
            wrong(Code::BadValue, "unit", "a check has one unit".into(), "for example `unit = { tactel = 0.005 }`");
        }
        found
    }
}
