//! The sections of a scenario file, and the checks that need no task.

use std::ops::Range;

use crate::node::{Amount, At, FilePath, Map, Mistake, Param, Reader, Spanned};
use crate::source::{Code, Diagnostic, Item, Key, SourceMap, Table, Value, suggestion};

/// The section `[scenario]`.
#[derive(Debug, Clone, Param)]
pub(crate) struct ScenarioTable {
    /// Task to run.
    pub(crate) graph: FilePath,
    /// Bench to run it on; by default the task's own.
    pub(crate) bench: Option<FilePath>,
    /// Number of seeds, from 1 on, or a list of seeds. Each run sets its seed as the `seed` of every device that has
    /// one.
    pub(crate) seeds: Option<Seeds>,
    /// Duration of a run.
    #[param(unit = "s", above = 0.0)]
    pub(crate) for_s: f64,
    /// Flag that defines time 0 of all figures: when it is first set. By default, time 0 is the start of the run.
    pub(crate) from: Option<Spanned<String>>,
    /// Flag that must be set from time 0 to the end.
    pub(crate) never_lost: Option<Spanned<String>>,
    /// Mode that must be reached and never left again.
    pub(crate) stays_in: Option<Spanned<String>>,
    /// Mode in which the run must end, or `done` if it must end with a `done` condition.
    pub(crate) ends_in: Option<Spanned<String>>,
    /// Values to print beside the figures: facts of devices as `role.fact`, and parameters as `devices.NAME.key`.
    #[param(default = vec![])]
    pub(crate) facts: Vec<Spanned<String>>,
}

/// One check of a scenario.
#[derive(Debug, Clone, Param)]
pub(crate) struct CheckTable {
    /// Port or component to check, by its name in a recording or in the task's wires.
    pub(crate) of: Spanned<String>,
    /// Port or component to subtract from it, for example the true value from the measured one.
    pub(crate) minus: Option<Spanned<String>>,
    /// Value that it must settle to.
    #[param(unit = "$unit")]
    pub(crate) settles_to: Option<Amount>,
    /// Half width of the band around `settles_to`.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) within: Option<Amount>,
    /// Maximum response time.
    #[param(unit = "s", above = 0.0)]
    pub(crate) response_below_s: Option<f64>,
    /// Maximum steady-state error.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) steady_state_error_below: Option<Amount>,
    /// Length of the steady state at the end of the run; 10 by default.
    #[param(unit = "s", above = 0.0)]
    pub(crate) steady_s: Option<f64>,
    /// Maximum standard deviation.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) std_below: Option<Amount>,
    /// Value that it must never exceed.
    #[param(unit = "$unit")]
    pub(crate) never_above: Option<Amount>,
    /// Value that it must never fall below.
    #[param(unit = "$unit")]
    pub(crate) never_below: Option<Amount>,
    /// Time from which it is checked. The response and the steady state have their own times.
    #[param(unit = "s", range = 0.0..)]
    pub(crate) after_s: Option<f64>,
    /// Unit of all numbers of the check: its name, and its size in the unit of the port.
    #[param(unit = "1", above = 0.0)]
    pub(crate) unit: Option<Map<f64>>,
    /// Values from the paper to print beside the figures.
    #[param(unit = "$unit")]
    pub(crate) paper: Option<PaperTable>,
}

/// Values from the paper.
#[derive(Debug, Clone, Param)]
pub(crate) struct PaperTable {
    /// Response time.
    #[param(unit = "s")]
    pub(crate) response_s: Option<f64>,
    /// Steady-state error.
    #[param(unit = "$unit")]
    pub(crate) error: Option<Amount>,
    /// Mean.
    #[param(unit = "$unit")]
    pub(crate) mean: Option<Amount>,
    /// Standard deviation.
    #[param(unit = "$unit")]
    pub(crate) std: Option<Amount>,
    /// Maximum.
    #[param(unit = "$unit")]
    pub(crate) max: Option<Amount>,
    /// Minimum.
    #[param(unit = "$unit")]
    pub(crate) min: Option<Amount>,
}

impl CheckTable {
    /// Returns the numbers in the unit of the check.
    pub(super) fn amounts_mut(&mut self) -> impl Iterator<Item = &mut Amount> {
        let bounds = [
            &mut self.settles_to,
            &mut self.within,
            &mut self.steady_state_error_below,
            &mut self.std_below,
            &mut self.never_above,
            &mut self.never_below,
        ];
        let paper = self
            .paper
            .iter_mut()
            .flat_map(|paper| [&mut paper.error, &mut paper.mean, &mut paper.std, &mut paper.max, &mut paper.min]);
        bounds.into_iter().chain(paper).flatten()
    }
}

/// The seeds and their position in the source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Seeds {
    pub(super) list: Vec<u64>,
    pub(super) span: Range<usize>,
}

const MAX_SEEDS: i64 = 10_000;

impl Param for Seeds {
    const EXPECTS: &'static str = "a number of seeds from 1 to 10000, or a list of whole numbers, each once";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let seed = |item: &Value| match item.item {
            Item::Integer(seed) => u64::try_from(seed).ok(),
            _ => None,
        };
        let is_distinct = |seeds: &Vec<u64>| (1..seeds.len()).all(|i| !seeds[..i].contains(&seeds[i]));
        let list: Option<Vec<u64>> = match &value.item {
            Item::Integer(count) if (1..=MAX_SEEDS).contains(count) => Some((1..=*count as u64).collect()),
            Item::Array(items) if !items.is_empty() => {
                items.iter().map(seed).collect::<Option<_>>().filter(is_distinct)
            }
            _ => None,
        };
        let list = list.or_else(|| reader.wrong_type(value, Self::EXPECTS))?;
        Some(Self { list, span: value.span.clone() })
    }
}

