//! `tactflow new`: each file that it writes loads, and a task runs as it is.

use std::fs;

use tempfile::tempdir;

use crate::tool::{said, tool};

/// Writes a file, and returns its path.
fn written(folder: &std::path::Path, what: &str, name: &str) -> String {
    let path = folder.join(format!("{name}.{}", if what == "node" { "rs" } else { "toml" }));
    let path = path.to_str().unwrap();
    let said = said(&mut tool(&["new", what, name, "-o", path]));
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.out.starts_with(&format!("wrote {path}\nnext: ")), "{}", said.out);
    assert!(!fs::read_to_string(path).unwrap().contains("NAME"));
    path.to_owned()
}

#[test]
fn a_new_task_runs_as_it_is_and_holds_the_pressure() {
    let folder = tempdir().unwrap();
    let task = written(folder.path(), "task", "hold");
    let run = said(&mut tool(&["run", &task, "--for", "8s"]));
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{}", run.out);
    assert!(run.out.contains("servo"), "{}", run.out);
    let again = said(&mut tool(&["new", "task", "hold", "-o", &task]));
    assert!(again.code == 2 && again.err.contains("exists, so it is not replaced"), "{}", again.err);
}

#[test]
fn a_new_bench_takes_a_new_pad_a_new_robot_and_every_shipped_task_of_one_arm() {
    let folder = tempdir().unwrap();
    let bench = written(folder.path(), "bench", "cell");
    written(folder.path(), "pad", "mat");
    written(folder.path(), "robot", "arm6");
    let text = fs::read_to_string(&bench).unwrap();
    let own = text.replace("builtin:pads/flexitac_16x32.toml", "mat.toml").replace("builtin:ur5e.toml", "arm6.toml");
    assert_ne!(text, own);
    for bench_text in [text, own] {
        fs::write(&bench, bench_text).unwrap();
        let checked = said(&mut tool(&["check", "graphs/hybrid.toml", "--bench", &bench]));
        assert!(checked.code == 0 && checked.out.contains("`arm` without commands: it stops"), "{}", checked.err);
    }
}

#[test]
fn a_new_node_is_the_one_that_the_tests_run() {
    let folder = tempdir().unwrap();
    let node = fs::read_to_string(written(folder.path(), "node", "template_node")).unwrap();
    assert_eq!(node, include_str!("../../nodes/src/tool/new/node.rs"));
}
