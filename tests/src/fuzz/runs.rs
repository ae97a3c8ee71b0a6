//! Recordings of whole runs: a file that is spoilt is replayed, repaired and compared with itself.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::engine::{Engine, run_virtual};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::record::OutputFile;
use tactflow_runtime::recording::{
    RecordRequest, Replay, ReplayChanges, ReplayError, ReplayedTick, RunRecorder, diff, recover,
};

use super::Subject;
use crate::{catalogue, workspace};

/// What reading may take beside a multiple of the file: the graph and the chunks that are decoded [bytes]. The library
/// reserves the stated length of a text before it reads it, up to 4 GiB. It does not touch what it does not read.
const BESIDE: u64 = (96 << 20) + (1 << 32);
/// Length of the recorded run [s].
const LENGTH: f64 = 0.05;

/// A recording of a small graph.
pub(super) fn recordings() -> Subject {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let name = format!("tactflow-fuzz-run-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    let folder = Folder(std::env::temp_dir().join(name));
    fs::create_dir_all(&folder.0).expect("a folder for temporary files");
    let catalogue = catalogue();
    let corpus = vec![recorded(&catalogue, folder.0.join("good.mcap"))];
    Subject {
        corpus,
        read: Box::new(move |input| {
            let [spoilt, whole] = ["spoilt.mcap", "whole.mcap"].map(|name| folder.0.join(name));
            fs::write(&spoilt, input).expect("a small file");
            // `recover` replaces no file.
            let _ = fs::remove_file(&whole);
            let replayed = replay(&catalogue, &spoilt);
            let said = [diff(&spoilt, &spoilt).err(), recover(&spoilt, &whole).err()];
            for message in said.into_iter().flatten().chain(replayed.as_ref().err().cloned()) {
                assert!(!message.trim().is_empty(), "it is refused for no reason");
            }
            replayed.is_ok()
        }),
        max_memory: |input| 50 * input.len() as u64 + BESIDE,
    }
}

/// A folder that is removed in the end.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        // What is left lies among the temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Records a run, and returns the file.
fn recorded(catalogue: &Catalogue, path: PathBuf) -> Vec<u8> {
    let request = Request::file(workspace().join("tests/data/view.toml"));
    let compiled = compile(catalogue, &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(compiled);
    let file = OutputFile::create(&path).expect("a small file");
    let request = RecordRequest { request: &request, is_real: false, seed: None, path: None };
    let mut recorder = RunRecorder::start(file, &mut engine, &request).expect("the graph can be recorded");
    let outcome = run_virtual(&mut engine, LENGTH, &|| false, &mut |engine| recorder.record(engine, || true));
    recorder.end(&engine, &outcome.end);
    assert!(recorder.finish(|_| true).error.is_none(), "a small file");
    fs::read(path).expect("a small file")
}

/// Replays a file to its end. Returns why it is refused.
fn replay(catalogue: &Catalogue, path: &std::path::Path) -> Result<(), String> {
    let mut replay = Replay::open(catalogue, path, &ReplayChanges::default()).map_err(|error| match error {
        ReplayError::Message(message) => message,
        ReplayError::Graph(report) => report.render(false),
    })?;
    loop {
        match replay.step()? {
            ReplayedTick::Over | ReplayedTick::Fault(_) => return Ok(()),
            ReplayedTick::Ran(_) => {}
        }
    }
}
