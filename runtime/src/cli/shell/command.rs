//! What a command is, and the arguments and formats that commands share.

use std::path::PathBuf;

use clap::{Args, Parser, ValueEnum};

use super::Shell;
use crate::graph::Request;

/// Runs a command and returns the exit code.
type RunCommand = dyn Fn(&clap::ArgMatches, &Shell) -> u8;

/// A command of the tool.
pub struct Subcommand {
    /// Its name, its arguments and its help.
    pub(crate) command: clap::Command,
    pub(crate) run: Box<RunCommand>,
}

/// What a command returns: its exit code. In a `Result`, that of an early end is the error, so that `?` ends the command.
pub trait CommandEnd {
    /// Returns the exit code.
    fn code(self) -> u8;
}

impl CommandEnd for u8 {
    fn code(self) -> u8 {
        self
    }
}

impl CommandEnd for Result<u8, u8> {
    fn code(self) -> u8 {
        self.unwrap_or_else(|code| code)
    }
}

/// Makes a command from a function and from arguments that clap derives.
///
/// ```
/// use tactflow_runtime::cli::{Shell, clap, derived};
///
/// /// Greet somebody
/// #[derive(clap::Parser)]
/// #[command(name = "greet")]
/// struct Greet {
///     /// Whom to greet
///     name: String,
/// }
///
/// let greet = derived(|greet: Greet, shell: &Shell| {
///     shell.say(&format!("hello {}", greet.name));
///     0
/// });
/// assert_eq!(greet.name(), "greet");
/// ```
pub fn derived<A: Parser, E: CommandEnd>(run: impl Fn(A, &Shell) -> E + 'static) -> Subcommand {
    let run = move |matches: &clap::ArgMatches, shell: &Shell| {
        run(A::from_arg_matches(matches).expect("the matches come from this command"), shell).code()
    };
    Subcommand { command: A::command(), run: Box::new(run) }
}

impl Subcommand {
    /// Returns its name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.command.get_name()
    }
}

/// The bench of a graph, and values that replace those of its files.
#[derive(Debug, Args)]
pub struct GraphArgs {
    /// Use this bench instead of the one that the graph names
    #[arg(long, value_name = "FILE")]
    pub bench: Option<PathBuf>,
    /// Replace a value of the graph or its bench, for example nodes.pid.gains.x.kp=3; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl GraphArgs {
    /// Whether one of these arguments is given.
    pub(crate) fn is_given(&self) -> bool {
        self.bench.is_some() || !self.set.is_empty()
    }

    /// Returns the request to load a graph with these arguments.
    pub fn request(&self, graph: PathBuf) -> Request {
        Request { graph, bench: self.bench.clone(), set: self.set.clone(), ..Request::default() }
    }
}

/// Output for a person or for a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum OutputFormat {
    /// For a person.
    #[default]
    Text,
    /// For a program.
    Json,
}
