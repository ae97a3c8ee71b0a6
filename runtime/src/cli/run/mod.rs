//! `run`: runs a graph, prints a summary and writes recordings.

mod commissioning;
mod events;
mod files;
mod held;
mod lateness;
pub(super) mod log;
mod outside;
mod ports;
mod progress;
mod reload;
mod saved;
mod slow;
mod status;
mod stepping;
pub(super) mod summary;
pub(super) mod target;
mod time;
#[cfg(feature = "mcap")]
mod whole;

use std::path::PathBuf;
use std::sync::Arc;

use files::OutputFiles;
use log::NodeLog;
use outside::{Outside, changes};
use progress::Progress;
use reload::{Exchange, Reload};
use stepping::Stepping;
use summary::Summary;

use super::shell::command::GraphArgs;
use super::shell::panics::without_panic_messages;
use super::shell::patience::Patience;
use super::shell::{FAULTED, INTERRUPTED, Shell, unknown};
use super::text::number::{milliseconds, seconds};
use super::text::prose::PageStyle;
use crate::engine::{self, End, Engine, Interrupt, Outcome, RunOptions};
use crate::fault::Fault;
use crate::graph::{Compiled, Request, WORDS};
use crate::record::PointsRequest;
use crate::source::{Code, quoted};

pub use commissioning::{Commissioning, Proof};
pub use time::duration;

/// Run a graph and print a summary
#[derive(clap::Parser)]
#[command(
    name = "run",
    after_help = "Examples:
  tactflow run graphs/finger_press.toml
  tactflow run graphs/finger_press.toml --for 5s --out press.csv
  tactflow run graphs/hybrid.toml --svg hybrid.svg
  tactflow run graphs/explore.toml --points surface.ply
  tactflow run graphs/hybrid.toml --set nodes.pid.gains.x.kp=2 --set devices.bench.rate_hz=500
  tactflow run graphs/hybrid.toml --send 0.8s:stop --send 1.2s:resume
  tactflow run graphs/hybrid.toml --change 2s:pid.gains.y.kp=2

Words: `stop` ramps every command to zero and holds it there, and `resume` releases it.
A mode of the graph can wait for any other word with `on = \"word\"`."
)]
pub(crate) struct RunArgs {
    /// Graph file
    graph: PathBuf,
    #[command(flatten)]
    graph_args: GraphArgs,
    #[command(flatten)]
    options: JobOptions,
    /// Print all ports and the time of each node instead of what the graph shows
    #[arg(long)]
    ports: bool,
    /// Print neither progress nor summary, only warnings and errors
    #[arg(short, long, conflicts_with = "ports")]
    quiet: bool,
    /// Use this fraction of the limits of speed and acceleration, such as 0.1; the default is 0.1 on a bench that moves
    /// a real arm and has not passed `doctor --move`
    #[arg(long, value_name = "FRACTION", value_parser = slow::fraction)]
    slow: Option<f64>,
}

pub(crate) fn run(args: RunArgs, shell: &Shell) -> u8 {
    let title = args.graph.display().to_string();
    let print = match (args.ports, args.quiet) {
        (true, _) => Print::Ports,
        (_, true) => Print::Nothing,
        _ => Print::Page,
    };
    let request = Request { slow: args.slow, ..args.graph_args.request(args.graph) };
    Job { request, title, options: args.options, print }.run(shell)
}

