//! The files that a run writes: `--out`, `--points` and `--svg`.

use std::fmt::Display;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::{Job, JobOptions};
use crate::cli::shell::{FAULTED, Shell};
use crate::cli::still::Still;
use crate::cli::text::svg::Svg;
use crate::engine::Engine;
use crate::record::{PointPorts, PointRecorder, RecordFormat, Recorder};

/// The open files of a run.
pub(crate) struct OutputFiles<'j> {
    job: &'j Job,
    rows: Option<Recorder>,
    points: Option<PointRecorder>,
    still: Option<Still>,
}

impl<'j> OutputFiles<'j> {
    /// Creates the files before the run starts. `may_wait` lets the run wait for the disk.
    ///
    /// # Errors
    /// If one of them cannot be created.
    pub(crate) fn create(
        job: &'j Job,
        chosen: Option<&PointPorts>,
        engine: &Engine,
        may_wait: bool,
    ) -> Result<Self, String> {
        let JobOptions { out, points: wanted, svg, .. } = &job.options;
        let rows = out.as_deref().map(|path| recorder(path, engine, may_wait)).transpose()?;
        let points = wanted.as_ref().zip(chosen).map(|(wanted, chosen)| points(&wanted.path, chosen, engine));
        let points = points.transpose()?;
        let still = svg.as_deref().map(|path| still(path, &job.title, engine)).transpose()?;
        Ok(Self { job, rows, points, still })
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        if let Some(rows) = &mut self.rows {
            rows.record(engine);
        }
        if let Some(points) = &mut self.points {
            points.record(engine);
        }
        if let Some(still) = &mut self.still {
            still.add(engine);
        }
    }

    /// Completes the files and reports each; returns the exit code.
    pub(crate) fn finish(self, shell: &Shell, engine: &Engine) -> u8 {
        let (job, mut code) = (self.job, 0);
        let JobOptions { out, points, svg, .. } = &job.options;
        let mut report = |path: &Path, result: io::Result<String>| match result {
            Ok(details) => job.say(shell, &format!("wrote {}{details}", path.display())),
            Err(error) => {
                shell.error(format_args!("cannot write `{}`: {error}", path.display()));
                code = FAULTED;
            }
        };
        if let (Some(path), Some(rows)) = (out, self.rows) {
            match rows.finish() {
                Ok(dropped) if dropped > 0 => shell
                    .warning(format_args!("`{}` lacks {dropped} rows, because the disk was too slow", path.display())),
                result => report(path, result.map(|_| String::new())),
            }
        }
        if let (Some(wanted), Some(points)) = (points, self.points) {
            report(&wanted.path, points.finish().map(|count| format!(": {count} points")));
        }
        if let (Some(path), Some(still)) = (svg, self.still) {
            report(path, still.finish(engine).map(|()| String::new()));
        }
        code
    }
}

fn recorder(path: &Path, engine: &Engine, may_wait: bool) -> Result<Recorder, String> {
    let format = RecordFormat::of(path).ok_or_else(|| {
        format!("`{}` does not end in .csv or .ndjson: write for example `--out run.csv`", path.display())
    })?;
    refuse_other(path, &RecordFormat::FILE_STARTS, "a recording of a run")?;
    Recorder::create(path, format, engine, may_wait).map_err(|error| cannot_create(path, error))
}

fn points(path: &Path, chosen: &PointPorts, engine: &Engine) -> Result<PointRecorder, String> {
    refuse_other(path, &[PointRecorder::FILE_START], "a file of points")?;
    PointRecorder::create(path, chosen, engine).map_err(|error| cannot_create(path, error))
}

fn still(path: &Path, title: &str, engine: &Engine) -> Result<Still, String> {
    if path.extension().is_none_or(|extension| extension != "svg") {
        return Err(format!("`{}` does not end in .svg: write for example `--svg run.svg`", path.display()));
    }
    refuse_other(path, &[Svg::START], "an SVG picture")?;
    Still::create(path, title, engine)
}

fn cannot_create(path: &Path, error: impl Display) -> String {
    format!("cannot create `{}`: {error}", path.display())
}

/// Refuses to overwrite a file that does not begin like the output of a run, such as a recording that is being played.
fn refuse_other(path: &Path, starts: &[&str], what: &str) -> Result<(), String> {
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    if read.is_ok() && !start.is_empty() && !starts.iter().any(|known| start.starts_with(known.as_bytes())) {
        return Err(format!(
            "`{}` exists and is not {what}, so it is not overwritten: write to another file",
            path.display()
        ));
    }
    Ok(())
}
