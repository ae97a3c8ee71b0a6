//! What a command is, and the arguments and formats that commands share.

use std::marker::PhantomData;
use std::path::PathBuf;

use clap::{Args, CommandFactory, FromArgMatches, Parser, ValueEnum};

use super::Shell;
use crate::graph::Request;

/// A command of the tool.
pub trait Subcommand {
    /// Returns its name, its arguments and its help.
    fn command(&self) -> clap::Command;

    /// Runs it and returns the exit code.
    fn run(&self, matches: &clap::ArgMatches, shell: &Shell) -> u8;
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
        let arguments = A::from_arg_matches(matches).expect("the matches come from this command");
        (self.run)(arguments, shell)
    }
}

/// The bench of a graph, and values that replace those of its files.
#[derive(Args)]
pub(crate) struct GraphArgs {
    /// Use this bench instead of the one that the graph names
    #[arg(long, value_name = "FILE")]
    pub(crate) bench: Option<PathBuf>,
    /// Replace a value of the graph or its bench, for example nodes.pid.gains.x.kp=3; may be repeated
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<String>,
}

impl GraphArgs {
    /// Returns the request to load a graph with these arguments.
    pub(crate) fn request(&self, graph: PathBuf) -> Request {
        Request { graph, bench: self.bench.clone(), set: self.set.clone(), ..Request::default() }
    }
}

/// Output for a person or for a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum OutputFormat {
    Text,
    Json,
}
