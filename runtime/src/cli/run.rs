//! `run`: a graph runs, and what came out is printed.

use std::io;
use std::path::Path;

use super::check::milliseconds;
use super::log::Log;
use super::progress::Progress;
use super::summary::Summary;
use super::{Colour, FAULTED, NOT_LOADED, RunArgs, complain, say};
use crate::catalogue::Catalogue;
use crate::engine::{self, End, Engine, Outcome, RunOptions};
use crate::graph::plan;
use crate::record::{Format, Recorder};

pub(super) fn run(catalogue: &Catalogue, args: RunArgs, colour: Colour) -> u8 {
    let plan = match plan(catalogue, &args.on.request(args.graph.clone())) {
        Ok(plan) => plan,
        Err(report) => return complain(&report, colour),
    };
    let is_real = args.realtime || plan.is_live();
    let mut engine = Engine::new(plan);
    let mut recorder = match args.out.as_deref().map(|path| recorder(path, &engine, !is_real)).transpose() {
        Ok(recorder) => recorder,
        Err(message) => {
            eprintln!("error: {message}");
            return NOT_LOADED;
        }
    };
    say(&format!("{}: {} nodes, a tick each {}", args.graph.display(), engine.order().count(), period(&engine)));
    let mut summary = Summary::new(&engine);
    let mut log = Log::new(&engine);
    let mut progress = Progress::new(args.duration.or_else(|| engine.end().map(seconds)));
    let options = RunOptions { duration: args.duration, is_realtime: args.realtime };
    let outcome = quietly(|| {
        engine::run(&mut engine, &options, &mut |engine| {
            summary.add(engine);
            if log.is_due(engine) {
                progress.clear();
                log.write(engine);
            }
            if let Some(recorder) = &mut recorder {
                recorder.record(engine);
            }
            progress.show(seconds(engine.now()), engine.ticks());
        })
    });
    progress.clear();
    let written = recorder.map_or(Ok(0), Recorder::finish);
    let outcome = match outcome {
        Ok(outcome) => outcome,
        Err(error) => {
            eprintln!("error: cannot run: {error}");
            return FAULTED;
        }
    };
    say(&format!("\n{}", summary.render(&engine, &outcome)));
    say(&ending(&outcome));
    let code = if let End::Fault(fault) = &outcome.end {
        eprintln!("error: {fault}; every command went to zero");
        FAULTED
    } else {
        0
    };
    code.max(report_file(args.out.as_deref(), written))
}

fn recorder(path: &Path, engine: &Engine, may_wait: bool) -> Result<Recorder, String> {
    let format = Format::of(path).ok_or_else(|| format!("`{}` is neither .csv nor .ndjson", path.display()))?;
    if is_something_else(path) {
        return Err(format!("`{}` exists and is no record of a run: it is not overwritten", path.display()));
    }
    Recorder::create(path, format, engine, may_wait)
        .map_err(|error| format!("cannot create `{}`: {error}", path.display()))
}

/// Whether a file exists that no run has recorded: a recording that is being played, say.
fn is_something_else(path: &Path) -> bool {
    let mut start = String::new();
    let read =
        std::fs::File::open(path).and_then(|file| io::Read::read_to_string(&mut io::Read::take(file, 16), &mut start));
    read.is_ok() && !start.is_empty() && !Format::STARTS.iter().any(|known| start.starts_with(known))
}

fn report_file(path: Option<&Path>, written: io::Result<u64>) -> u8 {
    let Some(path) = path else { return 0 };
    match written {
        Ok(0) => {
            say(&format!("wrote {}", path.display()));
            0
        }
        Ok(dropped) => {
            eprintln!("warning: {} lacks {dropped} rows: the disk was too slow", path.display());
            0
        }
        Err(error) => {
            eprintln!("error: cannot write `{}`: {error}", path.display());
            FAULTED
        }
    }
}

/// A panic of a node or a device is told as a fault, with its name and its tick: not by the standard library as well.
fn quietly<T>(work: impl FnOnce() -> T) -> T {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    std::panic::set_hook(hook);
    // Whatever else panics is a mistake of ours, and is told with everything that helps to find it.
    result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

fn ending(outcome: &Outcome) -> String {
    let why = match outcome.end {
        End::Finished => "a device has no more samples",
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