/// The length, the words and the files of a run.
#[derive(clap::Args, Clone, Default)]
pub struct JobOptions {
    /// Stop when the clock of the graph reaches this time: 20s, 500ms, 2min
    #[arg(long = "for", value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    pub duration: Option<f64>,
    /// Run in real time; without it, virtual time runs as fast as possible
    #[arg(long)]
    pub realtime: bool,
    /// Send an operator word at a time of the graph's clock, for example 2s:resume; may be repeated
    #[arg(long, value_name = "TIME:WORD", value_parser = time::word)]
    pub send: Vec<(f64, String)>,
    /// Change a parameter that the graph lists in [live] at a time of the graph's clock, for example
    /// 2s:pid.gains.x.kp=3; may be repeated
    #[arg(long, value_name = "TIME:PARAM=VALUE", value_parser = time::change)]
    pub change: Vec<(f64, String, f64)>,
    /// Read words from standard input during the run, one per line; requires real time
    #[arg(long)]
    pub listen: bool,
    /// Pause after each tick, or each TIME, and show what the run does; it goes on at a line on standard input. In virtual
    /// time only
    #[arg(long, value_name = "TIME", num_args = 0..=1, require_equals = true, value_parser = duration)]
    pub step: Option<Option<f64>>,
    /// Run again from the beginning when a file of the graph is saved; in real time only while the run is halted, at rest
    /// and untouched
    #[arg(long, conflicts_with = "step")]
    pub watch: bool,
    /// Open no socket, so that `ps`, `get`, `set`, `send` and `watch` do not reach the run; in virtual time there is none
    #[cfg(unix)]
    #[arg(long)]
    pub no_socket: bool,
    /// Record all ports in a .csv or .ndjson file: one row per tick, one column per number; `-` is standard output
    #[arg(short, long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Record the whole run in a .mcap file: all inputs, with which `replay` repeats it, and all ports
    #[cfg(feature = "mcap")]
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Write the points of a pose to a .ply file: FILE for the reported pose, POSE=FILE, or POSE,PORT=FILE with more
    /// columns
    #[arg(long, value_name = "FILE")]
    pub points: Option<PointsRequest>,
    /// Draw the strongest image and the curves that the graph shows to an .svg file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Lines that `--out` states about the run, beside the version, the graph and the modes
    #[arg(skip)]
    pub about: Vec<String>,
    /// Whether the file of `--out` is not mentioned, because it is an intermediate result
    #[arg(skip)]
    pub hides_out: bool,
}

impl JobOptions {
    /// Checks the options that hold only in real time, or only in virtual time.
    fn check_time(&self, is_real: bool) -> Result<(), String> {
        if self.listen && !is_real {
            return Err("`--listen` requires real time: add `--realtime`, or send words with `--send 2s:resume`".into());
        }
        if self.step.is_some() && is_real {
            let why = "a run in real time cannot pause; `stop` brings an arm to rest";
            return Err(format!("`--step` requires virtual time: {why}"));
        }
        Ok(())
    }

    /// Whether a graph runs in real time.
    fn is_real(&self, plan: &Compiled) -> bool {
        self.realtime || plan.is_live()
    }

    /// Returns the options of the engine.
    fn of_run(&self) -> RunOptions {
        let Self { duration, realtime, send, listen, .. } = self;
        let (duration, is_realtime, sends, listens) = (*duration, *realtime, send.clone(), *listen);
        RunOptions { duration, is_realtime, sends, listens, ..RunOptions::default() }
    }
}

/// What a run prints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Print {
    /// The ports that the graph shows.
    Page,
    /// All ports and all nodes.
    Ports,
    /// Only warnings and errors.
    Nothing,
}

/// A run of a graph from the command line.
pub struct Job {
    /// The graph.
    pub request: Request,
    /// The title in the output.
    pub title: String,
    /// Its length, its words and its files.
    pub options: JobOptions,
    /// What is printed.
    pub print: Print,
}

impl Job {
    /// Runs the graph, prints the summary and returns the exit code.
    #[must_use]
    pub fn run(&self, shell: &Shell) -> u8 {
        if let Err(message) = self.options.reserve_output(shell) {
            return shell.refuse(message);
        }
        if self.options.watch {
            return self.watch(shell);
        }
        match slow::compile(&self.request, shell, &mut |_| {}) {
            Ok((plan, request)) => self.run_plan(plan, &request, shell, None),
            Err(code) => Ok(code),
        }
        .unwrap_or_else(|message| shell.refuse(message))
    }

