//! The compiler on one file: what it says, in plain lines, and the program it makes.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;

use serde::Deserialize;

/// A message of the compiler, as `--error-format=json` writes it.
#[derive(Deserialize)]
struct Message {
    level: String,
    message: String,
    code: Option<Code>,
    spans: Vec<Span>,
    children: Vec<Message>,
}

/// The code of an error, such as `E0277`.
#[derive(Deserialize)]
struct Code {
    code: String,
}

/// A place in a source file.
#[derive(Deserialize)]
struct Span {
    file_name: String,
    line_start: usize,
    column_start: usize,
    is_primary: bool,
    label: Option<String>,
    text: Vec<Line>,
}

/// A line of a place; the columns count from 1.
#[derive(Deserialize)]
struct Line {
    text: String,
    highlight_start: usize,
    highlight_end: usize,
}

/// The folder of this test's program, where its libraries are too.
fn built() -> PathBuf {
    let program = std::env::current_exe().expect("this test has a program");
    program.parent().expect("a program is in a folder").to_owned()
}

/// The library of the runtime that was built last. What this test uses was built after the last change of a source, so
/// a later one has the same sources.
fn runtime() -> PathBuf {
    let age = |path: &PathBuf| path.metadata().and_then(|file| file.modified()).unwrap_or(SystemTime::UNIX_EPOCH);
    let files = built().read_dir().expect("the folder is readable").filter_map(Result::ok).map(|entry| entry.path());
    let named = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with("libtactflow_runtime-") && name.ends_with(".rlib")
    };
    files.filter(named).max_by_key(age).expect("the runtime is built before this test")
}

/// Where the program of a case goes.
fn program(case: &Path) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(case.file_stem().expect("a case has a name"))
}

fn compile(case: &Path) -> Output {
    Command::new(std::env::var_os("RUSTC").unwrap_or("rustc".into()))
        .args(["--edition=2024", "--error-format=json", "--codegen=debuginfo=0", "--allow=dead_code"])
        .arg(format!("--extern=tactflow_runtime={}", runtime().display()))
        .arg(format!("-Ldependency={}", built().display()))
        .arg("-o")
        .arg(program(case))
        .arg(case)
        .output()
        .expect("the compiler starts")
}

/// What the compiler says of a case: each message once, with its places in the case and its notes.
pub(crate) fn mistakes(case: &Path) -> String {
    let output = compile(case);
    let lines = String::from_utf8(output.stderr).expect("the compiler writes UTF-8");
    let (mut said, mut seen) = (String::new(), BTreeSet::new());
    for line in lines.lines() {
        let message: Message =
            serde_json::from_str(line).unwrap_or_else(|error| panic!("{}: {error} in {line}", case.display()));
        let text = describe(&message, case);
        if !message.spans.is_empty() && seen.insert(text.clone()) {
            said.push_str(&text);
            said.push('\n');
        }
    }
    assert_eq!(output.status.success(), said.is_empty(), "{}: {lines}", case.display());
    said
}

fn describe(message: &Message, case: &Path) -> String {
    let code = message.code.as_ref().map(|code| format!("[{}]", code.code)).unwrap_or_default();
    let mut text = format!("{}{code}: {}\n", message.level, message.message);
    for span in message.spans.iter().filter(|span| Path::new(&span.file_name) == case) {
        let mark = if span.is_primary { "at" } else { "see" };
        let label = span.label.as_ref().map(|label| format!(": {label}")).unwrap_or_default();
        writeln!(text, "  {mark} {}:{} `{}`{label}", span.line_start, span.column_start, marked(span))
            .expect("written");
    }
    // Which other types there are changes with the types of the runtime.
    for child in message.children.iter().filter(|child| !child.message.contains("other types implement trait")) {
        let first = child.message.lines().next().unwrap_or_default();
        // A note whose places are all in the runtime is left out: it shows code that may change.
        let inside = child.spans.is_empty() || child.spans.iter().any(|span| Path::new(&span.file_name) == case);
        if inside {
            writeln!(text, "  {}: {first}", child.level).expect("written");
        }
    }
    text
}

/// The marked text of a place, of its first line.
fn marked(span: &Span) -> String {
    let Some(line) = span.text.first() else { return String::new() };
    let length = line.highlight_end.saturating_sub(line.highlight_start);
    line.text.chars().skip(line.highlight_start - 1).take(length).collect()
}

/// Runs the program of a case that compiled.
pub(crate) fn run(case: &Path) {
    let status = Command::new(program(case)).status().expect("the program starts");
    assert!(status.success(), "{}: {status}", case.display());
}
