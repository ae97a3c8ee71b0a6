//! The output of `verify`, as a table or as JSON.

use std::collections::BTreeMap;

use serde::Serialize;

use super::verified::Verified;
use crate::cli::shell::json::{DiagnosticJson, diagnosed};
use crate::cli::text::number::{count_of, number};
use crate::cli::text::table::table;
use crate::scenario::figure::{Bound, Figure};
use crate::scenario::judge::{FigureRow, Verdict};
use crate::scenario::{Scenario, Trial, assignment};

const HEADER: [&str; 10] =
    ["scenario", "check", "figure", "unit", "median of runs", "bound", "paper", "worst", "95 % interval of median", ""];

/// Writes the table, a description of each scenario, and the number of checks that passed.
pub(crate) fn text(all: &[Verified], has_colour: bool) -> String {
    format!("{}\n{}\n{}\n", table(&rows(all, has_colour), 4, 9), notes(all), summary(all))
}

/// Returns the rows of the table, with that of the titles.
pub(crate) fn rows(all: &[Verified], has_colour: bool) -> Vec<[String; 10]> {
    let mut rows = vec![HEADER.map(String::from)];
    for verified in all {
        let first = rows.len();
        let (failed, runs) = (verified.failures().count(), verified.trials.len());
        let unloaded = verified.loaded.is_err().then(|| "does not load".to_owned());
        let failed = (failed > 0).then(|| format!("{failed} of {runs} runs ended in an error"));
        rows.extend(unloaded.into_iter().chain(failed).map(|what| remark(what, has_colour)));
        rows.extend(verified.rows.iter().map(|row| cells(row, has_colour)));
        if let Some(row) = rows.get_mut(first) {
            row[0] = verified.name();
        }
    }
    rows
}

/// Describes each scenario, and names the worst runs of figures that failed.
pub(crate) fn notes(all: &[Verified]) -> String {
    let mut text = String::new();
    for verified in all {
        if let Ok(scenario) = &verified.loaded {
            text.push_str(&format!("{}: {}\n", verified.name(), describe(scenario)));
            text.extend(verified.rows.iter().filter_map(|row| worst_of(row, &verified.trials)));
            text.extend(verified.rows.iter().filter_map(missed_goal));
            text.extend(needless_reasons(&verified.rows));
        }
    }
    text
}

/// Returns how many checks passed and failed.
pub(crate) fn summary(all: &[Verified]) -> String {
    let marks: Vec<Verdict> = all.iter().flat_map(|verified| &verified.rows).map(FigureRow::verdict).collect();
    let count = |mark: Verdict| marks.iter().filter(|known| **known == mark).count();
    let runs = all.iter().map(|verified| verified.trials.len()).sum();
    let failed = all.iter().flat_map(Verified::failures).count();
    let unloaded = all.iter().filter(|verified| verified.loaded.is_err()).count();
    let mut parts = vec![format!("{} passed", count(Verdict::Passed)), format!("{} failed", count(Verdict::Failed))];
    parts.push(format!("{} informational", count(Verdict::Informational)));
    let missed = all.iter().flat_map(|verified| &verified.rows).filter(|row| row.missed_goal().is_some()).count();
    parts.extend((missed > 0).then(|| format!("{} missed", count_of(missed, "goal"))));
    let ended = if failed == 0 { String::new() } else { format!(" ({failed} ended in an error)") };
    parts.push(format!("in {}{ended}", count_of(runs, "run")));
    parts.extend((unloaded > 0).then(|| format!("{} not loaded", count_of(unloaded, "scenario"))));
    parts.join(", ")
}

/// Describes the seeds and the length of a scenario, and the facts of its devices.
fn describe(scenario: &Scenario) -> String {
    let runs = match scenario.seeds.len() {
        0 => "one run".to_owned(),
        1 => "one seed".to_owned(),
        count => format!("{count} seeds"),
    };
    let facts = scenario.facts.iter().map(|(name, value)| format!(", {name} = {value}"));
    let varied = scenario.vary.ranges().map(|(path, [low, high])| format!(", {path} = {low} to {high}"));
    format!("{runs} of {} s{}", scenario.for_s, facts.chain(varied).collect::<String>())
}

