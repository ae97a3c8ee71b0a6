//! Broken graphs and scenarios: the expected message stands under the offending token, in the file itself.
//!
//! `#  ^^^^ code: message` speaks of the line above it, `#       help: …` and `#           | …` of the message above. A help
//! that can be applied as it stands is a `fix: …`.
//! With `TACTFLOW_BLESS=1` the comments are written anew; read the difference before you commit it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::scenario::Scenario;
use tactflow_runtime::source::SourceMap;
use tactflow_runtime::source::{Code, Diagnostic, Report};
use tactflow_tests::{catalogue, toml_files};

/// Relative to this crate, where tests run: messages show paths as they are given.
fn folder() -> PathBuf {
    PathBuf::from("errors")
}

fn is_expectation(line: &str) -> bool {
    let comment = line.trim_start().strip_prefix('#').map(str::trim_start);
    comment.is_some_and(|text| {
        text.starts_with('^') || text.starts_with("help: ") || text.starts_with("fix: ") || text.starts_with("| ")
    })
}

/// What a diagnostic looks like under its line.
fn comment(diagnostic: &Diagnostic, sources: &SourceMap) -> Vec<String> {
    let file = sources.file_at(diagnostic.span.start);
    let (_, column) = file.line_column(diagnostic.span.start);
    let local = file.local(&diagnostic.span);
    let width = file.text[local].lines().next().map_or(0, |line| line.chars().count()).max(1);
    // The `#` of the comment takes the first column.
    let (skip, width) = if column == 1 { (0, width.saturating_sub(1).max(1)) } else { (column - 2, width) };
    let pad = " ".repeat(skip);
    let mut lines = vec![format!("#{pad}{} {}: {}", "^".repeat(width), diagnostic.code, diagnostic.message)];
    if let Some(help) = &diagnostic.help {
        let indent = " ".repeat(width);
        for (i, line) in help.lines().enumerate() {
            let label = if diagnostic.fix.is_empty() { "help:" } else { "fix:" };
            lines.push(format!("#{pad}{indent} {} {line}", if i == 0 { label } else { "    |" }));
        }
    }
    lines
}

/// The file as it should be, given everything that is wrong with it in any graph.
fn annotated(path: &Path, reports: &[Report]) -> String {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).unwrap();
    let mut result = String::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !is_expectation(line)) {
        result.push_str(line);
        result.push('\n');
        let mut seen = BTreeSet::new();
        for (report, diagnostic) in
            reports.iter().flat_map(|report| report.diagnostics.iter().map(move |d| (report, d)))
        {
            let file = report.sources.file_at(diagnostic.span.start);
            let is_here = file.name == name && file.line_column(diagnostic.span.start).0 == i + 1;
            let comment = comment(diagnostic, &report.sources).join("\n");
            if is_here && seen.insert(comment.clone()) {
                result.push_str(&comment);
                result.push('\n');
            }
        }
    }
    result
}

/// The broken graphs, and the broken scenarios.
fn broken() -> Vec<PathBuf> {
    [folder(), folder().join("scenarios")].iter().flat_map(|folder| toml_files(folder)).collect()
}

fn report(path: &Path) -> Report {
    if path.parent().is_some_and(|folder| folder.ends_with("scenarios")) {
        let loaded = Scenario::load(&catalogue(), path);
        return loaded.err().unwrap_or_else(|| panic!("{} loads", path.display()));
    }
    match compile(&catalogue(), &Request::file(path)) {
        Ok(plan) => plan.warnings().unwrap_or_else(|| panic!("{} loads, and nothing is said", path.display())),
        Err(report) => report,
    }
}

#[test]
fn every_mistake_shows_on_its_token_and_nothing_else_does() {
    let is_blessing = std::env::var_os("TACTFLOW_BLESS").is_some();
    let graphs = broken();
    let reports: Vec<Report> = graphs.iter().map(|graph| report(graph)).collect();
    let beside = ["benches", "parts"].iter().flat_map(|name| toml_files(&folder().join(name)));
    let mut wrong = Vec::new();
    for file in graphs.iter().cloned().chain(beside) {
        let expected = annotated(&file, &reports);
        if fs::read_to_string(&file).unwrap() != expected {
            if is_blessing {
                fs::write(&file, &expected).unwrap();
            }
            wrong.push(format!("{} should be\n{expected}", file.display()));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_code_has_a_file() {
    let mut seen = BTreeSet::new();
    for graph in broken() {
        seen.extend(report(&graph).diagnostics.into_iter().map(|diagnostic| diagnostic.code));
    }
    let missing: Vec<_> = Code::ALL.iter().filter(|code| !seen.contains(code)).map(|code| code.name()).collect();
    assert!(missing.is_empty(), "no file in tests/errors shows {missing:?}");
}

#[test]
fn no_mistake_is_told_twice() {
    for graph in broken() {
        let report = report(&graph);
        let mut end = 0;
        for diagnostic in &report.diagnostics {
            assert!(
                diagnostic.span.start >= end,
                "{}: {} is on a token that has its message",
                graph.display(),
                diagnostic.message
            );
            end = diagnostic.span.end.max(diagnostic.span.start + 1);
        }
    }
}
