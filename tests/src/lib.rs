//! What the tests share: where things are, and small nodes that make one sentence of the semantics visible.

#[cfg(unix)]
pub mod cell;
pub mod devices;
pub mod examples;
pub mod fuzz;
pub mod large;
pub mod nodes;
pub mod saboteur;
pub mod samples;
pub mod true_pad;

use std::path::{Path, PathBuf};

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::graph::Request;

/// The folder of the workspace.
#[must_use]
pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests stand in the workspace")
}

/// Every graph that ships.
#[must_use]
pub fn shipped_graphs() -> Vec<PathBuf> {
    toml_files(&workspace().join("graphs"))
}

/// The tasks that ship and drive one arm, and not the graphs that consist of such tasks.
#[must_use]
pub fn single_tasks() -> Vec<PathBuf> {
    let is_single = |path: &PathBuf| std::fs::read_to_string(path).is_ok_and(|text| text.contains("\n[commands]\n"));
    shipped_graphs().into_iter().filter(is_single).collect()
}

/// A task that ships, on the bench whose pad and arm do as they are told.
pub fn on_the_mock_bench(task: &str) -> Request {
    Request::file(workspace().join("graphs").join(task)).bench(workspace().join("graphs/benches/mock.toml"))
}

/// The TOML files of a folder, sorted by name.
///
/// # Panics
/// If the folder cannot be read.
#[must_use]
pub fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let paths = entries.map(|entry| entry.expect("a folder can be listed").path());
    let mut files: Vec<PathBuf> = paths.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    files.sort();
    files
}

/// Everything that ships, and the nodes of the tests.
pub fn catalogue() -> Catalogue {
    tactflow_nodes::catalogue().join(nodes::catalogue()).join(devices::catalogue())
}
