//! `run`: a graph runs, and what came out is printed.

use std::io;
use std::path::{Path, PathBuf};

use super::check::milliseconds;
use super::log::Log;
use super::progress::Progress;
use super::prose::Look;
use super::summary::Summary;
use super::{FAULTED, NOT_LOADED, OnArgs, Shell};
use crate::engine::{self, End, Engine, Outcome, RunOptions};
use crate::fault::Fault;
use crate::graph::{Compiled, Request, compile};
use crate::record::{Chosen, Format, Points, Recorder, Wanted};

/// Run a graph and print what came out
#[derive(clap::Parser)]
#[command(
    name = "run",
    after_help = "Examples:
  tactflow run graphs/finger_press.toml
  tactflow run graphs/finger_press.toml --for 5s --out press.csv
  tactflow run graphs/explore.toml --points surface.ply
  tactflow run graphs/hybrid.toml --set nodes.pid.gains.x.kp=3 --set devices.pad.rate_hz=500
  tactflow run graphs/hybrid.toml --send 0.8s:stop --send 1.2s:resume

Words: `stop` brings every command to zero, `resume` lets them go on; what else a graph
waits for is in its modes, as `on = \"word\"`."
)]
pub(super) struct Run {
    /// The graph file
    graph: PathBuf,
    #[command(flatten)]
    on: OnArgs,
    /// Run at most this long in the graph's time: 20s, 500ms, 2min
    #[arg(long = "for", value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    duration: Option<f64>,
    /// Pace the run by the wall clock; otherwise virtual time runs as fast as it can
    #[arg(long)]
    realtime: bool,
    /// Send a word at a time of the graph, as 2s:resume; may be given several times
    #[arg(long, value_name = "TIME:WORD", value_parser = word)]
    send: Vec<(f64, String)>,
    /// Take words from the standard input while it runs, one a line; needs a real clock
    #[arg(long)]
    listen: bool,
    /// Write a row a tick and a column a scalar, as .csv or .ndjson
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the points where a pose has been as .ply: the pose that the graph reports, or [POSE[,PORT]…=]FILE
    #[arg(long, value_name = "FILE")]
    points: Option<Wanted>,
    /// Print a line for every port and the time of every node, instead of what the graph shows
    #[arg(long)]
    ports: bool,
    /// Print neither how far it is nor what came out; only what goes wrong
    #[arg(short, long, conflicts_with = "ports")]
    quiet: bool,
}

pub(super) fn run(args: Run, shell: &Shell) -> u8 {
    let title = args.graph.display().to_string();
    let Run { graph, on, duration, realtime, send, listen, out, points, ports, quiet } = args;
    let print = match (ports, quiet) {
        (true, _) => Print::Ports,
        (_, true) => Print::Nothing,
        _ => Print::Page,
    };
    Job { request: on.request(graph), title, duration, realtime, send, listen, out, points, print }.run(shell)
}

/// What a run prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Print {
    /// What the graph shows.
    Page,
    /// A line for every port, and one for every node.
    Ports,
    /// Nothing but what goes wrong.
    Nothing,
}

/// A run of a graph from the command line.
pub struct Job {
    /// What runs.
    pub request: Request,
    /// What to call it.
    pub title: String,
    /// Run at most this long in the graph's time [s].
    pub duration: Option<f64>,
    /// Whether it is paced by the wall clock.
    pub realtime: bool,
    /// Words that are sent: when, in the graph's time [s], and which.
    pub send: Vec<(f64, String)>,
    /// Whether words come in over the standard input.
    pub listen: bool,
    /// Where each tick is recorded, as .csv or .ndjson.
    pub out: Option<PathBuf>,
    /// Which points are written, and where, as .ply.
    pub points: Option<Wanted>,
    /// What is printed.
    pub print: Print,
}

impl Job {
    /// Runs it and prints what came out; gives the exit code.
    #[must_use]
    pub fn run(&self, shell: &Shell) -> u8 {
        match compile(shell.catalogue(), &self.request) {
            Ok(plan) => self.go(plan, shell),
            Err(report) => shell.complain(&report),
        }
    }