/// A section [check.NAME].
pub(super) struct CheckBlock {
    pub(super) key: Key,
    pub(super) value: Value,
    /// The keys of the section, or `None` if a mistake in them has been reported.
    pub(super) table: Option<CheckTable>,
}

/// A scenario file.
pub(super) struct Document {
    /// The section [scenario] as written.
    section: Value,
    /// The keys of the section, or `None` if a mistake in them has been reported.
    pub(super) scenario: Option<ScenarioTable>,
    pub(super) checks: Vec<CheckBlock>,
}

impl Document {
    /// Returns the task, and the bench if one is given, even if other keys of the section have mistakes.
    pub(super) fn files(&self, sources: &SourceMap) -> Vec<FilePath> {
        // Mistakes in these two keys have been reported when the section was read.
        let mut reader = Reader::new(sources);
        let mut file = |key: &str| FilePath::read(self.section.as_table()?.get(key)?, &mut reader);
        let (graph, bench) = (file("graph"), file("bench"));
        graph.into_iter().flat_map(|graph| [Some(graph), bench.clone()]).flatten().collect()
    }
}

/// The sections of a scenario file.
const SECTIONS: [&str; 2] = ["scenario", "check"];

/// Reads the sections of a scenario file. Mistakes go to the reader.
pub(super) fn document(root: &Table, reader: &mut Reader<'_>) -> Document {
    for (key, _) in root.entries.iter().filter(|(key, _)| !SECTIONS.contains(&key.name.as_str())) {
        let message = format!("a scenario has no section `{}`", key.name);
        let help = match key.name.as_str() {
            "set" | "nodes" | "parts" | "devices" | "bind" => {
                "a scenario cannot change its task or bench: write another task or bench for it".to_owned()
            }
            name => suggestion(name, SECTIONS.into_iter(), "sections"),
        };
        reader.mistakes.push(Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message).help(help));
    }
    let section = root.entry("scenario").map(|(key, value)| at_key(key, value));
    let section = section.unwrap_or(Value { span: 0..0, item: Item::Table(Table::default()) });
    let scenario = ScenarioTable::read(&section, reader);
    let checks = root.get("check");
    let checks = checks.and_then(|value| value.as_table().or_else(|| reader.wrong_type(value, "a table of checks")));
    let check = |(key, value): &(Key, Value)| {
        let value = at_key(key, value);
        let table = CheckTable::read(&value, reader);
        CheckBlock { key: key.clone(), value, table }
    };
    let checks = checks.into_iter().flat_map(|table| &table.entries).map(check).collect();
    Document { section, scenario, checks }
}

/// Returns a section with the span of its name, to which diagnostics of missing keys point.
fn at_key(key: &Key, value: &Value) -> Value {
    let span = if value.as_table().is_some() { &key.span } else { &value.span };
    Value { span: span.clone(), ..value.clone() }
}

impl CheckBlock {
    /// Returns the span of a key of the check, or of the check's name if the key is missing.
    pub(super) fn span(&self, key: &str) -> Range<usize> {
        let entry = self.value.as_table().and_then(|table| table.entry(key));
        entry.map_or(self.value.span.clone(), |(key, _)| key.span.clone())
    }

    /// Returns a diagnostic for each key that contradicts the others or needs another one.
    pub(super) fn mistakes(&self, for_s: Option<f64>) -> Vec<Diagnostic> {
        let Some(table) = &self.table else { return Vec::new() };
        let mut found = Vec::new();
        let mut wrong = |code: Code, key: &str, message: String, help: &str| {
            found.push(Diagnostic::new(code, self.span(key), message).help(help));
        };
        let (target, within) = (&table.settles_to, &table.within);
        let is_given = |key: &&str| self.value.as_table().is_some_and(|table| table.get(key).is_some());
        let needs_target = ["within", "response_below_s", "steady_state_error_below", "steady_s"];
        for key in needs_target.into_iter().filter(|key| target.is_none() && is_given(key)) {
            let help = "add `settles_to`: the value that the port must reach";
            wrong(Code::MissingKey, key, format!("`{key}` needs `settles_to`"), help);
        }
        if target.is_some() && within.is_none() {
            let help = "add `within`: the largest error that counts as settled";
            wrong(Code::MissingKey, "settles_to", "`settles_to` needs `within`".into(), help);
        }
        if let (Some(after), Some(for_s)) = (table.after_s, for_s)
            && after >= for_s
        {
            let message = format!("the run ends after {for_s} s, so there is nothing to check after {} s", after);
            wrong(Code::BadValue, "after_s", message, "write an earlier time, or a larger `for_s`");
        }
        if table.unit.as_ref().is_some_and(|unit| unit.0.len() != 1) {
            let message = "`unit` must have exactly one entry".into();
            wrong(
                Code::BadValue,
                "unit",
                message,
                "write one name and its size in the unit of the port, as in `unit = { tactel = 0.005 }`",
            );
        }
        found
    }
}
