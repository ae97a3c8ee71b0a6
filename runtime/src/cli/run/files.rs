//! The files that a run writes: `--out`, `--points` and `--svg`.

use std::fmt::Display;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::cli::shell::{FAULTED, Shell};
use crate::cli::still::Still;
use crate::cli::text::svg::Svg;
use crate::engine::Engine;
use crate::record::{Format, PointPorts, PointRecorder, PointsRequest, Recorder};

/// The files that are asked for.
pub(crate) struct Outputs<'a> {
    pub(crate) out: &'a Option<PathBuf>,
    pub(crate) points: &'a Option<PointsRequest>,
    pub(crate) svg: &'a Option<PathBuf>,
    /// Title of the picture.
    pub(crate) title: &'a str,
}

/// The open files of a run.
pub(crate) struct OutputFiles<'a> {
    outputs: Outputs<'a>,
    rows: Option<Recorder>,
    points: Option<PointRecorder>,
    still: Option<Still>,
}

impl<'a> OutputFiles<'a> {
    /// Creates the files before the run starts. `may_wait` lets the run wait for the disk.
    ///
    /// # Errors
    /// If one of them cannot be created.
    pub(crate) fn create(
        outputs: Outputs<'a>,
        chosen: Option<&PointPorts>,
        engine: &Engine,
        may_wait: bool,
    ) -> Result<Self, String> {
        let rows = outputs.out.as_deref().map(|path| recorder(path, engine, may_wait));
        let points = outputs.points.as_ref().zip(chosen).map(|(wanted, chosen)| points(&wanted.path, chosen, engine));
        let still = outputs.svg.as_deref().map(|path| still(path, outputs.title, engine));
        let (rows, points, still) = (rows.transpose()?, points.transpose()?, still.transpose()?);
        Ok(Self { outputs, rows, points, still })
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
    pub(crate) fn finish(self, shell: &Shell, engine: &Engine, say: impl Fn(&str)) -> u8 {
        let (outputs, mut code) = (self.outputs, 0);
        let mut report = |path: Option<&Path>, result: Result<String, std::io::Error>| {
            let path = path.map(Path::display).map(|path| path.to_string()).unwrap_or_default();
            match result {
                Ok(details) => say(&format!("wrote {path}{details}")),
                Err(error) => {
                    shell.error(format_args!("cannot write `{path}`: {error}"));
                    code = FAULTED;
                }
            }
        };
        if let Some(result) = self.rows.map(Recorder::finish) {
            match (result, outputs.out) {
                (Ok(dropped), Some(path)) if dropped > 0 => {
                    shell.warning(format_args!("{} has {dropped} rows too few: the disk was too slow", path.display()))
                }
                (result, path) => report(path.as_deref(), result.map(|_| String::new())),
            }
        }
        if let Some(result) = self.points.map(PointRecorder::finish) {
            let path = outputs.points.as_ref().map(|wanted| wanted.path.as_path());
            report(path, result.map(|count| format!(": {count} points")));
        }
        if let Some(result) = self.still.map(|still| still.finish(engine)) {
            report(outputs.svg.as_deref(), result.map(|()| String::new()));
        }
        code
    }
}

fn recorder(path: &Path, engine: &Engine, may_wait: bool) -> Result<Recorder, String> {
    let format = Format::of(path).ok_or_else(|| format!("`{}` is neither .csv nor .ndjson", path.display()))?;
    refuse_other(path, &Format::FILE_STARTS, "a recording of a run")?;
    Recorder::create(path, format, engine, may_wait).map_err(|error| cannot_create(path, error))
}

fn points(path: &Path, chosen: &PointPorts, engine: &Engine) -> Result<PointRecorder, String> {
    refuse_other(path, &[PointRecorder::FILE_START], "a file of points")?;
    PointRecorder::create(path, chosen, engine).map_err(|error| cannot_create(path, error))
}

fn still(path: &Path, title: &str, engine: &Engine) -> Result<Still, String> {
    if path.extension().is_none_or(|extension| extension != "svg") {
        return Err(format!("`{}` is not .svg", path.display()));
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
        return Err(format!("`{}` exists and is not {what}: it is not overwritten", path.display()));
    }
    Ok(())
}
