//! The pages of docs/ are true: their code is the code, their graphs load, their commands run, their tables are
//! complete.

use std::fs;
use std::path::{Path, PathBuf};

use tactflow_runtime::engine::{self, Engine, RunOptions};
use tactflow_runtime::graph::{Compiled, Request, compile};
use tactflow_runtime::record::{RecordFormat, Recorder};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::{Code, Report};
use tactflow_tests::{catalogue, workspace};

use crate::tool::say;

fn page(name: &str) -> String {
    fs::read_to_string(workspace().join("docs").join(name)).unwrap()
}

fn file(path: &str) -> String {
    fs::read_to_string(workspace().join(path)).unwrap()
}

/// The pages about graphs, one after the other: their files belong to one folder.
fn reference() -> String {
    ["composing-a-task.md", "graph-files.md", "recordings.md", "command-line.md"].map(page).concat()
}

/// The blocks of a page that are fenced with exactly `fence`.
fn blocks(page: &str, fence: &str) -> Vec<String> {
    let (mut blocks, mut open) = (Vec::new(), None);
    for line in page.lines() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(info)) => open = Some((info == fence, String::new())),
            (Some((is_meant, text)), Some("")) => {
                blocks.extend(is_meant.then(|| std::mem::take(text)));
                open = None;
            }
            (Some((_, text)), _) => {
                text.push_str(line);
                text.push('\n');
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is not closed");
    assert!(!blocks.is_empty(), "there is no block of {fence}");
    blocks
}

/// The first cells of the rows of the table below a header, without backticks.
fn first_cells(page: &str, header: &str) -> Vec<String> {
    let (_, table) = page.split_once(header).unwrap_or_else(|| panic!("no table starts with {header}"));
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    rows.map(|row| row.split('|').nth(1).unwrap().trim().trim_matches('`').to_owned()).collect()
}

/// Checks a text as if it were that graph file.
fn check(graph: &Path, text: String) -> Result<Compiled, Report> {
    compile(&catalogue(), &Request { text: Some(text), ..Request::file(graph) })
}

/// Relative to this crate, where tests run: messages show paths as they are given.
fn shipped(name: &str) -> PathBuf {
    Path::new("../graphs").join(name)
}

/// The Rust blocks of a page, put together, are the file.
fn is_built_line_by_line(page: &str, fence: &str, path: &str) {
    let (shown, real) = (blocks(page, fence).concat(), file(path));
    for (i, (shown, real)) in shown.lines().zip(real.lines()).enumerate() {
        assert_eq!(shown, real, "line {} of {path}", i + 1);
    }
    assert_eq!(shown, real);
}

#[test]
fn the_walkthrough_shows_the_node_as_it_is() {
    let page = page("writing-a-node.md");
    is_built_line_by_line(&page, "rust", "tests/src/nodes/first_order_lag.rs");
    is_built_line_by_line(&page, "rust mix", "tests/src/nodes/mix.rs");
    let generic = file("nodes/src/flow/gate.rs");
    for part in blocks(&page, "rust gate") {
        assert!(generic.contains(&part), "{part}");
    }
    let [line] = &blocks(&page, "rust catalogue")[..] else { panic!("one line") };
    assert!(file("tests/src/nodes/mod.rs").contains(line.as_str()), "{line}");
    assert_eq!(blocks(&page, "rust main"), [file("tests/src/main.rs")]);
}

#[test]
fn the_walkthrough_shows_the_device_as_it_is_and_its_graph_loads() {
    let page = page("writing-a-device.md");
    is_built_line_by_line(&page, "rust", "tests/src/devices/udp_pad.rs");
    let [line] = &blocks(&page, "rust catalogue")[..] else { panic!("one line") };
    assert!(file("tests/src/devices/mod.rs").contains(line.trim()), "{line}");
    let [graph] = &blocks(&page, "toml")[..] else { panic!("one graph") };
    check(&shipped("page.toml"), graph.clone()).unwrap_or_else(|report| panic!("{}", report.render(false)));
}

#[test]
fn the_walkthrough_lists_the_forms_of_inputs_as_the_contract_does() {
    let node = file("runtime/src/node/mod.rs");
    let contract: String = node
        .lines()
        .filter_map(|line| line.strip_prefix("//! |"))
        .skip_while(|row| !row.starts_with(" field"))
        .map(|row| format!("|{row}\n"))
        .collect();
    assert!(contract.contains("sampled") && page("writing-a-node.md").contains(&contract), "{contract}");
}

