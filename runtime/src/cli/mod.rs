//! The command line, as a library function: a node crate gets the whole tool from a five-line `main`.
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
//! Every command is a [`Subcommand`], those that are always there too. A crate adds its own with [`Tool::command`], and
//! [`derived`] makes one from arguments that clap derives.
#![allow(clippy::print_stderr, reason = "this is where the tool speaks")]

mod chart;
mod check;
mod completions;
mod course;
mod describe;
mod entry;
mod example;
mod json;
mod list;
mod log;
mod page;
mod picture;
mod progress;
mod prose;
mod reference;
mod run;
mod shell;
mod show;
mod summary;
mod timeline;
mod verify;
mod view;

use std::marker::PhantomData;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, CommandFactory, FromArgMatches, Parser};
use tracing_subscriber::EnvFilter;

use crate::catalogue::Catalogue;
use crate::graph::Request;

/// The parser of arguments, for commands of one's own.
pub use clap;
pub use example::example;
pub use reference::reference;
pub use run::{Job, Print, duration};
use shell::Colour;
pub use shell::Shell;

/// Exit code of what went wrong while it ran.
pub const FAULTED: u8 = 1;
/// Exit code of a file that does not load, and of a command line that is not understood.
pub const NOT_LOADED: u8 = 2;

/// A command of the tool.
pub trait Subcommand {
    /// Its name, its arguments and its help.
    fn command(&self) -> clap::Command;

    /// Does it; the result is the exit code.
    fn run(&self, matches: &clap::ArgMatches, shell: &Shell) -> u8;
}

/// The command whose name and arguments are those of `A`.
///
/// ```
/// use tactflow_runtime::cli::{Shell, clap, derived};
///
/// /// Greet somebody
/// #[derive(clap::Parser)]
/// #[command(name = "greet")]
/// struct Greet {
///     /// Whom
///     name: String,
/// }
///
/// let greet = derived(|greet: Greet, shell: &Shell| {
///     shell.say(&format!("hello {}", greet.name));
///     0
/// });
/// assert_eq!(greet.command().get_name(), "greet");
/// ```
pub fn derived<A: Parser + 'static>(run: impl Fn(A, &Shell) -> u8 + 'static) -> Box<dyn Subcommand> {
    Box::new(Derived { run, arguments: PhantomData })
}

struct Derived<A, F> {
    run: F,
    arguments: PhantomData<A>,
}

impl<A: CommandFactory + FromArgMatches, F: Fn(A, &Shell) -> u8> Subcommand for Derived<A, F> {
    fn command(&self) -> clap::Command {
        A::command()
    }

    fn run(&self, matches: &clap::ArgMatches, shell: &Shell) -> u8 {
        let arguments = A::from_arg_matches(matches).expect("they were parsed as the command declares them");
        (self.run)(arguments, shell)
    }
}

/// Tactile servoing from graph files.
#[derive(Parser)]
#[command(name = "tactflow", version, max_term_width = 100)]
#[command(subcommand_required = true, arg_required_else_help = true)]
#[command(
    after_help = "Exit codes: 0 all went well; 1 the run ended in a fault, or a scenario is not met; 2 a file does not load, or the \
                       command line is not understood."
)]
struct Cli {
    /// When to use colours; `auto` means on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, default_value_t = Colour::Auto, value_name = "WHEN")]
    color: Colour,
    /// Say more; twice: much more (RUST_LOG chooses finer)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

/// Which graph on which bench, with what laid over them.
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

/// The tool: a catalogue and commands.
pub struct Tool {
    catalogue: Catalogue,
    commands: Vec<Box<dyn Subcommand>>,
}

impl Tool {
    /// The tool with the commands that need nothing but a catalogue.
    #[must_use]
    pub fn new(catalogue: Catalogue) -> Self {
        Self {
            catalogue,
            commands: vec![
                derived(run::run),
                derived(check::check),
                derived(verify::verify),
                derived(list::list),
                derived(describe::describe),
                derived(show::show),
                derived(completions::completions),
            ],
        }
    }

    /// With one more command.
    ///
    /// # Panics
    /// If there is a command of that name already.
    #[must_use]
    pub fn command(mut self, command: Box<dyn Subcommand>) -> Self {
        let name = command.command().get_name().to_owned();
        let is_taken = self.commands.iter().any(|other| other.command().get_name() == name);
        assert!(!is_taken, "two commands are called `{name}`");
        self.commands.push(command);
        self
    }

    /// Runs the tool on the process's arguments.
    #[must_use]
    pub fn main(self) -> ExitCode {
        let matches = match self.arguments().try_get_matches() {
            Ok(matches) => matches,
            Err(error) => {
                let code = if error.use_stderr() { NOT_LOADED } else { 0 };
                // Nothing is left to say where even that cannot be printed.
                let _ = error.print();
                return code.into();
            }
        };
        let cli = Cli::from_arg_matches(&matches).expect("they were parsed as they are declared");
        log(&cli);
        let arguments = self.arguments();
        let shell = Shell::new(self.catalogue, cli.color, arguments);
        let (name, matches) = matches.subcommand().expect("one is required");
        let command = self.commands.iter().find(|command| command.command().get_name() == name);
        match command.expect("clap knows no others").run(matches, &shell) {
            0 if shell.is_cut() => FAULTED.into(),
            code => code.into(),
        }
    }

    /// All arguments, with those of every command.
    fn arguments(&self) -> clap::Command {
        Cli::command().subcommands(self.commands.iter().map(|command| command.command()))
    }
}

fn log(cli: &Cli) {
    let level = ["warn", "info", "debug"][usize::from(cli.verbose.min(2))];
    // What the graph asks to see is seen without a switch.
    let level = format!("{level},{}=info", log::TARGET);
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level));
    let is_coloured = cli.color.is_on(&std::io::stderr());
    tracing_subscriber::fmt().with_env_filter(filter).with_ansi(is_coloured).with_writer(std::io::stderr).init();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_sound() {
        Tool::new(Catalogue::new()).arguments().debug_assert();
    }

    #[test]
    #[should_panic(expected = "two commands are called `run`")]
    fn a_command_is_there_once() {
        let _ = Tool::new(Catalogue::new()).command(derived(run::run));
    }
}
