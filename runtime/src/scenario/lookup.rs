//! Resolves the ports, modes, facts and seeds of a scenario in the plan of its task on its bench.

use std::collections::BTreeSet;

use super::bounds::{compared, figures, number, rows_of};
use super::check_table::{CheckBlock, CheckTable};
use super::document::{Document, ScenarioTable};
use super::figure::{Bound, Figure};
use super::inject::resolve;
use super::judge::FigureRow;
use super::model::{Check, Scenario, row};
use super::observer::DONE;
use super::window::{Event, ModeName, Window};
use crate::catalogue::Catalogue;
use crate::graph::{Compiled, Request, into_diagnostic};
use crate::node::{Mistake, Spanned};
use crate::record::{PortColumn, PortColumns};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Item, Report, Value, quoted, suggest_name, suggestion};

/// Resolves every name of the scenario, or returns a diagnostic for each that does not exist.
pub(super) fn look_up(
    document: &Document,
    (request, bench): (Request, usize),
    plan: &mut Compiled,
    catalogue: &Catalogue,
    found: Vec<Diagnostic>,
) -> Result<Scenario, Report> {
    let mut wrong = Vec::new();
    let tables = document.faults.iter().filter_map(|block| block.table.clone());
    let injections = resolve(tables, plan, &mut wrong);
    let mut lookup = Lookup { plan, found, read: BTreeSet::new() };
    let (mut checks, mut rows) = (Vec::new(), Vec::new());
    for block in &document.checks {
        let Some((check, its_rows)) = lookup.check(block) else { continue };
        checks.push(check);
        rows.extend(its_rows);
    }
    lookup.found.extend(wrong);
    let scenario = document.scenario.as_ref().map(|table| {
        let vary = table.vary.clone().unwrap_or_default();
        let varies = |name: &str| vary.ranges().any(|(path, _)| path == name);
        let from = table.from.as_ref().and_then(|word| Some((word.value.clone(), lookup.flag(word)?)));
        let never_lost = table.never_lost.as_ref().and_then(|word| lookup.flag(word));
        lookup.modes(table);
        lookup.real_time(table, bench);
        rows.extend(rows_of(table));
        Scenario {
            for_s: table.for_s,
            seeds: table.seeds.as_ref().map(|seeds| seeds.list.clone()).unwrap_or_default(),
            facts: table.facts.iter().filter_map(|word| lookup.fact(word)).filter(|(name, _)| !varies(name)).collect(),
            bench: None,
            request,
            seed_keys: lookup.seeds(table, catalogue, !injections.is_empty() || table.vary.is_some()),
            injections,
            vary: vary.clone(),
            from,
            never_lost,
            stays_in: table.stays_in.as_ref().and_then(|word| lookup.mode(&word.value)),
            ends_in: table.ends_in.as_ref().map(|word| (word.value.clone(), lookup.mode(&word.value))),
            checks,
            rows,
            warnings: plan.warnings_of_read(&lookup.read),
        }
    });
    let found = lookup.found;
    scenario.filter(|_| found.is_empty()).ok_or_else(|| Report::new(plan.sources().clone(), found))
}

struct Lookup<'a> {
    plan: &'a Compiled,
    found: Vec<Diagnostic>,
    /// The names of the ports that the scenario reads.
    read: BTreeSet<String>,
}