#[test]
fn the_graphs_of_the_walkthrough_load_or_say_what_is_shown() {
    let page = page("writing-a-node.md");
    for text in blocks(&page, "toml") {
        check(&shipped("page.toml"), text).unwrap_or_else(|report| panic!("{}", report.render(false)));
    }
    let broken = blocks(&page, "toml broken");
    let said: Vec<String> = broken
        .into_iter()
        .map(|text| match check(&shipped("page.toml"), text) {
            Ok(_) => panic!("a broken graph loads"),
            Err(report) => report.render(false).replace("../graphs/", "graphs/"),
        })
        .collect();
    assert_eq!(blocks(&page, "text").concat(), said.concat());
}

/// The files that a page shows, in a folder of their own, and what is added to which.
fn world(page: &str, name: &str) -> (PathBuf, Vec<PathBuf>, Vec<(PathBuf, String)>) {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let (mut files, mut added) = (Vec::new(), Vec::new());
    for text in blocks(page, "toml") {
        let title = text.lines().next().and_then(|line| line.strip_prefix("# ")).expect("a block has a title");
        match title.strip_prefix("added to ") {
            Some(to) => added.push((folder.join(to), text.clone())),
            None => {
                let path = folder.join(title);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(&path, &text).unwrap();
                files.push(path);
            }
        }
    }
    (folder, files, added)
}

#[test]
fn every_graph_of_the_reference_loads() {
    let (_, files, added) = world(&reference(), "reference");
    let graphs: Vec<String> = files.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    let tasks = files.into_iter().zip(graphs).filter(|(_, text)| text.contains("[graph]"));
    let tasks: Vec<(PathBuf, String)> = tasks.collect();
    assert!(tasks.len() >= 2 && !added.is_empty());
    for (path, text) in &tasks {
        check(path, text.clone()).unwrap_or_else(|report| panic!("{}", report.render(false)));
    }
    for (path, more) in added {
        let (_, text) = tasks.iter().find(|(task, _)| *task == path).expect("it is added to a task that is shown");
        check(&path, format!("{text}{more}")).unwrap_or_else(|report| panic!("{}", report.render(false)));
    }
}

#[test]
fn the_two_arms_of_the_reference_are_those_that_ship() {
    let [graph] = &blocks(&reference(), "toml two_arms")[..] else { panic!("one graph") };
    assert!(file("graphs/two_arms.toml").ends_with(graph.as_str()));
    compile(&catalogue(), &Request::file(shipped("two_arms.toml")))
        .unwrap_or_else(|report| panic!("{}", report.render(false)));
}

#[test]
fn every_set_of_the_reference_loads() {
    let page = reference();
    let (folder, ..) = world(&page, "set");
    for line in blocks(&page, "sh").concat().lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let ["tactflow", "run", graph, ref options @ ..] = words[..] else { panic!("{line}") };
        let mut request = Request::file(folder.join(graph));
        for option in options.chunks(2) {
            assert_eq!(option[0], "--set");
            request = request.set(option[1]);
        }
        compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    }
}

#[test]
fn recordings_are_as_shown() {
    let page = reference();
    let (folder, ..) = world(&page, "recordings");
    for (format, name, fence) in [(RecordFormat::Csv, "push.csv", "csv"), (RecordFormat::Ndjson, "push.ndjson", "json")]
    {
        let plan = compile(&catalogue(), &Request::file(folder.join("push.toml")));
        let mut engine = Engine::new(plan.unwrap_or_else(|report| panic!("{}", report.render(false))));
        let path = folder.join(name);
        let mut recorder = Recorder::create(&path, format.rows(false), &engine).unwrap();
        let options = RunOptions { duration: Some(0.04), is_realtime: false, ..RunOptions::default() };
        engine::run(&mut engine, &options, &mut |engine| recorder.record(engine, || true)).unwrap();
        assert_eq!(recorder.finish(|_| true).rows, 3);
        assert_eq!([fs::read_to_string(path).unwrap()], *blocks(&page, fence));
    }
}

#[test]
fn the_reference_lists_every_code_and_every_unit() {
    let page = reference();
    let codes: Vec<&str> = Code::ALL.iter().map(|code| code.name()).collect();
    assert_eq!(first_cells(&page, "| code | meaning |"), codes);
    let units = first_cells(&page, "| unit | of |");
    let listed: Vec<String> = units.iter().map(|unit| format!("`{unit}`")).collect();
    assert!(Unit::list().starts_with(&format!("{}, each", listed.join(", "))), "{}", Unit::list());
}

#[test]
fn the_reference_lists_every_format_of_a_recording() {
    let listed = first_cells(&reference(), "| `format` |").join(" ");
    let listed: Vec<&str> = listed.split([' ', ',', '`']).filter(|name| !name.is_empty()).collect();
    let mut formats: Vec<&str> = tactflow_nodes::recordings::FORMATS.iter().map(|format| format.name).collect();
    formats.sort_unstable();
    let mut sorted = listed.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, formats);
}

