//! `replay`: repeats a recorded run without its devices, and compares every recorded port to the last bit.

use std::path::PathBuf;
use std::time::Instant;

use super::{difference_table, first};
use crate::cli::run::duration;
use crate::cli::run::summary::Summary;
use crate::cli::run::target::refuse_other;
use crate::cli::shell::panics::without_panic_messages;
use crate::cli::shell::{FAULTED, NOT_LOADED, Shell};
use crate::cli::text::number::{count_of, seconds};
use crate::cli::text::prose::PageStyle;
use crate::engine::{End, Outcome};
use crate::fault::Fault;
use crate::record::{RecordFormat, Recorder};
use crate::recording::{PortDifference, Replay, ReplayChanges, ReplayedTick, is_own_channel};
use crate::source::quoted;

/// Repeat a recorded run without its devices, and compare every recorded port
#[derive(clap::Parser)]
#[command(
    name = "replay",
    after_help = "Examples:
  tactflow replay run.mcap
  tactflow replay run.mcap --from 12s --for 3s --out part.csv
  tactflow replay run.mcap --set nodes.pid.gains.x.kp=2

The graph and all its files are those in the recording. With --graph or --set, the recorded inputs
reach another graph: the loop is open, because the devices do not answer to its commands.

The exit code is 1 if a port differs although nothing was changed."
)]
pub(super) struct ReplayArgs {
    /// The recording, a .mcap file
    recording: PathBuf,
    /// Run this graph on the recorded inputs; its files are read from the disk
    #[arg(long, value_name = "FILE")]
    graph: Option<PathBuf>,
    /// Use this bench with --graph; its devices are those of the recording with the same names
    #[arg(long, value_name = "FILE", requires = "graph")]
    bench: Option<PathBuf>,
    /// Replace a value of the graph, for example nodes.pid.gains.x.kp=3; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Compute what is before this time of the graph's clock without showing it: 12s, 500ms, 2min
    #[arg(long, value_name = "TIME", value_parser = duration)]
    from: Option<f64>,
    /// Stop after this time, counted from --from
    #[arg(long = "for", value_name = "TIME", value_parser = duration)]
    length: Option<f64>,
    /// Record all ports in a .csv or .ndjson file: one row per tick, one column per number
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print all ports instead of what the graph shows
    #[arg(long)]
    ports: bool,
    /// Print only the result of the comparison
    #[arg(short, long, conflicts_with = "ports")]
    quiet: bool,
}

pub(super) fn replay(args: ReplayArgs, shell: &Shell) -> u8 {
    let changes = ReplayChanges { graph: args.graph.clone(), bench: args.bench.clone(), set: args.set.clone() };
    let replay = match shell.open_replay(&args.recording, &changes) {
        Ok(replay) => replay,
        Err(code) => return code,
    };
    let run = Run { args: &args, replay, is_other: !changes.is_empty(), begin: Instant::now(), faulted: None };
    run.run(shell).unwrap_or_else(|message| {
        shell.error(message);
        NOT_LOADED
    })
}

/// A replay from the command line.
struct Run<'a> {
    args: &'a ReplayArgs,
    replay: Replay,
    /// Whether another graph runs.
    is_other: bool,
    begin: Instant,
    /// The fault that ended the replay.
    faulted: Option<Fault>,
}

