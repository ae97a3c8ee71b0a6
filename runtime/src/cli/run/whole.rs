//! `run --record`: the recording of the whole run.

use std::path::{Path, PathBuf};

use super::Job;
use super::target::{is_special, is_stdout};
use crate::cli::shell::patience::Patience;
use crate::cli::shell::{FAULTED, Shell};
use crate::cli::text::number::count_of;
use crate::engine::{End, Engine};
use crate::graph::Request;
use crate::record::OutputFile;
use crate::recording::{RecordRequest, RunRecorded, RunRecorder};

/// The recording of a run.
pub(crate) struct WholeRun {
    path: PathBuf,
    recorder: RunRecorder,
    has_reported_end: bool,
    has_reported_loss: bool,
}

/// Checks the name of a recording.
///
/// # Errors
/// If it does not end in .mcap and is no pipe or device.
pub(crate) fn check_name(path: &Path) -> Result<(), String> {
    if is_special(path) || path.extension().is_some_and(|extension| extension == "mcap") {
        return Ok(());
    }
    Err(format!("`{}` does not end in .mcap: write for example `--record run.mcap`", path.display()))
}

impl WholeRun {
    /// Starts to record to an open file.
    ///
    /// # Errors
    /// If a file of the graph cannot be attached.
    pub(crate) fn start(
        (path, file): (&Path, OutputFile),
        engine: &mut Engine,
        (request, is_real): (&Request, bool),
    ) -> Result<Self, String> {
        let request = RecordRequest { request, is_real, seed: None, path: Some(path).filter(|path| !is_special(path)) };
        let recorder = RunRecorder::start(file, engine, &request)?;
        Ok(Self { path: path.to_owned(), recorder, has_reported_end: false, has_reported_loss: false })
    }

    /// Adds the last tick.
    pub(crate) fn add(&mut self, engine: &Engine, patience: &Patience) {
        self.recorder.record(engine, || patience.may_wait());
        if self.recorder.has_ended() {
            if !std::mem::replace(&mut self.has_reported_end, true) && !is_stdout(&self.path) {
                tracing::warn!("the recording `{}` ends here; the run goes on", self.path.display());
            }
        } else if self.recorder.lost() > 0 && !std::mem::replace(&mut self.has_reported_loss, true) {
            let (path, tick) = (self.path.display(), engine.ticks());
            tracing::warn!("the recording `{path}` is written too slowly: it cannot be replayed from tick {tick} on");
        }
    }

    /// Notes why the run has ended.
    pub(crate) fn end(&mut self, engine: &Engine, end: &End) {
        self.recorder.end(engine, end);
    }

    /// Completes the file and reports it; returns the exit code.
    pub(crate) fn finish(self, job: &Job, shell: &Shell, goes_on: impl FnMut(u64) -> bool) -> u8 {
        let ports = count_of(self.recorder.ports(), "port");
        let name = self.path.display();
        let RunRecorded { ticks, lost, first_lost, lost_ports, error } = self.recorder.finish(goes_on);
        let of_ticks = |count: u64| count_of(count as usize, "tick");
        if let Some(error) = error {
            if is_stdout(&self.path) && error.kind() == std::io::ErrorKind::BrokenPipe {
                return 0;
            }
            shell.error(format_args!("cannot write `{name}`: {error}"));
            return FAULTED;
        }
        if !is_stdout(&self.path) {
            job.say(shell, &format!("wrote {name}: {}, {ports}", of_ticks(ticks)));
        }
        if let Some(first) = first_lost {
            let lost = of_ticks(lost);
            shell
                .error(format_args!("`{name}` lacks the inputs of {lost}: it cannot be replayed from tick {first} on"));
        } else if lost_ports > 0 {
            shell.error(format_args!(
                "`{name}` lacks the ports of {}, because it was written too slowly",
                of_ticks(lost_ports)
            ));
        }
        if lost + lost_ports > 0 { FAULTED } else { 0 }
    }
}