    /// Runs a plan and returns the exit code.
    ///
    /// # Errors
    /// If the arguments do not fit the graph, before the run starts.
    fn run_plan(
        &self,
        plan: Compiled,
        request: &Request,
        shell: &Shell,
        reload: Option<&Reload>,
    ) -> Result<u8, String> {
        plan.warnings().iter().for_each(|report| shell.show(report));
        let interrupt = Arc::new(Interrupt::catch().map_err(|error| format!("cannot run: {error}"))?);
        let is_real = self.options.is_real(&plan);
        self.options.check_time(is_real)?;
        let chosen = self.options.points.as_ref().map(|wanted| wanted.resolve(&plan)).transpose()?;
        let mut warnings = plan.warnings().into_iter().flat_map(|report| report.diagnostics);
        let start = warnings.find(|warning| warning.code == Code::StartOutside).map(|warning| warning.message);
        let silences = plan.silences().to_vec();
        let facts = self.socket_facts(&plan, is_real);
        let mut engine = Engine::new(plan);
        self.check_words(&engine)?;
        let changes = changes(self, &mut engine, request, facts.is_some(), shell)?;
        let run = (request, is_real);
        let mut files = match OutputFiles::create(self, chosen.as_ref(), &mut engine, run, &interrupt, shell) {
            Err(message) if interrupt.is_requested() => {
                shell.error(message);
                return Ok(INTERRUPTED);
            }
            files => files?,
        };
        // In virtual time nothing moves, so nothing needs to be lost. The shell keeps the signals until the process ends.
        let patience = if is_real { Patience::Limited } else { Patience::Interruptible };
        let patience = patience(Arc::clone(&interrupt));
        shell.set_patience(&patience);
        self.announce(shell, &engine, &silences);
        let mut summary = Summary::new(&engine, self.print == Print::Ports, start);
        let mut log = NodeLog::new(&engine);
        let end = self.options.duration.or_else(|| engine.end().map(seconds));
        let terminal = Some(shell.err()).filter(|_| self.print != Print::Nothing);
        let mut progress = Progress::new(end, terminal, shell.has_colour_on_stderr());
        let mut options = self.options.of_run();
        options.cancel = reload.map(|reload| Arc::clone(&reload.end));
        let mut exchange = reload.map(Exchange::new);
        let mut stepping = Stepping::of(self.options.step, &mut options, &interrupt)?;
        let Outside { mut changes, mut socket } = Outside::open(changes, facts, &engine, &mut options, shell);
        let outcome = without_panic_messages(|| {
            let mut observe = |engine: &Engine| {
                summary.add(engine);
                if log.is_due(engine) {
                    log.write(engine);
                }
                files.add(engine, &patience);
                socket.iter_mut().for_each(|socket| socket.publish(engine));
                progress.show(seconds(engine.now()), engine.ticks(), |style| summary.live(engine, style));
                exchange.iter_mut().for_each(|exchange| exchange.after(engine, shell));
                if let Some(stepping) = &mut stepping {
                    let show = |words: &str| shell.say(&paused(engine, &summary, shell.has_colour(), words));
                    stepping.after(seconds(engine.now()), show);
                }
            };
            match &mut changes {
                Some(changes) => engine::run_changing(&mut engine, &options, changes, &mut observe),
                None => engine::run(&mut engine, &options, &mut observe),
            }
        });
        if let Some(socket) = socket {
            socket.close(&outcome);
        }
        shell.set_patience(&patience.after_run());
        files.end(&engine, &outcome);
        progress.clear();
        if let Ok(outcome) = &outcome {
            let style = PageStyle::new(shell.has_colour());
            self.say(shell, &format!("\n{}", summary.render(&engine, outcome, style).trim_end()));
            self.say(shell, &ending(outcome, reload.is_some_and(Reload::has_ended)));
        }
        let unfinished = changes.map_or_else(Vec::new, |changes| changes.unfinished(&engine));
        let code = self.report_end(shell, &engine, outcome);
        unfinished.iter().for_each(|line| shell.warning(line));
        Ok(code.max(files.finish(shell, &engine)))
    }

    /// Prints what is about to run, and what its devices do without commands.
    fn announce(&self, shell: &Shell, engine: &Engine, silences: &[String]) {
        if self.print != Print::Nothing {
            shell.print_text();
        }
        let period = milliseconds(seconds(engine.period()));
        self.say(shell, &format!("{}: {} nodes, one tick every {period}", self.title, engine.order().count()));
        silences.iter().for_each(|line| self.say(shell, line));
        shell.begin_log();
    }