/// Names the run in which a figure that failed is worst, with the parameters that vary.
fn worst_of(row: &FigureRow, trials: &[Trial]) -> Option<String> {
    let worst = row.worst()?;
    let trial = trials.iter().zip(&row.values).find(|(_, value)| **value == Some(worst)).map(|(trial, _)| trial)?;
    let seed = trial.seed.filter(|_| row.verdict() == Verdict::Failed && !trial.varied.is_empty())?;
    Some(format!("  {} of {} is worst with seed {seed}: {}\n", row.figure.name(), row.check, sets(&trial.varied)))
}

/// Writes a goal that a figure misses, with the reason that the file gives.
fn missed_goal(row: &FigureRow) -> Option<String> {
    let (goal, reached) = (number(row.missed_goal()?), row.reached().map_or_else(|| "-".to_owned(), number));
    let why = row.missed.as_deref().unwrap_or("no reason is given: add `missed` to the check");
    let (figure, check, unit) = (row.figure.name(), &row.check, &row.unit);
    Some(format!("  {figure} of {check} misses its goal: {reached} {unit} instead of {goal} {unit}. {why}\n"))
}

/// Names the checks that give a reason although they reach all of their goals.
fn needless_reasons(rows: &[FigureRow]) -> Vec<String> {
    let checks: BTreeMap<&str, bool> =
        rows.iter().filter(|row| row.missed.is_some()).fold(BTreeMap::new(), |mut all, row| {
            *all.entry(row.check.as_str()).or_default() |= row.missed_goal().is_some();
            all
        });
    let reached = checks.into_iter().filter(|(_, is_missed)| !is_missed);
    reached.map(|(check, _)| format!("  {check} reaches its goals: remove `missed` from the check\n")).collect()
}

/// Writes the parameters that vary as arguments of `run`.
pub(crate) fn sets(varied: &BTreeMap<String, f64>) -> String {
    let sets: Vec<String> = varied.iter().map(|(path, value)| format!("--set {}", assignment(path, *value))).collect();
    sets.join(" ")
}

/// Returns a row that says why there are no figures.
fn remark(what: String, has_colour: bool) -> [String; 10] {
    let mut cells: [String; 10] = Default::default();
    (cells[1], cells[9]) = (what, mark(Verdict::Failed, has_colour));
    cells
}

/// Returns the row of a figure, without the name of its scenario.
fn cells(row: &FigureRow, has_colour: bool) -> [String; 10] {
    let not_measured = if row.figure == Figure::Response { "never" } else { "-" };
    let figure = |value: Option<f64>| value.map_or_else(|| not_measured.to_owned(), number);
    let bound = match row.bound {
        Bound::None => String::new(),
        Bound::Settles => "each settles".to_owned(),
        Bound::Median(bound) => format!("≤ {}", number(bound)),
        Bound::AtMost(bound) => format!("each ≤ {}", number(bound)),
        Bound::AtLeast(bound) => format!("each ≥ {}", number(bound)),
        Bound::Near { target, tolerance } => format!("each {} ± {}", number(target), number(tolerance)),
    };
    let missing = match row.missing() {
        0 => String::new(),
        count => format!(" (in {count} of {} runs)", row.values.len()),
    };
    let interval = row.interval().map_or_else(String::new, |(low, high)| {
        let end = |value: f64| figure(Some(value).filter(|value| value.is_finite()));
        format!("{} to {}", end(low), end(high))
    });
    [
        String::new(),
        row.check.clone(),
        limited(row),
        row.unit.clone(),
        figure(row.median()),
        bound,
        row.paper.map_or_else(String::new, number),
        format!("{}{missing}", figure(row.worst())),
        interval,
        mark(row.verdict(), has_colour) + if row.missed_goal().is_some() { " (goal missed)" } else { "" },
    ]
}

/// Returns the name of a figure, with the mode and the event that limit it.
fn limited(row: &FigureRow) -> String {
    let during = row.during.iter().map(|mode| format!(" during {mode}"));
    let until = row.until.iter().map(|event| format!(" until {event}"));
    row.figure.name().to_owned() + &during.chain(until).collect::<String>()
}

