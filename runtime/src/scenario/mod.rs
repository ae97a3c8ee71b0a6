//! Scenarios: a task on a bench, with seeds and a duration, and what must come out of it.
//!
//! `document` says what the file holds, `lookup` finds the ports it speaks of, `trial` runs it with one seed, [`measure`]
//! says what a figure is, and [`judge`] what many runs say together. A scenario patches neither its task nor its bench:
//! a seed is all it sets.

mod document;
pub mod judge;
mod lookup;
pub mod measure;
mod trial;

use std::path::{Path, PathBuf};

use crate::catalogue::Catalogue;
use crate::graph::{Loader, Request, other_file, plan_in, spanned};
use crate::node::{FilePath, Reader};
use crate::source::{Code, Diagnostic, Report};
use document::Document;
use judge::{Bound, Row};

pub use document::Seeds;
pub use trial::Trial;

/// A scenario that is checked, with its task and its bench: every port it speaks of is there.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// The file.
    pub path: PathBuf,
    /// Length of a run [s].
    pub for_s: f64,
    /// The seeds; none in a scenario without any, which runs once.
    pub seeds: Vec<u64>,
    /// What devices state and shall be printed beside the figures.
    pub facts: Vec<(String, toml::Value)>,
    request: Request,
    /// `devices.NAME.seed` of each device that has a seed.
    seed_keys: Vec<String>,
    /// Name of the flag that says when time 0 is, as it is written, and its column.
    from: Option<(String, String)>,
    /// Column of the flag that is never lost.
    never_lost: Option<String>,
    stays_in: Option<String>,
    ends_in: Option<String>,
    checks: Vec<Check>,
    /// Every figure, without values: those of the checks, then those of the scenario as a whole.
    rows: Vec<Row>,
}

/// What is looked at, and how.
#[derive(Debug, Clone)]
struct Check {
    column: String,
    /// The number that is taken off.
    minus: Option<String>,
    /// Half a turn, if it is the direction of a line [unit of the check].
    period: Option<f64>,
    /// How much its unit is in the port's.
    unit: f64,
    /// What it settles to, and how near.
    settles: Option<(f64, f64)>,
    after: Option<f64>,
    steady: f64,
    /// Its figures, in the order of the rows.
    figures: Vec<judge::Figure>,
}

impl Scenario {
    /// Reads a scenario and checks it with its task and its bench.
    ///
    /// # Errors
    /// Every mistake of all its files at once.
    pub fn load(catalogue: &Catalogue, path: &Path) -> Result<Self, Report> {
        let mut loader = Loader::new(catalogue.builtin_files());
        let root = loader.read(path, None);
        let mut found = std::mem::take(&mut loader.diagnostics);
        let Some((root, place)) = root else { return Err(Report::new(loader.sources, found)) };
        if root.get("scenario").is_none() {
            let what = other_file(&root, "scenario");
            let (code, message) = match what {
                Some(what) => (Code::WrongFile, format!("this is {what}, not a scenario")),
                None => (Code::MissingKey, "the scenario has no section [scenario]".to_owned()),
            };
            let help = "add [scenario] with `graph = \"task.toml\"`, `bench = \"bench.toml\"` and `for_s = 20.0`";
            let help = what.is_none().then(|| help.to_owned());
            found.push(Diagnostic::new(code, place, message).with_help(help));
            return Err(Report::new(loader.sources, found));
        }
        let mut reader = Reader::new(&loader.sources);
        let document = document::document(&root, &mut reader);
        found.extend(reader.mistakes.into_iter().map(spanned));
        let for_s = document.scenario.as_ref().map(|scenario| *scenario.for_s);
        found.extend(document.checks.iter().flat_map(|check| check.mistakes(for_s)));
        found.extend(nothing_asked(&root, &document));
        let files = document.files(&loader.sources);
        let unread: Vec<Diagnostic> = files.iter().filter_map(|file| Some(spanned(file.bytes().err()?))).collect();
        let Some(request) = request(&files).filter(|_| unread.is_empty()) else {
            found.extend(unread);
            return Err(Report::new(loader.sources, found));
        };
        match plan_in(loader, catalogue, &request) {
            Ok(plan) => lookup::look_up(path, &document, request, &plan, catalogue, found),
            Err(report) => {
                found.extend(report.diagnostics);
                Err(Report::new(report.sources, found))
            }
        }
    }

    /// Whether a text is a scenario: it has a section [scenario].
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        text.lines().any(|line| line.trim() == "[scenario]" || line.trim_start().starts_with("scenario."))
    }

    /// Its name: that of its file.
    #[must_use]
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned()
    }

    /// The same with other seeds, from 1 to `count`; one without seeds stays as it is.
    #[must_use]
    pub fn with_seeds(mut self, count: u64) -> Self {
        if !self.seeds.is_empty() {
            self.seeds = (1..=count).collect();
        }
        self
    }

    /// The seed of each run.
    #[must_use]
    pub fn runs(&self) -> Vec<Option<u64>> {
        if self.seeds.is_empty() { vec![None] } else { self.seeds.iter().copied().map(Some).collect() }
    }

    /// Every figure over all runs, in the order of the file.
    #[must_use]
    pub fn rows(&self, trials: &[Trial]) -> Vec<Row> {
        let mut rows = self.rows.clone();
        for (i, row) in rows.iter_mut().enumerate() {
            row.values = trials.iter().map(|trial| trial.figures[i]).collect();
        }
        rows
    }
}

/// The task on its bench, if there is a task.
fn request(files: &[FilePath]) -> Option<Request> {
    let (graph, bench) = (files.first()?, files.get(1));
    Some(Request { bench: bench.map(|bench| bench.path.clone()), ..Request::file(&graph.path) })
}

/// A scenario that asks nothing and tells nothing.
fn nothing_asked(root: &crate::source::Table, document: &Document) -> Option<Diagnostic> {
    let (key, _) = root.entry("scenario")?;
    let table = document.scenario.as_ref()?;
    let asks = [&table.never_lost, &table.stays_in, &table.ends_in].iter().any(|word| word.is_some());
    let is_idle = root.get("check").is_none() && !asks;
    let help = "add a check: [check.force], of = \"touch.force\", settles_to = 1.0, within = 0.1";
    is_idle.then(|| Diagnostic::new(Code::MissingKey, key.span.clone(), "the scenario checks nothing").help(help))
}

/// A row without values.
fn row(check: &str, of: &str, figure: judge::Figure, unit: &str, bound: Bound, paper: Option<f64>) -> Row {
    let unit = if figure.is_time() { "s" } else { unit };
    Row { check: check.into(), of: of.into(), figure, unit: unit.into(), bound, paper, values: Vec::new() }
}