    fn go(&self, plan: Compiled, shell: &Shell) -> u8 {
        plan.warnings().iter().for_each(|report| shell.show(report));
        let is_real = self.realtime || plan.is_live();
        if self.listen && !is_real {
            shell.error("`--listen` needs a real clock: add `--realtime`, or send words with `--send 2s:resume`");
            return NOT_LOADED;
        }
        let chosen = match self.points.as_ref().map(|wanted| wanted.choose(&plan)).transpose() {
            Ok(chosen) => chosen,
            Err(message) => {
                shell.error(message);
                return NOT_LOADED;
            }
        };
        let mut engine = Engine::new(plan);
        if let Some(why) = self.unheard(&engine) {
            shell.error(why);
            return NOT_LOADED;
        }
        let mut files = match self.files(chosen.as_ref(), &engine, !is_real) {
            Ok(files) => files,
            Err(message) => {
                shell.error(message);
                return NOT_LOADED;
            }
        };
        self.say(shell, &format!("{}: {} nodes, a tick each {}", self.title, engine.order().count(), period(&engine)));
        let mut summary = Summary::new(&engine, self.print == Print::Ports);
        let mut log = Log::new(&engine);
        let (end, is_quiet) = (self.duration.or_else(|| engine.end().map(seconds)), self.print == Print::Nothing);
        let mut progress = Progress::new(end, is_quiet, shell.has_colour_on_stderr());
        let (sends, listens) = (self.send.clone(), self.listen);
        let options = RunOptions { duration: self.duration, is_realtime: self.realtime, sends, listens };
        let outcome = quietly(|| {
            engine::run(&mut engine, &options, &mut |engine| {
                summary.add(engine);
                if log.is_due(engine) {
                    progress.clear();
                    log.write(engine);
                }
                files.record(engine);
                progress.show(seconds(engine.now()), engine.ticks(), |page| summary.live(page));
            })
        });
        progress.clear();
        let written = files.finish();
        let outcome = match outcome {
            Ok(outcome) => outcome,
            Err(error) => {
                shell.error(format_args!("cannot run: {error}"));
                return FAULTED;
            }
        };
        let page = Look::new(shell.has_colour());
        self.say(shell, &format!("\n{}", summary.render(&engine, &outcome, page).trim_end()));
        self.say(shell, &ending(&outcome));
        self.close(shell, &engine, &outcome, written)
    }

    /// What went wrong or was not done, and the exit code.
    fn close(&self, shell: &Shell, engine: &Engine, outcome: &Outcome, written: Written) -> u8 {
        for (at, word) in self.send.iter().filter(|(at, _)| *at > seconds(outcome.time)) {
            shell.warning(format_args!("`{word}` was not sent: the run ended before {at} s"));
        }
        let code = if let End::Fault(fault) = &outcome.end {
            shell.error(format_args!("{fault}; every command went to zero{}", hopeless(engine, fault)));
            FAULTED
        } else {
            0
        };
        code.max(self.report_file(shell, written.rows)).max(self.report_points(shell, written.points))
    }

    /// Prints what is no mistake, where that is wanted.
    fn say(&self, shell: &Shell, text: &str) {
        if self.print != Print::Nothing {
            shell.say(text);
        }
    }

    /// Creates what the run shall leave behind.
    fn files(&self, chosen: Option<&Chosen>, engine: &Engine, may_wait: bool) -> Result<Files, String> {
        let rows = self.out.as_deref().map(|path| recorder(path, engine, may_wait)).transpose()?;
        let points = self.points.as_ref().zip(chosen).map(|(wanted, chosen)| points(&wanted.path, chosen, engine));
        Ok(Files { rows, points: points.transpose()? })
    }

    fn report_points(&self, shell: &Shell, written: io::Result<usize>) -> u8 {
        let Some(wanted) = &self.points else { return 0 };
        match written {
            Ok(count) => {
                self.say(shell, &format!("wrote {}: {count} points", wanted.path.display()));
                0
            }
            Err(error) => {
                shell.error(format_args!("cannot write `{}`: {error}", wanted.path.display()));
                FAULTED
            }
        }
    }

    fn report_file(&self, shell: &Shell, written: io::Result<u64>) -> u8 {
        let Some(path) = &self.out else { return 0 };
        match written {
            Ok(0) => {
                self.say(shell, &format!("wrote {}", path.display()));
                0
            }
            Ok(dropped) => {
                shell.warning(format_args!("{} lacks {dropped} rows: the disk was too slow", path.display()));
                0
            }
            Err(error) => {
                shell.error(format_args!("cannot write `{}`: {error}", path.display()));
                FAULTED
            }
        }
    }
}

/// What a run leaves behind while it goes on.
struct Files {
    rows: Option<Recorder>,
    points: Option<Points>,
}

/// How that went: how many rows were dropped, and how many points there are.
struct Written {
    rows: io::Result<u64>,
    points: io::Result<usize>,
}

impl Files {
    fn record(&mut self, engine: &Engine) {
        if let Some(rows) = &mut self.rows {
            rows.record(engine);
        }
        if let Some(points) = &mut self.points {
            points.record(engine);
        }
    }

    fn finish(self) -> Written {
        Written { rows: self.rows.map_or(Ok(0), Recorder::finish), points: self.points.map_or(Ok(0), Points::finish) }
    }
}

/// Whether a word is the runtime's own, in any case.
fn is_own(word: &str) -> bool {
    ["stop", "resume"].iter().any(|own| word.eq_ignore_ascii_case(own))
}

impl Job {
    /// Why a word that shall be sent is one that nothing waits for.
    fn unheard(&self, engine: &Engine) -> Option<String> {
        let is_known = |word: &str| engine.words().any(|known| known == word || is_own(word));
        let (_, word) = self.send.iter().find(|(_, word)| !is_known(word))?;
        let known: std::collections::BTreeSet<&str> = engine.words().collect();
        Some(format!(
            "nothing waits for the word `{word}`: {}",
            crate::source::suggestion(word, known.into_iter(), "words")
        ))
    }
}

