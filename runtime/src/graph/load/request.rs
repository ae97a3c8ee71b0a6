//! Which graph to load, on which bench, and with which changes.

use std::path::PathBuf;
use std::sync::Arc;

use crate::device::RecordedDevice;
use crate::source::AttachedFiles;

/// Which graph to load, and what to change in it.
#[derive(Debug, Clone, Default)]
#[must_use]
pub struct Request {
    /// The graph file.
    pub graph: PathBuf,
    /// The text of the graph, instead of the content of the file.
    pub text: Option<String>,
    /// The bench file, instead of the bench of the graph.
    pub bench: Option<PathBuf>,
    /// The text of the bench, instead of a file.
    pub bench_text: Option<String>,
    /// Assignments `key=value` that override values of the files.
    pub set: Vec<String>,
    /// Assignments `key=value` that override values of the file of a part, each with that file. They hold for all parts
    /// that use it, over what `set` of a part says.
    pub part_set: Vec<(PathBuf, String)>,
    /// Fraction of the limits of speed and acceleration that is used, of the joints as well; `None` for all of it.
    pub slow: Option<f64>,
    /// Values of parameters that `[live]` lists, by their names there. They replace those of the files.
    pub live: Vec<(String, f64)>,
    /// What a recording provides instead of devices and files.
    pub recorded: Option<Arc<RecordedGraph>>,
}

/// What a recording provides for a replay.
#[derive(Debug, Clone, Default)]
pub struct RecordedGraph {
    /// The devices that stand for those of the bench.
    pub devices: Vec<RecordedDevice>,
    /// The files that are read instead of those on the disk and in the catalogue; `None` for another graph.
    pub files: Option<Arc<AttachedFiles>>,
}

impl Request {
    /// Requests the graph of a file, on its own bench.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { graph: path.into(), ..Self::default() }
    }

    /// Requests a graph given as text, with paths relative to the working folder.
    pub fn text(text: impl Into<String>) -> Self {
        Self { graph: "graph.toml".into(), text: Some(text.into()), ..Self::default() }
    }

    /// Replaces the bench.
    pub fn bench(mut self, path: impl Into<PathBuf>) -> Self {
        self.bench = Some(path.into());
        self
    }

    /// Uses a fraction of the limits of speed and acceleration, from 0 to 1.
    pub fn slow(self, fraction: f64) -> Self {
        Self { slow: Some(fraction), ..self }
    }

    /// Overrides a value of the files, for example `nodes.pid.gains.x.kp=3`.
    pub fn set(mut self, assignment: impl Into<String>) -> Self {
        self.set.push(assignment.into());
        self
    }
}