/// Writes a verdict, in green or in red.
fn mark(verdict: Verdict, has_colour: bool) -> String {
    let (text, colour) = match verdict {
        Verdict::Passed => ("passed", "\x1b[32m"),
        Verdict::Failed => ("FAILED", "\x1b[1;31m"),
        Verdict::Informational => return String::new(),
    };
    if has_colour { format!("{colour}{text}\x1b[0m") } else { text.to_owned() }
}

/// The results as JSON.
#[derive(Serialize)]
pub(crate) struct VerifyJson<'a> {
    ok: bool,
    scenarios: Vec<ScenarioJson<'a>>,
}

#[derive(Serialize)]
struct ScenarioJson<'a> {
    name: String,
    file: String,
    ok: bool,
    diagnostics: Vec<DiagnosticJson>,
    /// Length of a run [s].
    for_s: Option<f64>,
    /// Facts of the devices.
    facts: BTreeMap<&'a str, &'a toml::Value>,
    /// The parameters that vary, with their smallest and largest values.
    vary: BTreeMap<&'a str, [f64; 2]>,
    runs: &'a [Trial],
    rows: Vec<RowJson<'a>>,
}

/// What a bound applies to.
#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum Judged {
    /// The median of the runs.
    Median,
    /// Every run.
    Every,
}

#[derive(Serialize)]
struct RowJson<'a> {
    check: &'a str,
    of: &'a str,
    /// The mode to which the check is restricted; null without one.
    during: Option<&'a str>,
    /// The mode or the flag that ends the check; null without one.
    until: Option<&'a str>,
    figure: &'static str,
    unit: &'a str,
    /// Over the runs; null if not measured.
    median: Option<f64>,
    worst: Option<f64>,
    /// Confidence interval of the median, at least 95 %; an end is null if not measured.
    interval: Option<(f64, f64)>,
    /// The largest or the smallest value; the largest error if there is a target.
    bound: Option<f64>,
    /// The expected change; null for other figures.
    target: Option<f64>,
    /// What the bound applies to; null without a bound.
    judged: Option<Judged>,
    paper: Option<f64>,
    goal: Option<f64>,
    /// Whether the figure misses its goal.
    misses_goal: bool,
    /// `informational` without a bound.
    mark: Verdict,
    /// In the order of the runs.
    values: &'a [Option<f64>],
}

pub(crate) fn json(all: &[Verified]) -> VerifyJson<'_> {
    VerifyJson { ok: all.iter().all(Verified::has_passed), scenarios: all.iter().map(scenario_json).collect() }
}

fn scenario_json(verified: &Verified) -> ScenarioJson<'_> {
    let scenario = verified.loaded.as_ref().ok();
    let facts = scenario.into_iter().flat_map(|scenario| &scenario.facts);
    ScenarioJson {
        name: verified.name(),
        file: verified.path.display().to_string(),
        ok: verified.has_passed(),
        diagnostics: verified.loaded.as_ref().err().map(diagnosed).unwrap_or_default(),
        for_s: scenario.map(|scenario| scenario.for_s),
        facts: facts.map(|(name, fact)| (name.as_str(), fact)).collect(),
        vary: scenario.into_iter().flat_map(|scenario| scenario.vary.ranges()).collect(),
        runs: &verified.trials,
        rows: verified.rows.iter().map(row_json).collect(),
    }
}

fn row_json(row: &FigureRow) -> RowJson<'_> {
    let (bound, judged) = match row.bound {
        Bound::None => (None, None),
        Bound::Settles => (None, Some(Judged::Every)),
        Bound::Median(bound) => (Some(bound), Some(Judged::Median)),
        Bound::AtMost(bound) | Bound::AtLeast(bound) | Bound::Near { tolerance: bound, .. } => {
            (Some(bound), Some(Judged::Every))
        }
    };
    let target = match row.bound {
        Bound::Near { target, .. } => Some(target),
        _ => None,
    };
    RowJson {
        check: &row.check,
        of: &row.of,
        during: row.during.as_deref(),
        until: row.until.as_deref(),
        figure: row.figure.name(),
        unit: &row.unit,
        median: row.median(),
        worst: row.worst(),
        interval: row.interval(),
        bound,
        target,
        judged,
        paper: row.paper,
        goal: row.goal,
        misses_goal: row.missed_goal().is_some(),
        mark: row.verdict(),
        values: &row.values,
    }
}
