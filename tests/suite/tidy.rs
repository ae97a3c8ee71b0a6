//! The rules of the house that a compiler does not know.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use tactflow_runtime::signal::Kind;
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

pub(crate) fn sources(folders: &[&str]) -> Vec<(PathBuf, String)> {
    let mut files = Vec::new();
    folders.iter().for_each(|folder| rust_files(&workspace().join(folder), &mut files));
    assert!(!files.is_empty());
    files.into_iter().map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

/// The code of a file, without its comments and its tests.
pub(crate) fn code(text: &str) -> String {
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

/// The string literals of a file, without its tests.
fn literals(text: &str) -> Vec<String> {
    fn collect(tokens: proc_macro2::TokenStream, found: &mut Vec<String>) {
        for token in tokens {
            match token {
                proc_macro2::TokenTree::Group(group) => collect(group.stream(), found),
                proc_macro2::TokenTree::Literal(literal) => {
                    found.extend(syn::parse_str::<syn::LitStr>(&literal.to_string()).ok().map(|text| text.value()));
                }
                _ => {}
            }
        }
    }
    let mut found = Vec::new();
    collect(code(text).parse().unwrap(), &mut found);
    found
}

/// Whether a literal names something: it is the name, or holds it in backticks or quotes.
fn names(literal: &str, name: &str) -> bool {
    let quoted = ['`', '"', '\''].map(|quote| format!("{quote}{name}{quote}"));
    literal == name || quoted.iter().any(|quoted| literal.contains(quoted.as_str()))
}

#[test]
fn the_runtime_knows_no_node_no_sensor_and_no_robot() {
    let catalogue = tactflow_nodes::catalogue();
    let nodes = catalogue.nodes().iter().map(|node| node.spec().name.to_string());
    let devices = catalogue.devices().iter().map(|device| device.name().to_string());
    // The device that plays a recording has the name of a command of the tool.
    let known: Vec<String> = nodes.chain(devices).filter(|name| name != "replay").collect();
    let specs = catalogue.nodes().iter().map(|node| node.spec());
    let inputs: BTreeSet<String> =
        specs.flat_map(|spec| spec.inputs).map(|input| format!("in.{}", input.name)).collect();
    assert!(known.len() > 40 && inputs.len() > 20);
    for (path, text) in sources(&["runtime/src"]).into_iter().filter(|(path, _)| !path.ends_with("tests.rs")) {
        let code = code(&text);
        for name in known.iter().filter(|name| name.contains('_')) {
            assert!(!code.contains(name.as_str()), "{} names `{name}`", path.display());
        }
        for literal in literals(&text) {
            let named = known.iter().find(|name| names(&literal, name));
            let wired = inputs
                .iter()
                .find(|input| literal.contains(&format!("{input}`")) || literal.contains(&format!("{input} ")));
            assert!(named.is_none() && wired.is_none(), "{} names a node or an input: {literal:?}", path.display());
        }
        assert!(!code.contains("tactflow_nodes"), "{}", path.display());
    }
    let manifest = fs::read_to_string(workspace().join("runtime/Cargo.toml")).unwrap();
    assert!(!manifest.contains("tactflow-nodes") && !manifest.contains("urdf"));
}

#[test]
fn the_derives_know_every_kind_of_signal() {
    let port = fs::read_to_string(workspace().join("runtime/derive/src/port.rs")).unwrap();
    let (_, list) = port.split_once("const SIGNALS").unwrap();
    // Behind the type `[&str; 13]`.
    let list = list.split(';').nth(1).unwrap();
    let named: BTreeSet<&str> = list.split('"').skip(1).step_by(2).collect();
    let mut kinds: BTreeSet<String> = Kind::ALL.iter().map(|kind| format!("{kind:?}")).collect();
    kinds.extend(["f64".to_owned(), "bool".to_owned()]);
    assert_eq!(named, kinds.iter().map(String::as_str).collect());
}

#[test]
fn what_runs_inside_a_tick_names_no_lock_and_no_tokio() {
    let files = sources(&["runtime/src/engine/core"]);
    assert!(files.len() > 5);
    for (path, text) in files {
        let code = code(&text);
        for word in ["tokio", "Mutex", "RwLock", "Condvar", "mpsc", "async", "await", "Box::new", "Vec::new", "format!"]
        {
            assert!(!code.contains(word), "{} names {word}", path.display());
        }
    }
}

#[test]
fn only_the_edge_names_tokio() {
    let edge = [
        "runtime/src/device/live.rs",
        "runtime/src/engine/session/caught.rs",
        "runtime/src/socket/follower.rs",
        "runtime/src/socket/hub.rs",
        "runtime/src/socket/lines.rs",
        "runtime/src/socket/server.rs",
        "nodes/src/devices/agni/driver.rs",
        "nodes/src/devices/agni/session.rs",
        "nodes/src/devices/agni/tests.rs",
        "nodes/src/devices/link/backoff.rs",
        "nodes/src/devices/link/mod.rs",
        "nodes/src/devices/link/serial.rs",
        "nodes/src/devices/link/tcp.rs",
        "nodes/src/devices/link/udp.rs",
        "nodes/src/devices/link/websocket.rs",
        "nodes/src/devices/lockstep/free.rs",
        "nodes/src/devices/ur/driver.rs",
        "nodes/src/devices/ur/program.rs",
        "nodes/src/devices/ur/rtde.rs",
        "nodes/src/devices/ur/session.rs",
        "nodes/src/devices/lwr_fri/driver.rs",
        "nodes/src/devices/process/child.rs",
        "nodes/src/devices/process/live.rs",
        "nodes/src/devices/process/pad.rs",
        "nodes/src/devices/process/session.rs",
        "nodes/src/devices/process/stepped.rs",
        "nodes/src/devices/ros2/driver.rs",
        "nodes/src/devices/ros2/guide.rs",
        "nodes/src/devices/ros2/sensor.rs",
        "nodes/src/devices/stream/driver.rs",
        "nodes/src/tool/sniff.rs",
    ];
    let edge = edge.map(|path| workspace().join(path));
    for (path, text) in sources(&["runtime/src", "nodes/src"]) {
        let is_test = path.ends_with("tests.rs");
        assert!(is_test || edge.contains(&path) || !code(&text).contains("tokio"), "{} names tokio", path.display());
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
