//! The command line, as a library function: a node crate gets the whole tool from a five-line `main`.
//!
//! ```no_run
//! fn main() -> std::process::ExitCode {
//!     tactflow_runtime::cli::main(&tactflow_runtime::catalogue::Catalogue::new())
//! }
//! ```
#![allow(clippy::print_stderr, reason = "this is where the tool speaks")]

mod check;
mod course;
mod log;
mod progress;
mod run;
mod summary;

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand, ValueEnum};
use tracing_subscriber::EnvFilter;

use crate::catalogue::Catalogue;
use crate::diagnostic::Report;
use crate::graph::Request;

/// A run that faulted.
const FAULTED: u8 = 1;
/// A file that does not load, or a command line that is not understood.
const NOT_LOADED: u8 = 2;

/// Tactile servoing from graph files.
#[derive(Parser)]
#[command(name = "tactflow", version, max_term_width = 100)]
#[command(after_help = "Exit codes: 0 all went well; 1 the run ended in a fault; 2 a file does not load.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// When to use colours; `auto` means on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, default_value_t = Colour::Auto, value_name = "WHEN")]
    color: Colour,
    /// Say more; twice: much more (RUST_LOG chooses finer)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Subcommand)]
enum Command {
    /// Run a graph and print what came out
    Run(RunArgs),
    /// Check graphs like a compiler would, without running them
    Check(CheckArgs),
}

#[derive(Args)]
#[command(after_help = "Examples:
  tactflow run graphs/finger_press.toml
  tactflow run graphs/finger_press.toml --for 5s --out press.csv
  tactflow run graphs/hybrid.toml --set nodes.pid.gains.x.kp=3 --set devices.pad.rate_hz=500")]
struct RunArgs {
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
    /// Write a row a tick and a column a scalar, as .csv or .ndjson
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Args)]
struct CheckArgs {
    /// The graph files
    #[arg(required = true)]
    graphs: Vec<PathBuf>,
    #[command(flatten)]
    on: OnArgs,
}

#[derive(Args)]
struct OnArgs {
    /// Bench to run on instead of the graph's own
    #[arg(long, value_name = "FILE")]
    bench: Option<PathBuf>,
    /// Lay a value over those of the graph and its bench, for example nodes.pid.gains.x.kp=3; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl OnArgs {
    fn request(&self, graph: PathBuf) -> Request {
        Request { graph, bench: self.bench.clone(), set: self.set.clone(), ..Request::default() }
    }
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Colour {
    Auto,
    Always,
    Never,
}

impl Colour {
    fn is_on(self, stream: &impl IsTerminal) -> bool {
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Auto => stream.is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()),
        }
    }
}

/// Runs the tool on the process's arguments.
#[must_use]
pub fn main(catalogue: &Catalogue) -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { NOT_LOADED } else { 0 };
            // Nothing is left to say where even that cannot be printed.
            let _ = error.print();
            return code.into();
        }
    };
    log(&cli);
    let code = match cli.command {
        Command::Run(args) => run::run(catalogue, args, cli.color),
        Command::Check(args) => check::check(catalogue, args, cli.color),
    };
    code.into()
}

fn log(cli: &Cli) {
    let level = ["warn", "info", "debug"][usize::from(cli.verbose.min(2))];
    // What the graph asks to see is seen without a switch.
    let level = format!("{level},{}=info", log::TARGET);
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let is_coloured = cli.color.is_on(&std::io::stderr());
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(is_coloured).with_writer(std::io::stderr).init();
}

/// Prints to standard output. A reader that has seen enough, `head` say, is no mistake of ours.
fn say(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

/// Shows what is wrong with a graph.
fn complain(report: &Report, colour: Colour) -> u8 {
    eprint!("{}", report.render(colour.is_on(&std::io::stderr())));
    NOT_LOADED
}

/// A time with its unit, in seconds.
fn duration(text: &str) -> Result<f64, String> {
    const UNITS: [(&str, f64); 4] = [("ms", 1e-3), ("min", 60.0), ("s", 1.0), ("h", 3600.0)];
    let found = UNITS.iter().find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?, seconds)));
    let (number, seconds) = found.ok_or("give a time with its unit: 20s, 500ms, 2min, 1h")?;
    match number.trim().parse::<f64>() {
        Ok(number) if number > 0.0 && number.is_finite() => Ok(number * seconds),
        _ => Err(format!("`{number}` is not a number greater than 0")),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_arguments_are_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn times_have_units() {
        for (text, seconds) in [("20s", 20.0), ("500ms", 0.5), ("2min", 120.0), ("1.5 h", 5400.0)] {
            assert_eq!(duration(text), Ok(seconds), "{text}");
        }
        for text in ["20", "", "s", "-1s", "0s", "nans", "infs", "3 days"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }
}
