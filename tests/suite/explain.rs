//! `check --explain`: each code has a page, and its examples are what the page promises.

use std::fs;

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::source::{Code, Report, Severity};
use tactflow_tests::workspace;
use tempfile::tempdir;

use crate::tool::say;

/// What most graphs have in common: the header of each block, and its lines.
const COMMON: [(&str, &str); 10] = [
    ("[graph]", "clock = \"pad\""),
    ("[roles]", "pad = \"tactile_pad\"\narm = \"velocity_arm\""),
    ("[commands]", "arm.velocity = \"move.velocity\""),
    ("[parts.touch]", "file = \"builtin:parts/touch.toml\"\nin.image = \"pad.image\""),
    (
        "[nodes.guide]",
        "type = \"twist_source\"\nframe = \"pad\"\nin.gate = \"touch.present\"\ntwist = [0, 0, 0, 0, 0, 0]",
    ),
    (
        "[parts.move]",
        "file = \"builtin:parts/move.toml\"\nin.twist = \"guide.twist\"\nin.image = \"touch.image\"\n\
         in.contact = \"touch.present\"\nin.position = \"arm.position\"\nin.equilibrium = \"arm.equilibrium\"",
    ),
    (
        "[limits]",
        "linear_m_per_s = 0.05\nangular_rad_per_s = 0.8\nlinear_m_per_s2 = 1.0\nangular_rad_per_s2 = 10.0\n\
         force_n = 15.0\npeak_n = 3.0\nworkspace_min_m = [-0.8, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]\n\
         joint_rad_per_s2 = 5.0\nlead_rad = 0.1\nblind_s = 20.0\nblind_mm = 100.0",
    ),
    ("[bind]", "pad = \"pad\"\narm = \"arm\""),
    ("[devices.pad]", "type = \"mock_pad\""),
    (
        "[devices.arm]",
        "type = \"mock_arm\"\nurdf = \"builtin:lwr4p.urdf\"\ntip = \"lwr_7_link\"\n\
         start = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]",
    ),
];

/// The two examples of a page: the wrong one and the right one.
fn examples(page: &str) -> [&str; 2] {
    let mut blocks = page.split("```toml\n").skip(1).map(|block| block.split("\n```").next().unwrap());
    [blocks.next().unwrap(), blocks.next().unwrap()]
}

/// Writes the files of an example, each after a line `# NAME`, and completes the graph. Returns what the check finds.
fn check(example: &str) -> Option<Report> {
    let folder = tempdir().unwrap();
    let (mut name, mut text) = ("graph.toml", String::new());
    let mut files: Vec<(&str, String)> = Vec::new();
    for line in example.lines() {
        match line.strip_prefix("# ").filter(|name| name.ends_with(".toml") || name.ends_with(".urdf")) {
            Some(next) if text.is_empty() => name = next,
            Some(next) => files.push((std::mem::replace(&mut name, next), std::mem::take(&mut text))),
            None => text.push_str(&format!("{line}\n")),
        }
    }
    files.push((name, text));
    for (name, text) in &mut files {
        if *name == "graph.toml" {
            let names_bench = text.contains("\nbench = ");
            let is_bench = |header: &str| header == "[bind]" || header.starts_with("[devices");
            for (header, lines) in COMMON.iter().filter(|(header, _)| !(names_bench && is_bench(header))) {
                if !text.contains(header) {
                    text.push_str(&format!("\n{header}\n{lines}\n"));
                }
            }
        }
        fs::write(folder.path().join(*name), text).unwrap();
    }
    match compile(&tactflow_tests::catalogue(), &Request::file(folder.path().join("graph.toml"))) {
        Ok(plan) => plan.warnings(),
        Err(report) => Some(report),
    }
}

#[test]
fn each_code_has_a_page_with_an_example_that_gives_it_and_one_that_loads() {
    let mut wrong = Vec::new();
    for code in Code::ALL {
        let page = code.page();
        assert!(page.starts_with(&format!("# `{code}`\n\n")), "{code}: {page}");
        let [bad, good] = examples(page);
        let report = check(bad).unwrap_or_else(|| panic!("the wrong example of {code} loads"));
        if !report.diagnostics.iter().all(|diagnostic| diagnostic.code == *code) {
            wrong.push(format!("the wrong example of {code} gives\n{}", report.render(false)));
        }
        let is_bad = |report: &Report| {
            report.diagnostics.iter().any(|d| d.code.severity() == Severity::Error || d.code == *code)
        };
        if let Some(report) = check(good).filter(is_bad) {
            wrong.push(format!("the right example of {code} gives\n{}", report.render(false)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_pages_are_listed_in_an_index() {
    let folder = workspace().join("docs/errors");
    let index = fs::read_to_string(folder.join("README.md")).unwrap();
    let files = fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
    for name in files.filter(|name| name != "README.md") {
        let code = name.trim_end_matches(".md");
        assert!(Code::ALL.iter().any(|known| known.name() == code), "{name} is the page of no code");
        assert!(index.contains(&format!("- [`{code}`]({name})\n")), "the index lacks {code}");
    }
}

#[test]
fn the_tool_prints_a_page_and_the_list_of_codes() {
    let page = say(&["check", "--explain", "loop"]);
    assert_eq!((page.code, page.err.as_str()), (0, ""));
    assert!(page.out.starts_with("# `loop`\n\nWires form a cycle"), "{}", page.out);
    let list = say(&["check", "--explain"]).out;
    for code in Code::ALL {
        let line = list.lines().find(|line| line.split_whitespace().next() == Some(code.name()));
        assert!(line.is_some_and(|line| line.len() > code.name().len() + 10), "{code}: {list}");
    }
    let unknown = say(&["check", "--explain", "lop"]);
    assert_eq!((unknown.code, unknown.err.as_str()), (2, "error: unknown code `lop`\nhelp: did you mean `loop`?\n"));
}
