//! The files that a run writes: `--out`, `--points` and `--svg`.

use std::io;
use std::path::Path;

use super::target::{clear, is_special, is_stdout, open};
#[cfg(feature = "mcap")]
use super::whole::{WholeRun, check_name};
use super::{Job, JobOptions};
use crate::cli::shell::patience::Patience;
use crate::cli::shell::{FAULTED, Shell};
use crate::cli::still::Still;
use crate::cli::text::number::count_of;
use crate::cli::text::svg::Svg;
use crate::engine::{Engine, Interrupt, Outcome};
use crate::graph::Request;
use crate::record::{OutputFile, PointPorts, PointRecorder, PointsRequest, RecordFormat, Recorded, Recorder};
#[cfg(feature = "mcap")]
use crate::recording::RunRecorder;

/// The open files of a run.
pub(crate) struct OutputFiles<'j> {
    job: &'j Job,
    rows: Option<Recorder>,
    /// Whether the end of the recording by an error was reported.
    has_reported_end: bool,
    points: Option<PointRecorder>,
    still: Option<(Still, OutputFile)>,
    #[cfg(feature = "mcap")]
    whole: Option<WholeRun>,
}

impl JobOptions {
    /// Reserves standard output for a file of the run, if one of them is `-`. All texts go to standard error then.
    ///
    /// # Errors
    /// If several files are `-`, or if that of `--points` is no .ply file, pipe or device.
    pub fn reserve_output(&self, shell: &Shell) -> Result<(), String> {
        let wanted = self.points.as_ref().filter(|points| !is_special(&points.path));
        wanted.map_or(Ok(()), PointsRequest::check_extension)?;
        let points = self.points.as_ref().map(|points| points.path.as_path());
        let files = [self.out.as_deref(), points, self.svg.as_deref(), self.whole()];
        match files.into_iter().flatten().filter(|path| is_stdout(path)).count() {
            0 => Ok(()),
            1 => {
                shell.take_output();
                Ok(())
            }
            _ => Err("only one of `--out`, `--record`, `--points` and `--svg` can be `-`".into()),
        }
    }

    /// Returns the file of the whole run.
    #[cfg(feature = "mcap")]
    fn whole(&self) -> Option<&Path> {
        self.record.as_deref()
    }

    #[cfg(not(feature = "mcap"))]
    const fn whole(&self) -> Option<&Path> {
        None
    }
}