fn recorder(path: &Path, engine: &Engine, may_wait: bool) -> Result<Recorder, String> {
    let format = Format::of(path).ok_or_else(|| format!("`{}` is neither .csv nor .ndjson", path.display()))?;
    if is_something_else(path, &Format::STARTS) {
        return Err(format!("`{}` exists and is no record of a run: it is not overwritten", path.display()));
    }
    Recorder::create(path, format, engine, may_wait)
        .map_err(|error| format!("cannot create `{}`: {error}", path.display()))
}

fn points(path: &Path, chosen: &Chosen, engine: &Engine) -> Result<Points, String> {
    if is_something_else(path, &[Points::START]) {
        return Err(format!("`{}` exists and holds no points: it is not overwritten", path.display()));
    }
    Points::create(path, chosen, engine).map_err(|error| format!("cannot create `{}`: {error}", path.display()))
}

/// Whether a file exists that begins otherwise than what a run leaves behind: a recording that is being played, say.
fn is_something_else(path: &Path, starts: &[&str]) -> bool {
    let mut start = Vec::new();
    let read =
        std::fs::File::open(path).and_then(|file| io::Read::read_to_end(&mut io::Read::take(file, 16), &mut start));
    read.is_ok() && !start.is_empty() && !starts.iter().any(|known| start.starts_with(known.as_bytes()))
}

/// A panic of a node or a device is told as a fault, with its name and its tick: not by the standard library as well.
pub(super) fn quietly<T>(work: impl FnOnce() -> T) -> T {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    std::panic::set_hook(hook);
    // Whatever else panics is a mistake of ours, and is told with everything that helps to find it.
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// What else there is to say of a fault that is a stop which nobody could end.
fn hopeless(engine: &Engine, fault: &Fault) -> &'static str {
    let is_the_stop = engine.halts().last().is_some_and(|halt| halt.fault == *fault);
    if engine.is_stopped() && is_the_stop {
        ", and nobody was left to send `resume`: `--send 2s:resume` does, or a line with `--listen`"
    } else {
        ""
    }
}

fn ending(outcome: &Outcome) -> String {
    let why = match outcome.end {
        End::Finished => "a device has no more samples",
        End::Done => "the graph says that it is done",
        End::Duration => "the time is over",
        End::Interrupted => "interrupted",
        End::Fault(_) => "a fault",
    };
    let (time, wall) = (seconds(outcome.time), outcome.wall.as_secs_f64());
    let speed = time / wall.max(1e-9);
    format!("{why} after {time:.3} s and {} ticks; it took {wall:.3} s, {speed:.0}x real time", outcome.ticks)
}

fn period(engine: &Engine) -> String {
    milliseconds(seconds(engine.period()))
}

fn seconds(nanos: i64) -> f64 {
    nanos as f64 * 1e-9
}

/// A time with its unit that is not zero, in seconds: a parser for arguments.
///
/// # Errors
/// What is wrong with it.
pub fn duration(text: &str) -> Result<f64, String> {
    time(text, "greater than 0", |number| number > 0.0)
}

/// A time with its unit, in seconds, whose number is in a range.
fn time(text: &str, range: &str, is_in_range: impl Fn(f64) -> bool) -> Result<f64, String> {
    const UNITS: [(&str, f64); 4] = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("h", 3600.0)];
    let found = UNITS.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let (number, seconds) = found.ok_or("give a time with its unit: 20s, 500ms, 2min, 1h")?;
    match number.trim().parse::<f64>() {
        Ok(number) if is_in_range(number) && number.is_finite() => Ok(number * seconds),
        _ => Err(format!("`{number}` is not a number {range}")),
    }
}

/// A word and when it is sent: `2s:resume`.
fn word(text: &str) -> Result<(f64, String), String> {
    match text.split_once(':') {
        Some((at, word)) if !word.trim().is_empty() => {
            Ok((time(at, "from 0", |number| number >= 0.0)?, word.trim().to_owned()))
        }
        _ => Err("give a time and a word: 2s:resume".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        for (text, seconds) in [("20s", 20.0), ("500ms", 0.5), ("2min", 120.0), ("1.5 h", 5400.0)] {
            assert_eq!(duration(text), Ok(seconds), "{text}");
        }
        for text in ["20", "", "s", "-1s", "0s", "nans", "infs", "3 days"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_word_has_a_time() {
        for (text, at, said) in [("2s:resume", 2.0, "resume"), ("0s: stop ", 0.0, "stop"), ("5ms:a:b", 0.005, "a:b")] {
            assert_eq!(word(text), Ok((at, said.to_owned())), "{text}");
        }
        for text in ["resume", "2s", "2s:", "2s: ", ":stop", "2:stop", "-1s:stop", "nans:stop", "infs:stop"] {
            assert!(word(text).is_err(), "{text}");
        }
    }
}