impl Lookup<'_> {
    /// Reports a mistake in a word; returns `None` in place of what the word names.
    fn mistake<T>(&mut self, code: Code, word: &Spanned<String>, message: String, help: Option<String>) -> Option<T> {
        self.found.push(Diagnostic::new(code, word.span.clone(), message).with_help(help));
        None
    }

    /// Finds a column by its name in a recording or in the wires of the task. Returns it with the kind of its port.
    fn column(&mut self, word: &Spanned<String>) -> Option<(PortColumn, Kind)> {
        let (port, rest) = self.plan.port_prefix(&word.value).or_else(|| self.unknown_port(word))?;
        self.read.insert(port.name.clone());
        let (columns, kind) = (PortColumns::of(port), port.shape.kind());
        if let Some(column) = columns.iter().find(|column| column.part == rest) {
            return Some((column.clone(), kind));
        }
        if !rest.is_empty() {
            self.unknown_port(word)?;
        }
        let parts: Vec<String> = columns.iter().map(|column| format!("`{}{}`", word.value, column.part)).collect();
        let what = if parts.is_empty() { "which has no number to check" } else { "but a check needs one number" };
        let message = format!("`{}` is {}, {what}", word.value, kind.with_article());
        let help = (!parts.is_empty()).then(|| format!("write one of {}", parts.join(", ")));
        self.mistake(Code::KindMismatch, word, message, help)
    }

    /// Reports a port that does not exist, with the closest name, the ports of its owner, or the owners.
    fn unknown_port<T>(&mut self, word: &Spanned<String>) -> Option<T> {
        let message = format!("there is no port `{}` in this task on this bench", word.value);
        let columns = self.plan.ports().flat_map(PortColumns::of).map(|column| column.name);
        let all: Vec<String> = columns.chain(self.plan.exports().iter().map(|(export, _)| export.clone())).collect();
        let owner_of = |name: &'_ str| name.split('.').next().unwrap_or_default().to_owned();
        let owner = owner_of(&word.value);
        let is_close = suggest_name(&word.value, all.iter().map(String::as_str)).is_some();
        let ports = all.iter().map(String::as_str).filter(|name| is_close || owner_of(name) == owner);
        let help = if ports.clone().next().is_some() {
            suggestion(&word.value, ports, "ports")
        } else {
            let owners: BTreeSet<String> = all.iter().map(|name| owner_of(name)).collect();
            suggestion(&owner, owners.iter().map(String::as_str), "roles, nodes and parts")
        };
        self.mistake(Code::UnknownPort, word, message, Some(help))
    }

    /// Finds the column of a flag.
    fn flag(&mut self, word: &Spanned<String>) -> Option<String> {
        let (column, kind) = self.column(word)?;
        if kind != Kind::Flag {
            let message = format!("`{}` is {}, but this key needs a flag", word.value, kind.with_article());
            return self.mistake(Code::KindMismatch, word, message, None);
        }
        Some(column.name)
    }

    fn check(&mut self, block: &CheckBlock) -> Option<(Check, Vec<FigureRow>)> {
        let window = self.window(block.table.as_ref()?);
        let (column, _) = self.column(&block.table.as_ref()?.of)?;
        let table = &self.in_unit(block, &column)?;
        let figures = figures(table);
        let [papers, goals] =
            [&table.paper, &table.goal].map(|values| values.as_ref().map(compared).unwrap_or_default());
        self.uncomputed(block, ("paper", "the paper's value"), &papers, &figures);
        self.uncomputed(block, ("goal", "the goal"), &goals, &figures);
        let minus = match &table.minus {
            Some(word) => Some(self.subtrahend(word, &column)?),
            None => None,
        };
        let (unit_name, unit) = match table.unit.as_ref().and_then(|unit| unit.0.iter().next()) {
            Some((name, unit)) => (name.clone(), *unit),
            None => (column.unit.to_string(), 1.0),
        };
        let rows = figures.iter().map(|(figure, bound)| {
            let of = |values: &[(Figure, f64)]| values.iter().find(|(of, _)| of == figure).map(|(_, value)| *value);
            let row = row(&block.key.name, &table.of.value, *figure, &unit_name, *bound);
            let word = |word: &Option<Spanned<String>>| word.as_ref().map(|word| word.value.clone());
            let (during, until, missed) = (word(&table.during), word(&table.until), word(&table.missed));
            FigureRow { during, until, paper: of(&papers), goal: of(&goals), missed, ..row }
        });
        let check = Check {
            name: block.key.name.clone(),
            minus,
            period: column.unit.is_axial().then(|| std::f64::consts::PI / unit),
            column: column.name,
            unit,
            settles: number(&table.settles_to).zip(number(&table.within)),
            changes: number(&table.changes_by),
            after: table.after_s,
            steady: table.steady(),
            window: window?,
            figures: figures.iter().map(|(figure, _)| *figure).collect(),
        };
        Some((check, rows.collect()))
    }

    /// Reports each value whose figure the check does not compute. It is given by its key and by a name for messages.
    fn uncomputed(
        &mut self,
        block: &CheckBlock,
        (key, what): (&str, &str),
        values: &[(Figure, f64)],
        figures: &[(Figure, Bound)],
    ) {
        for (value, _) in values.iter().filter(|(value, _)| !figures.iter().any(|(figure, _)| figure == value)) {
            let message = format!("the check computes no `{}`, so {what} has nothing to compare with", value.name());
            let help = format!("the check computes {}", quoted(figures.iter().map(|(figure, _)| figure.name())));
            self.found.push(Diagnostic::new(Code::UnknownKey, block.span(key), message).help(help));
        }
    }

    /// Returns a check with its numbers in the unit of its column. Numbers in a unit of the check's own are plain.
    fn in_unit(&mut self, block: &CheckBlock, column: &PortColumn) -> Option<CheckTable> {
        let mut table = block.table.clone()?;
        let before = self.found.len();
        let unit = table.unit.is_none().then_some(column.unit);
        let wrong = table.amounts_mut().filter_map(|amount| amount.settle(unit, &mut Vec::new()).err());
        let own = block.table.as_ref().and_then(|table| table.unit.as_ref()?.0.keys().next());
        let explain = |mistake: Mistake| match own {
            Some(own) => Mistake { message: format!("this check has its own unit `{own}`"), ..mistake },
            None => mistake,
        };
        self.found.extend(wrong.map(explain).map(into_diagnostic));
        if let (Some(above), Some(below)) = (number(&table.never_above), number(&table.never_below))
            && below > above
        {
            let message = format!("no value is at least {below} and at most {above}");
            let diagnostic = Diagnostic::new(Code::BadValue, block.span("never_below"), message);
            self.found.push(diagnostic.help("swap the values of `never_above` and `never_below`"));
        }
        (self.found.len() == before).then_some(table)
    }

    /// Finds the mode of `during` and the mode or the flag of `until`.
    fn window(&mut self, table: &CheckTable) -> Option<Window> {
        let before = self.found.len();
        let during = table.during.as_ref().and_then(|word| self.during(word));
        let until = table.until.as_ref().and_then(|word| self.event(word));
        (self.found.len() == before).then_some(Window { during, until })
    }

    /// Finds the mode of `during`.
    fn during(&mut self, word: &Spanned<String>) -> Option<ModeName> {
        if self.plan.modes().next().is_none() {
            let message = format!("this task has no modes, so it is never in a mode `{}`", word.value);
            return self.mistake(Code::UnknownMode, word, message, Some("remove `during`".to_owned()));
        }
        self.mode(&word.value).or_else(|| self.unknown_mode(word))
    }

    /// Finds the mode or the flag of `until`. The name of a port has a dot; that of a mode has one behind the name of its task.
    fn event(&mut self, word: &Spanned<String>) -> Option<Event> {
        let name = word.value.clone();
        if let Some(mode) = self.mode(&name) {
            return Some(Event::Enters(mode));
        }
        if name.contains('.') {
            return Some(Event::BecomesTrue { column: self.flag(word)?, name });
        }
        let flags = self.plan.ports().filter(|port| port.shape.kind() == Kind::Flag).map(|port| port.name.as_str());
        let help = suggestion(&name, self.plan.modes().chain(flags), "modes and flags");
        self.mistake(Code::UnknownMode, word, format!("`{name}` is neither a mode nor a flag of this task"), Some(help))
    }

    /// Finds a mode by its name.
    fn mode(&self, name: &str) -> Option<ModeName> {
        Some(ModeName { name: name.to_owned(), place: self.plan.mode(name)? })
    }

    /// Reports a mode that does not exist.
    fn unknown_mode<T>(&mut self, word: &Spanned<String>) -> Option<T> {
        let help = suggestion(&word.value, self.plan.modes(), "modes");
        self.mistake(Code::UnknownMode, word, format!("there is no mode `{}`", word.value), Some(help))
    }

    /// Finds the column to subtract from another. Both must have the same unit.
    fn subtrahend(&mut self, word: &Spanned<String>, other: &PortColumn) -> Option<String> {
        let (column, _) = self.column(word)?;
        if column.unit != other.unit {
            let message = format!("`{}` is in {}, but `{}` is in {}", word.value, column.unit, other.name, other.unit);
            return self.mistake(Code::UnitMismatch, word, message, None);
        }
        Some(column.name)
    }

    /// Checks that the modes exist.
    fn modes(&mut self, table: &ScenarioTable) {
        let modes: Vec<&str> = self.plan.modes().collect();
        let (ends_in, stays_in) = (table.ends_in.as_ref(), table.stays_in.as_ref());
        let ends_in = ends_in.filter(|word| word.value != DONE || modes.is_empty());
        for word in ends_in.into_iter().chain(stays_in).filter(|word| !modes.contains(&word.value.as_str())) {
            self.unknown_mode::<()>(word);
        }
    }

    /// Finds a fact of a device or one of its parameters.
    fn fact(&mut self, word: &Spanned<String>) -> Option<(String, toml::Value)> {
        let settings = self.plan.outline().devices.iter().flat_map(|device| {
            let named = |path: &str| format!("devices.{}.{path}", device.name);
            device.settings.iter().filter_map(move |setting| Some((named(&setting.path), plain(&setting.value)?)))
        });
        let facts: Vec<_> = self.plan.facts().iter().cloned().chain(settings).collect();
        facts.iter().find(|(name, _)| *name == word.value).cloned().or_else(|| {
            let message = format!("no device states the fact or has the parameter `{}`", word.value);
            let help = suggestion(&word.value, facts.iter().map(|(name, _)| name.as_str()), "facts");
            self.mistake(Code::UnknownFact, word, message, Some(help))
        })
    }

    /// Returns the keys that set the seed. Without such a key, and if nothing else `differs`, every seed would give the
    /// same run.
    fn seeds(&mut self, table: &ScenarioTable, catalogue: &Catalogue, differs: bool) -> Vec<String> {
        let has_seed = |kind: &str| {
            let known = catalogue.find_device(kind);
            known.is_some_and(|device| device.params().iter().any(|param| param.name == "seed"))
        };
        let devices = self.plan.outline().devices.iter().filter(|device| has_seed(&device.kind.text));
        let keys: Vec<String> = devices.map(|device| format!("devices.{}.seed", device.name)).collect();
        if let Some(seeds) = table.seeds.as_ref().filter(|_| keys.is_empty() && !differs) {
            let message = "no device of this bench has a `seed`, so every run would be the same";
            let diagnostic = Diagnostic::new(Code::UnknownKey, seeds.span.clone(), message);
            self.found.push(diagnostic.help("remove `seeds` to run the scenario once"));
        }
        if let (Some(vary), None) = (&table.vary, &table.seeds) {
            let message = "the scenario has no `seeds`, so nothing can vary";
            let place = vary.0.first().map_or(0..0, |varied| varied.span.clone());
            let diagnostic = Diagnostic::new(Code::MissingKey, place, message);
            self.found.push(diagnostic.help("write, for example, `seeds = 20` in [scenario]"));
        }
        keys
    }

    /// Rejects a bench with live devices.
    fn real_time(&mut self, table: &ScenarioTable, bench: usize) {
        if self.plan.is_live() {
            let at = table.bench.as_ref().and_then(|benches| benches.0.get(bench)).unwrap_or(&table.graph);
            let message = "a device of this bench runs in real time, but scenarios run in virtual time";
            let help = "use a bench of simulated devices; to record a run in real time, use `tactflow run --out`";
            self.found.push(Diagnostic::new(Code::WrongRole, at.span.clone(), message).help(help));
        }
    }
}

/// Returns a value that is a string, a number or a boolean.
fn plain(value: &Value) -> Option<toml::Value> {
    let is_plain = !matches!(value.item, Item::Datetime(_) | Item::Array(_) | Item::Table(_));
    toml::Value::try_from(value).ok().filter(|_| is_plain)
}
