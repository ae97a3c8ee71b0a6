//! The command line as a library: a crate with its own nodes gets the whole tool from a `main` of one line.
//!
//! ```no_run
//! use tactflow_runtime::catalogue::Catalogue;
//! use tactflow_runtime::cli::Tool;
//!
//! fn main() -> std::process::ExitCode {
//!     Tool::new(Catalogue::new()).main()
//! }
//! ```
//!
//! Every command is a [`Subcommand`]. A crate adds its own with [`Tool::command`]; [`derived`] makes a command from
//! arguments that clap derives.

mod check;
mod completions;
mod draw;
mod explain;
mod plot;
#[cfg(feature = "mcap")]
mod recorded;
mod reference;
#[cfg(feature = "mcap")]
mod report;
mod run;
#[cfg(unix)]
mod running;
mod shell;
mod show;
mod still;
mod text;
mod verify;
mod view;

use std::io;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser};
use tracing_subscriber::EnvFilter;

use crate::catalogue::Catalogue;
use crate::engine;

use reference::{describe, list};

use shell::stream::OutStream;
use shell::{Colour, standard_error};

/// The parser of arguments, for the commands of other crates.
pub use clap;
pub use reference::pages::reference;
pub use run::{Commissioning, Job, JobOptions, Print, Proof, duration};
#[cfg(unix)]
pub use running::{FoundRun, NotFound, RunArg};
pub use shell::command::{CommandEnd, GraphArgs, OutputFormat, Subcommand, derived};
pub use shell::{FAULTED, INTERRUPTED, NOT_LOADED, Shell};
pub use text::{figure, svg, table::table};

/// Tactile servoing from graph files.
#[derive(Parser)]
#[command(name = "tactflow", version, max_term_width = 100)]
#[command(subcommand_required = true, arg_required_else_help = true)]
#[command(
    after_help = "Exit codes: 0 success; 1 a run ended in a fault, a scenario failed, or output was lost; 2 a file does not load, or the \
                       command line is invalid."
)]
struct Cli {
    /// When to use colours; `auto` uses them on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, default_value_t = Colour::Auto, value_name = "WHEN")]
    color: Colour,
    /// Print more messages; -vv prints the most (RUST_LOG selects by module)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

/// The tool: a catalogue and its commands.
#[must_use]
pub struct Tool {
    catalogue: Catalogue,
    commands: Vec<Subcommand>,
}

impl Tool {
    /// Creates the tool with the commands that work for every catalogue.
    pub fn new(catalogue: Catalogue) -> Self {
        let tool = Self {
            catalogue,
            commands: vec![
                derived(run::run),
                derived(check::check),
                derived(verify::verify),
                derived(list::list),
                derived(describe::describe),
                derived(show::show),
                derived(draw::draw),
                derived(plot::plot),
                derived(completions::completions),
            ],
        };
        #[cfg(unix)]
        let tool = running::commands().into_iter().fold(tool, Self::command);
        #[cfg(feature = "mcap")]
        let tool = recorded::commands().into_iter().fold(tool, Self::command).command(derived(report::report));
        tool
    }

    /// Adds a command.
    ///
    /// # Panics
    /// If a command has that name already.
    pub fn command(mut self, command: Subcommand) -> Self {
        let is_taken = self.commands.iter().any(|other| other.name() == command.name());
        assert!(!is_taken, "two commands are called `{}`", command.name());
        self.commands.push(command);
        self
    }

    /// Runs the tool on the process's arguments.
    #[must_use]
    pub fn main(self) -> ExitCode {
        // Without it, such a signal has its default effect; nothing else changes.
        let _ = engine::block_io_signals();
        let matches = match self.arguments().try_get_matches() {
            Ok(matches) => matches,
            Err(error) => {
                let code = if error.use_stderr() { NOT_LOADED } else { 0 };
                // An error that cannot be printed cannot be reported either.
                let _ = error.print();
                return code.into();
            }
        };
        let cli = Cli::from_arg_matches(&matches).expect("the matches come from these arguments");
        let err = OutStream::new(standard_error());
        init_logging(&cli, err.clone());
        let arguments = self.arguments();
        let shell = Shell::new(self.catalogue, cli.color, arguments, err);
        let (name, matches) = matches.subcommand().expect("clap requires a subcommand");
        let command = self.commands.iter().find(|command| command.name() == name);
        let code = (command.expect("clap accepts only these commands").run)(matches, &shell);
        shell.finish(code).into()
    }

    /// Returns the arguments of the tool, including those of all commands.
    fn arguments(&self) -> clap::Command {
        Cli::command().subcommands(self.commands.iter().map(|command| &command.command))
    }
}

/// Sends the log to standard error, line by line.
fn init_logging(cli: &Cli, err: OutStream) {
    let level = ["warn", "info", "debug"][usize::from(cli.verbose.min(2))];
    // Nodes that log are printed without `-v`.
    let level = format!("{level},{}=info", run::log::TARGET);
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let is_coloured = cli.color.is_on(&std::io::stderr());
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_ansi(is_coloured);
    log.with_writer(move || LogWriter(err.clone())).init();
}

/// Writes the lines of the log, each with one call.
struct LogWriter(OutStream);

impl io::Write for LogWriter {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.0.log(&String::from_utf8_lossy(line));
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_valid() {
        Tool::new(Catalogue::new()).arguments().debug_assert();
    }

    #[test]
    #[should_panic(expected = "two commands are called `run`")]
    fn a_command_can_be_added_only_once() {
        let _ = Tool::new(Catalogue::new()).command(derived(run::run));
    }
}
