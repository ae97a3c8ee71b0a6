//! Every fix can be applied as it stands: the mistake is gone, no new one appears, and after at most three applications
//! the graph loads, unless it has mistakes without a fix.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::source::{Code, Diagnostic, Edit, Report, Severity, SourceMap};
use tactflow_tests::{catalogue, toml_files, workspace};

/// Rounds of fixes after which a graph loads.
const MAX_ROUNDS: usize = 3;

/// The errors of a graph by code and message.
type Found = BTreeSet<(Code, String)>;

fn found(report: Option<&Report>) -> Found {
    let all = report.iter().flat_map(|report| &report.diagnostics);
    let errors = all.filter(|diagnostic| diagnostic.code.severity() == Severity::Error);
    errors.map(|diagnostic| (diagnostic.code, diagnostic.message.clone())).collect()
}

pub(crate) fn check(graph: &Path) -> Option<Report> {
    compile(&catalogue(), &Request::file(graph)).map_or_else(Some, |plan| plan.warnings())
}

/// Writes the files that edits change, and returns what they were.
fn apply(sources: &SourceMap, edits: &[Edit]) -> Vec<(PathBuf, String)> {
    let files = sources.edited(edits).into_iter().map(|(name, text)| {
        let path = PathBuf::from(name);
        let before = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        fs::write(&path, text).unwrap();
        (path, before)
    });
    files.collect()
}

/// Applies one fix, and returns what is wrong with it. The files are restored.
pub(crate) fn try_fix(graph: &Path, report: &Report, fixed: &Diagnostic) -> Option<String> {
    let before = found(Some(report));
    let files = apply(&report.sources, &fixed.fix);
    let after = check(graph);
    files.into_iter().for_each(|(path, text)| fs::write(path, text).unwrap());
    let rest = found(after.as_ref());
    let gone = (fixed.code, fixed.message.clone());
    let is_new = |entry: &&(Code, String)| !before.contains(*entry);
    // What a file that could not be read has hidden is not new.
    let hides = matches!(fixed.code, Code::Syntax | Code::Unreadable | Code::WrongFile);
    let new: Vec<_> = rest.iter().filter(is_new).filter(|_| !hides).collect();
    let text = || format!("{}: `{}`, help: {:?}", graph.display(), fixed.message, fixed.help);
    match (rest.contains(&gone), new.is_empty()) {
        (true, _) => Some(format!("{}\nstays after its fix {:?}", text(), fixed.fix)),
        (_, false) => Some(format!("{}\nleads to {new:?} after its fix {:?}", text(), fixed.fix)),
        _ => None,
    }
}

/// Applies the fixes of a graph round by round, and returns the number of rounds after which it loads.
pub(crate) fn rounds(graph: &Path) -> Option<usize> {
    for round in 0..=MAX_ROUNDS {
        let Err(report) = compile(&catalogue(), &Request::file(graph)) else { return Some(round) };
        let edits: Vec<Edit> = report.diagnostics.iter().flat_map(|d| d.fix.clone()).collect();
        if edits.is_empty() {
            return None;
        }
        apply(&report.sources, &edits);
    }
    None
}

/// A copy of the broken graphs, beside the shipped ones that they use.
fn copied() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["graphs", "tests/errors"] {
        let to = folder.path().join(name);
        fs::create_dir_all(&to).unwrap();
        let from = workspace().join(name).join(".");
        assert!(std::process::Command::new("cp").arg("-r").arg(from).arg(to).status().unwrap().success());
    }
    folder
}

#[test]
fn every_fix_of_a_broken_graph_mends_its_mistake_and_makes_no_new_one() {
    let folder = copied();
    let (mut tried, mut wrong) = (0, Vec::new());
    for graph in toml_files(&folder.path().join("tests/errors")) {
        let Some(report) = check(&graph) else { panic!("{} loads", graph.display()) };
        for diagnostic in report.diagnostics.iter().filter(|diagnostic| !diagnostic.fix.is_empty()) {
            tried += 1;
            wrong.extend(try_fix(&graph, &report, diagnostic));
        }
    }
    assert!(tried > 30, "{tried} fixes");
    assert!(wrong.is_empty(), "{} of {tried} fixes are wrong\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn a_graph_whose_mistakes_all_have_fixes_loads_after_three_rounds() {
    let folder = copied();
    let mut loaded = 0;
    for graph in toml_files(&folder.path().join("tests/errors")) {
        let report = check(&graph).expect("a broken graph");
        if report.diagnostics.iter().all(|diagnostic| !diagnostic.fix.is_empty()) {
            assert!(rounds(&graph).is_some(), "{}: {}", graph.display(), check(&graph).unwrap().render(false));
            loaded += 1;
        }
    }
    assert!(loaded > 5, "{loaded} graphs");
}

#[test]
fn a_suggested_name_and_a_line_to_add_are_fixes() {
    for graph in toml_files(&workspace().join("tests/errors")) {
        for diagnostic in check(&graph).iter().flat_map(|report| &report.diagnostics) {
            let help = diagnostic.help.as_deref().unwrap_or_default();
            let is_fix = help.starts_with("did you mean") || help.starts_with("add `");
            let is_other = help.contains("there already");
            assert!(!is_fix || is_other || !diagnostic.fix.is_empty(), "{}: {help}", graph.display());
            assert!(diagnostic.fix.is_empty() || !help.contains('…'), "{}: {help}", graph.display());
        }
    }
}
