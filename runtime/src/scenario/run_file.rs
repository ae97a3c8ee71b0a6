//! The file that a run of a scenario is recorded to: a table of its numbers, or the whole run.

use std::io;
use std::path::Path;

use crate::engine::{End, Engine};
use crate::graph::Request;
use crate::record::{OutputFile, RecordFormat, Recorder};
#[cfg(feature = "mcap")]
use crate::recording::{RecordRequest, RunRecorder, about_run};

/// A recording of a run.
pub(super) enum RunFile {
    Rows(Recorder),
    #[cfg(feature = "mcap")]
    Whole(RunRecorder),
}

impl RunFile {
    /// Creates the file. One that ends in .mcap contains the whole run.
    ///
    /// # Errors
    /// If it cannot be created.
    pub(super) fn create(path: &Path, engine: &mut Engine, request: &Request, seed: Option<u64>) -> io::Result<Self> {
        #[cfg(feature = "mcap")]
        if path.extension().is_some_and(|extension| extension == "mcap") {
            let request = RecordRequest { request, is_real: false, seed, path: Some(path) };
            let file = OutputFile::create(path)?;
            return RunRecorder::start(file, engine, &request).map(Self::Whole).map_err(io::Error::other);
        }
        #[cfg(feature = "mcap")]
        let graph = about_run(engine, request, false);
        #[cfg(not(feature = "mcap"))]
        let graph = format!("graph {}", request.graph.display());
        let about: Vec<String> = [graph].into_iter().chain(seed.map(|seed| format!("seed {seed}"))).collect();
        Recorder::start(OutputFile::create(path)?, RecordFormat::Csv.rows(false), engine, &about).map(Self::Rows)
    }

    /// Adds the last tick.
    pub(super) fn record(&mut self, engine: &Engine, may_wait: impl Fn() -> bool) {
        match self {
            Self::Rows(rows) => rows.record(engine, may_wait),
            #[cfg(feature = "mcap")]
            Self::Whole(whole) => whole.record(engine, may_wait),
        }
    }

    /// Completes the file. Returns the error that ended it, if one did.
    #[cfg_attr(not(feature = "mcap"), expect(unused_variables, reason = "only a whole run needs them"))]
    pub(super) fn finish(self, engine: &Engine, end: &End) -> Option<io::Error> {
        match self {
            Self::Rows(rows) => rows.finish(|_| true).error,
            #[cfg(feature = "mcap")]
            Self::Whole(mut whole) => {
                whole.end(engine, end);
                whole.finish(|_| true).error
            }
        }
    }
}
