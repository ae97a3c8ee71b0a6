//! The rules of the house that a compiler does not know.

use std::fs;
use std::path::{Path, PathBuf};

use tactflow_tests::workspace;

fn rust_files(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.ends_with("target") {
            rust_files(&path, files);
        } else if path.extension().is_some_and(|end| end == "rs") {
            files.push(path);
        }
    }
}

fn sources(folders: &[&str]) -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    folders.iter().for_each(|folder| rust_files(&workspace().join(folder), &mut files));
    assert!(!files.is_empty());
    files.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

/// The code of a file, without its comments and its tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

#[test]
fn no_file_is_longer_than_500_lines() {
    for (path, text) in sources(&["runtime", "nodes", "tests"]) {
        assert!(text.lines().count() <= 500, "{} has {} lines", path.display(), text.lines().count());
    }
}

#[test]
fn every_file_says_what_it_is() {
    for (path, text) in sources(&["runtime", "nodes", "tests"]) {
        assert!(text.starts_with("//!"), "{}", path.display());
    }
}

#[test]
fn the_runtime_knows_no_node_no_sensor_and_no_robot() {
    let catalogue = tactflow_nodes::catalogue();
    let nodes = catalogue.nodes().iter().map(|node| node.spec().name.to_string());
    let devices = catalogue.devices().iter().map(|device| device.name().to_string());
    let names: Vec<String> = nodes.chain(devices).collect();
    assert!(names.len() > 15);
    for (path, text) in sources(&["runtime/src"]) {
        let code = code(&text);
        for name in names.iter().filter(|name| name.contains('_')) {
            assert!(!code.contains(name.as_str()), "{} names `{name}`", path.display());
        }
        assert!(!code.contains("tactflow_nodes"), "{}", path.display());
    }
    let manifest = fs::read_to_string(workspace().join("runtime/Cargo.toml")).unwrap();
    assert!(!manifest.contains("tactflow-nodes") && !manifest.contains("urdf"));
}

#[test]
fn the_tick_names_no_lock_and_no_tokio() {
    let parts = ["tick", "station", "inlet", "command", "timeline"];
    for part in parts {
        let path = workspace().join(format!("runtime/src/engine/{part}.rs"));
        let code = code(&fs::read_to_string(&path).unwrap());
        for word in ["tokio", "Mutex", "RwLock", "Condvar", "mpsc", "async", "await", "Box::new", "Vec::new", "format!"]
        {
            assert!(!code.contains(word), "{} names {word}", path.display());
        }
    }
}

#[test]
fn only_the_edge_names_tokio() {
    let edge = ["runtime/src/device/live.rs", "runtime/src/engine/shell.rs"].map(|path| workspace().join(path));
    for (path, text) in sources(&["runtime/src", "nodes/src"]) {
        assert!(edge.contains(&path) || !code(&text).contains("tokio"), "{} names tokio", path.display());
    }
}

#[test]
fn transcendental_functions_come_from_libm() {
    let methods = [
        ".sin()",
        ".cos()",
        ".tan()",
        ".atan2(",
        ".acos()",
        ".asin()",
        ".exp()",
        ".ln()",
        ".powf(",
        ".sin_cos()",
        ".mul_add(",
    ];
    for (path, text) in sources(&["runtime/src", "nodes/src"]) {
        let code = code(&text);
        for method in methods.iter().filter(|_| !path.ends_with("tests.rs")) {
            assert!(!code.contains(method), "{} calls {method}", path.display());
        }
    }
}
