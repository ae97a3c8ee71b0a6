//! Loads a scenario file and checks it with its task and its bench.

use std::path::Path;

use super::document::{Document, document};
use super::lookup::look_up;
use super::model::Scenario;
use crate::catalogue::Catalogue;
use crate::graph::{Loader, Request, compile_in, into_diagnostic, wrong_file_type};
use crate::node::Reader;
use crate::source::{Code, Diagnostic, Report, Table};

impl Scenario {
    /// Loads a scenario and checks it with its task and each of its benches. Returns a scenario for each bench.
    ///
    /// # Errors
    /// Returns a diagnostic for every mistake in the scenario, in its task, and in the first bench with mistakes.
    pub fn load(catalogue: &Catalogue, path: &Path) -> Result<Vec<Self>, Report> {
        let (first, benches) = Self::load_on(catalogue, path, 0)?;
        let more = (1..benches).map(|i| Self::load_on(catalogue, path, i).map(|(scenario, _)| scenario));
        [Ok(first)].into_iter().chain(more).collect()
    }

    /// Loads a scenario on one of its benches, by its number from 0. Returns the number of benches, too.
    fn load_on(catalogue: &Catalogue, path: &Path, bench: usize) -> Result<(Self, usize), Report> {
        let mut loader = Loader::new(catalogue.builtin_files());
        let root = loader.read(path, None);
        let mut found = std::mem::take(&mut loader.diagnostics);
        let Some((root, place)) = root else { return Err(Report::new(loader.sources, found)) };
        if root.get("scenario").is_none() {
            let what = wrong_file_type(&root, "scenario");
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
        let document = document(&root, &mut reader);
        found.extend(reader.mistakes.into_iter().map(into_diagnostic));
        let for_s = document.scenario.as_ref().map(|scenario| scenario.for_s);
        found.extend(document.checks.iter().flat_map(|check| check.mistakes(for_s)));
        found.extend(document.faults.iter().filter_map(|fault| fault.mistake(for_s)));
        found.extend(without_checks(&root, &document));
        let (graph, benches) = document.files(&loader.sources);
        let files = graph.iter().chain(&benches);
        let unreadable: Vec<Diagnostic> = files.filter_map(|file| Some(into_diagnostic(file.bytes().err()?))).collect();
        let Some(graph) = graph.filter(|_| unreadable.is_empty()) else {
            found.extend(unreadable);
            return Err(Report::new(loader.sources, found));
        };
        let file = benches.get(bench).map(|file| file.path.clone());
        let request = Request { bench: file.clone(), ..Request::file(&graph.path) };
        match compile_in(loader, catalogue, &request) {
            Ok(mut plan) => {
                let vary = document.scenario.as_ref().and_then(|table| table.vary.as_ref());
                found.extend(vary.into_iter().flat_map(|vary| vary.mistakes(catalogue, &request, plan.outline())));
                let name = file.filter(|_| benches.len() > 1).map(|file| name_of(&file));
                let scenario = look_up(&document, (request, bench), &mut plan, catalogue, found)?;
                Ok((Self { bench: name, ..scenario }, benches.len()))
            }
            Err(report) => {
                found.extend(report.diagnostics);
                Err(Report::new(report.sources, found))
            }
        }
    }
}

/// Returns the name of a bench: that of its file.
fn name_of(file: &Path) -> String {
    file.file_stem().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

/// Returns a diagnostic for a scenario that checks nothing.
fn without_checks(root: &Table, document: &Document) -> Option<Diagnostic> {
    let (key, _) = root.entry("scenario")?;
    let table = document.scenario.as_ref()?;
    let has_run_checks = [&table.never_lost, &table.stays_in, &table.ends_in].iter().any(|word| word.is_some());
    let is_empty = root.get("check").is_none() && !has_run_checks;
    let help = "add a check:\n[check.force]\nof = \"touch.force\"\nsettles_to = 1.0\nwithin = 0.1";
    is_empty.then(|| Diagnostic::new(Code::MissingKey, key.span.clone(), "the scenario checks nothing").help(help))
}