    /// Reports words that were not sent and the fault that ended the run; returns the exit code.
    fn report_end(&self, shell: &Shell, engine: &Engine, outcome: std::io::Result<Outcome>) -> u8 {
        let outcome = match outcome {
            Ok(outcome) => outcome,
            Err(error) => {
                shell.error(format_args!("cannot run: {error}"));
                return FAULTED;
            }
        };
        for (at, word) in self.options.send.iter().filter(|(at, _)| *at > seconds(outcome.time)) {
            shell.warning(format_args!("`{word}` was not sent: the run ended before {at} s"));
        }
        for (at, name, _) in self.options.change.iter().filter(|(at, ..)| *at > seconds(outcome.time)) {
            shell.warning(format_args!("`{name}` was not changed: the run ended before {at} s"));
        }
        let failed: Vec<(&str, &Fault)> = engine.failures().collect();
        for (task, fault) in &failed {
            shell.error(format_args!("task `{task}` has failed: {fault}; its commands went to zero"));
        }
        let is_reported = |fault: &Fault| failed.iter().any(|(_, reported)| *reported == fault);
        let End::Fault(fault) = &outcome.end else { return if failed.is_empty() { 0 } else { FAULTED } };
        if is_reported(fault) {
            return FAULTED;
        }
        shell.error(format_args!("{fault}; every command went to zero{}", endless_stop(engine, fault)));
        FAULTED
    }

    /// Prints a line unless the run is quiet.
    fn say(&self, shell: &Shell, text: &str) {
        if self.print != Print::Nothing {
            shell.say(text);
        }
    }

    /// Checks that the graph or the runtime knows every word that is sent.
    fn check_words(&self, engine: &Engine) -> Result<(), String> {
        let is_own = |word: &str| WORDS.iter().any(|own| word.eq_ignore_ascii_case(own));
        let words = engine.words();
        let is_unknown = |word: &str| !is_own(word) && words.iter().all(|known| known != word);
        let Some((_, word)) = self.options.send.iter().find(|(_, word)| is_unknown(word)) else { return Ok(()) };
        let accepted = format!("this graph accepts {}", quoted(&words));
        Err(unknown("word", word, words.iter().map(String::as_str), &accepted))
    }
}

/// Explains a fault that is a stop without any source of the word `resume`.
fn endless_stop(engine: &Engine, fault: &Fault) -> &'static str {
    let is_the_stop = engine.halts().last().is_some_and(|halt| halt.fault == *fault);
    if engine.is_stopped() && is_the_stop {
        "; the run ended because nothing can send `resume`: add `--send 2s:resume`, or add `--realtime --listen` and type it"
    } else {
        ""
    }
}

/// Writes what a paused run does, and what may be typed.
fn paused(engine: &Engine, summary: &Summary, has_colour: bool, words: &str) -> String {
    let state = summary.live(engine, PageStyle::new(has_colour)).join("\n");
    let line = format!("{:.3} s, tick {}: {words}", seconds(engine.now()), engine.ticks());
    format!("{}\n{}", state.trim_end(), line.trim_end_matches([':', ' ']))
}

/// Describes how a run ended, and its speed.
fn ending(outcome: &Outcome, is_reloaded: bool) -> String {
    let interrupted = outcome.signal.map(|signal| format!("interrupted by {signal}"));
    let reason = match outcome.end {
        End::Finished => "a device has no more samples",
        End::Done => "a `done` condition ended the run",
        End::Duration => "the time limit ended the run",
        End::Interrupted if is_reloaded && interrupted.is_none() => "ended for the saved graph",
        End::Interrupted => interrupted.as_deref().unwrap_or("interrupted"),
        End::Fault(_) => "a fault",
    };
    let (time, wall) = (seconds(outcome.time), outcome.wall.as_secs_f64());
    let speed = time / wall.max(1e-9);
    format!("{reason} after {time:.3} s and {} ticks; the run took {wall:.3} s, {speed:.0}x real time", outcome.ticks)
}