impl Run<'_> {
    fn run(mut self, shell: &Shell) -> Result<u8, String> {
        let mut rows = self.rows()?;
        let mut summary = Summary::new(self.replay.engine(), self.args.ports, None);
        let from = self.args.from.unwrap_or(0.0);
        let until = self.args.length.map_or(f64::INFINITY, |length| from + length);
        let mut shown = 0_u64;
        let ran = without_panic_messages(|| {
            while self.replay.next_time().is_some_and(|time| seconds(time) <= until) {
                match self.replay.step()? {
                    ReplayedTick::Over => break,
                    ReplayedTick::Fault(fault) => {
                        self.faulted = Some(*fault);
                        break;
                    }
                    ReplayedTick::Ran(is_same) => {
                        if seconds(self.replay.engine().now()) < from {
                            self.replay.forget();
                            continue;
                        }
                        shown += 1;
                        summary.add(self.replay.engine());
                        rows.iter_mut().for_each(|rows| rows.record(self.replay.engine(), || true));
                        if !is_same && !self.is_other {
                            break;
                        }
                    }
                }
            }
            Ok::<(), String>(())
        });
        if let Err(message) = ran {
            let count = count_of(shown as usize, "tick");
            let (name, missing) = (self.args.recording.display(), self.missing());
            shell.say(&format!("{name}: the first {count} are the same to the last bit{missing}"));
            return Err(message);
        }
        self.say_page(&summary, shell);
        if let (Some(path), Some(rows)) = (&self.args.out, rows) {
            if let Some(error) = rows.finish(|_| true).error {
                return Err(format!("cannot write `{}`: {error}", path.display()));
            }
            shell.say(&format!("wrote {}", path.display()));
        }
        Ok(if self.is_other { self.say_other(shell) } else { self.say_same(shown, shell) })
    }

    fn rows(&self) -> Result<Option<Recorder>, String> {
        let Some(path) = &self.args.out else { return Ok(None) };
        let format = RecordFormat::of(path).ok_or_else(|| {
            format!("`{}` does not end in .csv or .ndjson: write for example `--out part.csv`", path.display())
        })?;
        refuse_other(path, &RecordFormat::FILE_STARTS.map(str::as_bytes), "a recording of a run")?;
        let rows = Recorder::create(path, format.rows(false), self.replay.engine());
        rows.map(Some).map_err(|error| format!("cannot create `{}`: {error}", path.display()))
    }

    /// Prints what `run` prints at its end.
    fn say_page(&self, summary: &Summary, shell: &Shell) {
        if self.args.quiet {
            return;
        }
        let engine = self.replay.engine();
        let end = self.faulted.clone().map_or(End::Finished, |fault| End::Fault(fault.into()));
        let (time, ticks, wall) = (engine.now(), engine.ticks(), self.begin.elapsed());
        let outcome = Outcome { end, signal: None, time, ticks, wall, late: 0 };
        let page = summary.render(engine, &outcome, PageStyle::new(shell.has_colour()));
        if !page.trim().is_empty() {
            shell.say(page.trim_end());
            shell.say("");
        }
    }

    /// Prints whether the replay is the run; returns the exit code.
    fn say_same(&self, shown: u64, shell: &Shell) -> u8 {
        let name = self.args.recording.display();
        let differences = &self.replay.differences().ports;
        if let Some((port, difference)) = differences.iter().min_by_key(|(_, difference)| difference.order) {
            let PortDifference { tick, time, .. } = difference;
            let more = count_of(differences.len() - 1, "other port");
            let time = seconds(*time);
            self.warn_of_version(shell);
            shell.error(format_args!(
                "{name}: `{port}` differs from tick {tick} at {time:.3} s on, and {more} with it: {}",
                first(difference)
            ));
            return FAULTED;
        }
        let recording = self.replay.recording();
        let reason = recording.reason().filter(|_| self.replay.is_over());
        match (&self.faulted, reason) {
            (Some(fault), Some(reason)) if fault.to_string() == reason => {}
            (Some(fault), reason) => {
                let reason = reason.unwrap_or("going on");
                shell.error(format_args!(
                    "{name}: the replay ended with a fault, and the recording with: {reason}: {fault}"
                ));
                return FAULTED;
            }
            (None, _) => {}
        }
        let (ticks, ports) = (count_of(shown as usize, "tick"), count_of(self.replay.ports(), "port"));
        let cut = if self.replay.is_over() && !recording.is_complete() {
            format!("; the recording was cut after {:.3} s", seconds(self.replay.engine().now()))
        } else {
            String::new()
        };
        let missing = self.missing();
        shell.say(&format!("{name}: {ticks}, {ports}: the same to the last bit{missing}{cut}"));
        0
    }

    /// Says how many ticks could not be compared.
    fn missing(&self) -> String {
        match self.replay.uncompared() {
            0 => String::new(),
            count => format!("; the recording lacks the ports of {}", count_of(count as usize, "tick")),
        }
    }

    /// Warns if another version of tactflow has recorded the run.
    fn warn_of_version(&self, shell: &Shell) {
        let (theirs, own) = (&self.replay.recording().about().tactflow, env!("CARGO_PKG_VERSION"));
        if theirs != own {
            shell.warning(format_args!("the run was recorded by tactflow {theirs}, and this is {own}"));
        }
    }

    /// Prints how another graph differs; returns the exit code.
    fn say_other(&self, shell: &Shell) -> u8 {
        shell.say("open loop: the recorded inputs do not answer to the commands of this graph");
        let missing: Vec<&str> = self.replay.missing().collect();
        if !missing.is_empty() {
            shell.say(&format!("only in the recording: {}", quoted(&missing)));
        }
        let all = &self.replay.differences().ports;
        let (ticks, ports) = (count_of(self.replay.ticks() as usize, "tick"), count_of(self.replay.ports(), "port"));
        if all.is_empty() {
            shell.say(&format!("{ticks}, {ports}: the same to the last bit"));
        } else {
            shell.say(difference_table(all.iter()).trim_end());
            let differing = all.keys().filter(|port| !is_own_channel(port)).count();
            shell.say(&format!("{differing} of {ports} differ from the recording in {ticks}"));
        }
        match &self.faulted {
            Some(fault) => {
                shell.error(format_args!("{fault}"));
                FAULTED
            }
            None => 0,
        }
    }
}