#[test]
fn the_reference_lists_every_role_and_every_device() {
    let page = reference();
    let catalogue = tactflow_nodes::catalogue();
    let roles: Vec<&str> = catalogue.roles().iter().map(|role| &*role.name).collect();
    assert_eq!(first_cells(&page, "| role type | gives | takes |"), roles);
    for device in catalogue.devices() {
        assert!(page.contains(&format!("`{}`", device.name())), "{}", device.name());
    }
}

/// The commands of a page's `console` blocks, each with the `text` block that follows it directly, if any.
fn sessions(page: &str) -> Vec<(Vec<String>, String)> {
    let (mut sessions, mut fence): (Vec<(Vec<String>, String)>, Option<&str>) = (Vec::new(), None);
    for line in page.lines() {
        match (fence, line.strip_prefix("```")) {
            (None, Some(info)) => fence = Some(info),
            (Some(_), Some(_)) => fence = None,
            (Some("console"), None) => {
                let args = line.strip_prefix("$ cargo run --release -- ").expect("a command of the tool");
                sessions.push((args.split_whitespace().map(str::to_owned).collect(), String::new()));
            }
            (Some("text"), None) => {
                let (_, shown) = sessions.last_mut().expect("output stands behind its command");
                shown.push_str(line);
                shown.push('\n');
            }
            _ => {}
        }
    }
    sessions
}

#[test]
fn the_commands_of_getting_started_print_what_is_shown() {
    let sessions = sessions(&page("getting-started.md"));
    assert!(sessions.iter().filter(|(_, shown)| !shown.is_empty()).count() >= 3);
    for (args, shown) in sessions {
        let printed = say(&args.iter().map(String::as_str).collect::<Vec<_>>());
        let is_refused = shown.starts_with("error");
        assert_eq!(printed.code, if is_refused { 2 } else { 0 }, "{args:?}: {}", printed.err);
        let mut lines = if is_refused { printed.err.lines() } else { printed.out.lines() };
        for line in shown.lines() {
            assert!(lines.any(|printed| printed == line), "{args:?} does not print `{line}` there");
        }
    }
}

/// The Rust files below a folder, relative to it.
fn rust_files(root: &Path, folder: &Path, files: &mut Vec<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(root, &path, files);
        } else {
            files.push(path.strip_prefix(root).unwrap().display().to_string());
        }
    }
}

#[test]
fn the_architecture_lists_every_file_of_the_runtime() {
    let root = workspace().join("runtime/src");
    let mut files = Vec::new();
    rust_files(&root, &root, &mut files);
    let mut listed = first_cells(&page("ARCHITECTURE.md"), "| file of `runtime/src` | what it holds |");
    files.sort();
    listed.sort();
    assert_eq!(listed, files);
}

#[test]
fn every_invariant_names_tests_that_exist() {
    let page = page("ARCHITECTURE.md");
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| I")).collect();
    assert_eq!(rows.len(), 10);
    for row in rows {
        let tests: Vec<(&str, &str)> = row.split('`').filter_map(|word| word.split_once(".rs::")).collect();
        assert!(!tests.is_empty(), "{row}");
        for (path, name) in tests {
            let text = file(&format!("{path}.rs"));
            assert!(text.contains(&format!("fn {name}(")), "{path}.rs has no {name}");
        }
    }
}

/// The anchors of the headings of a page.
fn anchors(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap();
    let headings = text.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let is_kept = |letter: &char| letter.is_alphanumeric() || "- _".contains(*letter);
    headings
        .map(|heading| heading.to_lowercase().chars().filter(is_kept).collect::<String>().replace(' ', "-"))
        .collect()
}

#[test]
fn every_link_of_the_pages_leads_somewhere() {
    let docs = workspace().join("docs");
    let folders = [docs.clone(), docs.join("decisions"), docs.join("reference")];
    let files = folders.into_iter().flat_map(|folder| fs::read_dir(folder).unwrap()).map(|entry| entry.unwrap().path());
    let pages = files.chain([workspace().join("README.md"), workspace().join("CHANGELOG.md")]);
    let pages = pages.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    let mut links = 0;
    for page in pages {
        let text = fs::read_to_string(&page).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
            let path = if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            let is_there = path.exists() && (anchor.is_empty() || anchors(&path).contains(&anchor.to_owned()));
            assert!(is_there || target.contains("://"), "{}: {target}", page.display());
            links += 1;
        }
    }
    assert!(links > 10, "{links} links");
}
