//! The pages of docs/ say what is so: their code is the code, their graphs load, their tables are complete.

use std::fs;
use std::path::{Path, PathBuf};

use tactflow_runtime::diagnostic::{Code, Report};
use tactflow_runtime::engine::{self, Engine, RunOptions};
use tactflow_runtime::graph::{Plan, Request, plan};
use tactflow_runtime::record::{Format, Recorder};
use tactflow_runtime::signal::Unit;
use tactflow_tests::{catalogue, workspace};

fn page(name: &str) -> String {
    fs::read_to_string(workspace().join("docs").join(name)).unwrap()
}

fn file(path: &str) -> String {
    fs::read_to_string(workspace().join(path)).unwrap()
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
fn check(graph: &Path, text: String) -> Result<Plan, Report> {
    plan(&catalogue(), &Request { text: Some(text), ..Request::file(graph) })
}

/// Relative to this crate, where tests run: messages show paths as they are given.
fn shipped(name: &str) -> PathBuf {
    Path::new("../graphs").join(name)
}

#[test]
fn the_walkthrough_shows_the_node_as_it_is() {
    let page = page("writing-a-node.md");
    let shown = blocks(&page, "rust").concat();
    let real = file("tests/src/nodes/low_pass.rs");
    for (i, (shown, real)) in shown.lines().zip(real.lines()).enumerate() {
        assert_eq!(shown, real, "line {} of the file", i + 1);
    }
    assert_eq!(shown, real);
    let [line] = &blocks(&page, "rust catalogue")[..] else { panic!("one line") };
    assert!(file("tests/src/nodes/mod.rs").contains(line.as_str()), "{line}");
    assert_eq!(blocks(&page, "rust main"), [file("tests/src/main.rs")]);
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
    fs::create_dir_all(folder.join("robots")).unwrap();
    fs::copy(workspace().join("graphs/robots/lwr4p.urdf"), folder.join("robots/lwr4p.urdf")).unwrap();
    (folder, files, added)
}

#[test]
fn every_graph_of_the_reference_loads() {
    let (_, files, added) = world(&page("graph-files.md"), "reference");
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
fn every_set_of_the_reference_loads() {
    let page = page("graph-files.md");
    let (folder, ..) = world(&page, "set");
    for line in blocks(&page, "sh").concat().lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let ["tactflow", "run", graph, ref options @ ..] = words[..] else { panic!("{line}") };
        let mut request = Request::file(folder.join(graph));
        for option in options.chunks(2) {
            assert_eq!(option[0], "--set");
            request = request.set(option[1]);
        }
        plan(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    }
}

#[test]
fn recordings_are_as_shown() {
    let page = page("graph-files.md");
    let (folder, ..) = world(&page, "recordings");
    for (format, name, fence) in [(Format::Csv, "push.csv", "csv"), (Format::Ndjson, "push.ndjson", "json")] {
        let plan = plan(&catalogue(), &Request::file(folder.join("push.toml")));
        let mut engine = Engine::new(plan.unwrap_or_else(|report| panic!("{}", report.render(false))));
        let path = folder.join(name);
        let mut recorder = Recorder::create(&path, format, &engine, true).unwrap();
        let options = RunOptions { duration: Some(0.04), is_realtime: false, ..RunOptions::default() };
        engine::run(&mut engine, &options, &mut |engine| recorder.record(engine)).unwrap();
        recorder.finish().unwrap();
        assert_eq!([fs::read_to_string(path).unwrap()], *blocks(&page, fence));
    }
}

#[test]
fn the_reference_lists_every_code_and_every_unit() {
    let page = page("graph-files.md");
    let codes: Vec<&str> = Code::ALL.iter().map(|code| code.name()).collect();
    assert_eq!(first_cells(&page, "| code | meaning |"), codes);
    let units = first_cells(&page, "| unit | of |");
    let listed: Vec<String> = units.iter().map(|unit| format!("`{unit}`")).collect();
    assert!(Unit::list().starts_with(&format!("{}, each", listed.join(", "))), "{}", Unit::list());
}

#[test]
fn the_reference_lists_every_format_of_a_recording() {
    let listed = first_cells(&page("graph-files.md"), "| `format` |").join(" ");
    let listed: Vec<&str> = listed.split([' ', ',', '`']).filter(|name| !name.is_empty()).collect();
    let mut formats: Vec<&str> = tactflow_nodes::recordings::FORMATS.iter().map(|format| format.name).collect();
    formats.sort_unstable();
    let mut sorted = listed.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, formats);
}

#[test]
fn the_reference_lists_every_role_and_every_device() {
    let page = page("graph-files.md");
    let catalogue = tactflow_nodes::catalogue();
    let roles: Vec<&str> = catalogue.roles().iter().map(|role| &*role.name).collect();
    assert_eq!(first_cells(&page, "| role type | gives | takes |"), roles);
    for device in catalogue.devices() {
        assert!(page.contains(&format!("`{}`", device.name())), "{}", device.name());
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
    assert_eq!(rows.len(), 8);
    for row in rows {
        let tests: Vec<(&str, &str)> = row.split('`').filter_map(|word| word.split_once(".rs::")).collect();
        assert!(!tests.is_empty(), "{row}");
        for (path, name) in tests {
            let text = file(&format!("{path}.rs"));
            assert!(text.contains(&format!("fn {name}(")), "{path}.rs has no {name}");
        }
    }
}

#[test]
fn every_link_of_the_pages_leads_somewhere() {
    let docs = workspace().join("docs");
    let decisions = fs::read_dir(docs.join("decisions")).unwrap().map(|entry| entry.unwrap().path());
    let reference = fs::read_dir(docs.join("reference")).unwrap().map(|entry| entry.unwrap().path());
    let mut pages: Vec<PathBuf> = decisions.chain(reference).collect();
    pages.extend(
        ["ARCHITECTURE.md", "calibration.md", "graph-files.md", "scenarios.md", "writing-a-node.md"]
            .map(|name| docs.join(name)),
    );
    let mut links = 0;
    for page in pages {
        let text = fs::read_to_string(&page).unwrap();
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let is_there = page.parent().unwrap().join(target.split('#').next().unwrap()).exists();
            assert!(is_there || target.contains("://"), "{}: {target}", page.display());
            links += 1;
        }
    }
    assert!(links > 10, "{links} links");
}
