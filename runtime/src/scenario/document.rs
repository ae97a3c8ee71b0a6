//! The sections of a scenario file.

use std::ops::Range;

use super::check_table::{CheckBlock, CheckTable};
use super::inject::{InjectBlock, blocks};
use super::vary::Vary;
use crate::node::{At, FilePath, Mistake, Param, Reader, Spanned};
use crate::source::{Code, Item, Key, SourceMap, Table, Value, suggestion};

/// The section `[scenario]`.
#[derive(Debug, Clone, Param)]
pub(crate) struct ScenarioTable {
    /// Task to run.
    pub(crate) graph: FilePath,
    /// Bench to run it on, or a list of benches; by default the task's own.
    pub(crate) bench: Option<Benches>,
    /// Number of seeds, from 1 on, or a list of seeds. Each run sets its seed as the `seed` of every device that has
    /// one.
    pub(crate) seeds: Option<Seeds>,
    /// Parameters of devices that differ between the runs, each with its smallest and its largest value.
    pub(crate) vary: Option<Vary>,
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

/// The benches on which a scenario runs its task: one or more.
#[derive(Debug, Clone)]
pub(crate) struct Benches(pub(super) Vec<FilePath>);

impl Param for Benches {
    const EXPECTS: &'static str = "the path of a bench, or a list of such paths";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match &value.item {
            Item::Array(items) if !items.is_empty() => {
                let files: Vec<FilePath> =
                    items.iter().map(|item| FilePath::read(item, reader)).collect::<Option<_>>()?;
                let name = |file: &FilePath| file.path.file_stem().map(std::ffi::OsStr::to_owned);
                let twice = (1..files.len()).find(|i| files[..*i].iter().any(|file| name(file) == name(&files[*i])));
                match twice {
                    Some(i) => reader.wrong_type(&items[i], "benches whose files have different names"),
                    None => Some(Self(files)),
                }
            }
            Item::String(_) => FilePath::read(value, reader).map(|file| Self(vec![file])),
            _ => reader.wrong_type(value, Self::EXPECTS),
        }
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

/// A scenario file.
pub(super) struct Document {
    /// The section [scenario] as written.
    section: Value,
    /// The keys of the section, or `None` if a mistake in them has been reported.
    pub(super) scenario: Option<ScenarioTable>,
    pub(super) checks: Vec<CheckBlock>,
    pub(super) faults: Vec<InjectBlock>,
}

impl Document {
    /// Returns the task, if it is given, and the benches, even if other keys of the section have mistakes.
    pub(super) fn files(&self, sources: &SourceMap) -> (Option<FilePath>, Vec<FilePath>) {
        // Mistakes in these two keys have been reported when the section was read.
        let mut reader = Reader::new(sources);
        let section = self.section.as_table();
        let value = |key: &str| section.and_then(|section| section.get(key));
        let graph = value("graph").and_then(|value| FilePath::read(value, &mut reader));
        let benches = value("bench").and_then(|value| Benches::read(value, &mut reader));
        (graph, benches.map_or_else(Vec::new, |benches| benches.0))
    }
}

/// The sections of a scenario file.
const SECTIONS: [&str; 3] = ["scenario", "check", "inject"];

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
    let faults = blocks(root, reader);
    Document { section, scenario, checks, faults }
}

/// Returns a section with the span of its name, to which diagnostics of missing keys point.
fn at_key(key: &Key, value: &Value) -> Value {
    let span = if value.as_table().is_some() { &key.span } else { &value.span };
    Value { span: span.clone(), ..value.clone() }
}