impl<'j> OutputFiles<'j> {
    /// Creates the files before the run starts, and waits for the readers of pipes. All files are opened before the first
    /// one loses its old content, so a run that is refused keeps them all.
    ///
    /// # Errors
    /// If one of them cannot be created, or if a signal ends the wait.
    pub(crate) fn create(
        job: &'j Job,
        chosen: Option<&PointPorts>,
        engine: &mut Engine,
        (request, is_real): (&Request, bool),
        interrupt: &Interrupt,
        shell: &Shell,
    ) -> Result<Self, String> {
        let JobOptions { out, points, svg, .. } = &job.options;
        let format = out.as_deref().map(format_of).transpose()?;
        let still = svg.as_deref().map(|path| still(path, &job.title, engine)).transpose()?;
        let open = |path: Option<&'j Path>, starts: &[&[u8]], what| {
            let opened = path.map(|path| Ok::<_, String>((path, open(path, starts, what, interrupt, shell)?)));
            opened.transpose()
        };
        let points = points.as_ref().map(|points| points.path.as_path());
        let rows = open(out.as_deref(), &RecordFormat::FILE_STARTS.map(str::as_bytes), "a recording of a run")?;
        let points = open(points, &[PointRecorder::FILE_START.as_bytes()], "a file of points")?;
        let svg = open(svg.as_deref(), &[Svg::START.as_bytes()], "an SVG picture")?;
        #[cfg(feature = "mcap")]
        let whole = {
            job.options.record.as_deref().map_or(Ok(()), check_name)?;
            open(job.options.record.as_deref(), &[RunRecorder::FILE_START], "a recording of a whole run")?
        };
        #[cfg(not(feature = "mcap"))]
        let whole = None;
        [&rows, &points, &svg, &whole].into_iter().flatten().try_for_each(|(path, file)| clear(path, file))?;
        #[cfg(feature = "mcap")]
        let about = crate::recording::about_run(engine, request, is_real);
        #[cfg(not(feature = "mcap"))]
        let about = format!("graph {}", request.graph.display());
        let about: Vec<String> = [about].into_iter().chain(job.options.about.iter().cloned()).collect();
        let start = |((_, file), format): ((_, OutputFile), RecordFormat)| {
            Recorder::start(file, format.rows(is_real), engine, &about)
                .map_err(|error| format!("cannot record: {error}"))
        };
        let rows = rows.zip(format).map(start).transpose()?;
        let points = points.zip(chosen).map(|((_, file), chosen)| PointRecorder::new(file, chosen, engine));
        let still = still.zip(svg).map(|(still, (_, file))| (still, file));
        #[cfg(feature = "mcap")]
        let whole = whole.map(|file| WholeRun::start(file, engine, (request, is_real))).transpose()?;
        Ok(Self {
            job,
            rows,
            has_reported_end: false,
            points,
            still,
            #[cfg(feature = "mcap")]
            whole,
        })
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine, patience: &Patience) {
        if let Some(rows) = &mut self.rows {
            rows.record(engine, || patience.may_wait());
            if rows.has_ended() && !self.has_reported_end {
                self.has_reported_end = true;
                let path = self.job.options.out.as_deref().unwrap_or(Path::new("-"));
                if !is_stdout(path) {
                    let count = count_of(rows.rows() as usize, "row");
                    tracing::warn!("the recording `{}` ends after {count}; the run goes on", path.display());
                }
            }
        }
        if let Some(points) = &mut self.points {
            points.record(engine);
        }
        if let Some((still, _)) = &mut self.still {
            still.add(engine);
        }
        #[cfg(feature = "mcap")]
        if let Some(whole) = &mut self.whole {
            whole.add(engine, patience);
        }
    }

    /// Notes how the run has ended.
    #[cfg_attr(
        not(feature = "mcap"),
        expect(clippy::unused_self, reason = "only a recording of the whole run needs it")
    )]
    pub(crate) fn end(&mut self, engine: &Engine, outcome: &io::Result<Outcome>) {
        #[cfg(feature = "mcap")]
        if let (Some(whole), Ok(outcome)) = (&mut self.whole, outcome) {
            whole.end(engine, &outcome.end);
        }
        #[cfg(not(feature = "mcap"))]
        let _ = (engine, outcome);
    }

    /// Completes the files and reports each; returns the exit code.
    pub(crate) fn finish(self, shell: &Shell, engine: &Engine) -> u8 {
        let (job, mut code) = (self.job, 0);
        let JobOptions { out, points, svg, .. } = &job.options;
        let patience = shell.patience();
        let wait = || {
            let mut waiting = patience.begin();
            move |progress| waiting.goes_on(progress)
        };
        #[cfg(feature = "mcap")]
        if let Some(whole) = self.whole {
            code = code.max(whole.finish(job, shell, wait()));
        }
        if let (Some(path), Some(rows)) = (out, self.rows) {
            code = code.max(report_rows(job, shell, path, &rows.finish(wait())));
        }
        let mut report = |path: &Path, result: io::Result<String>| match result {
            Ok(details) => say_wrote(job, shell, path, &details),
            Err(error) if is_stdout(path) && error.kind() == io::ErrorKind::BrokenPipe => {}
            Err(error) => {
                shell.error(format_args!("cannot write `{}`: {error}", path.display()));
                code = FAULTED;
            }
        };
        if let (Some(wanted), Some(points)) = (points, self.points) {
            report(&wanted.path, points.finish(wait()).map(|count| format!(": {count} points")));
        }
        if let (Some(path), Some((still, file))) = (svg, self.still) {
            report(path, still.finish(engine, file, wait()).map(|()| String::new()));
        }
        code
    }
}

/// Reports what became of the recording; returns the exit code.
fn report_rows(job: &Job, shell: &Shell, path: &Path, recorded: &Recorded) -> u8 {
    let Recorded { rows, lost, error } = recorded;
    let name = path.display();
    match error {
        None if *lost > 0 => {
            let count = count_of(*lost as usize, "row");
            shell.error(format_args!("`{name}` lacks {count}, because it was written too slowly"));
            FAULTED
        }
        None => {
            if !job.options.hides_out {
                say_wrote(job, shell, path, "");
            }
            0
        }
        // The reader closed the pipe, as `head` does, which is no error.
        Some(_) if is_stdout(path) && recorded.is_closed_by_reader() => 0,
        Some(error) => {
            let (count, all) = (count_of(*rows as usize, "row"), rows + lost);
            shell.error(format_args!("cannot write `{name}`: {error}: it has the first {count} of {all}"));
            FAULTED
        }
    }
}

fn say_wrote(job: &Job, shell: &Shell, path: &Path, details: &str) {
    if !is_stdout(path) {
        job.say(shell, &format!("wrote {}{details}", path.display()));
    }
}

fn format_of(path: &Path) -> Result<RecordFormat, String> {
    let format = RecordFormat::of(path).or_else(|| is_special(path).then_some(RecordFormat::Csv));
    format.ok_or_else(|| {
        format!("`{}` does not end in .csv or .ndjson: write for example `--out run.csv`", path.display())
    })
}

fn still(path: &Path, title: &str, engine: &Engine) -> Result<Still, String> {
    if !is_special(path) && path.extension().is_none_or(|extension| extension != "svg") {
        return Err(format!("`{}` does not end in .svg: write for example `--svg run.svg`", path.display()));
    }
    Still::new(title, engine)
}
