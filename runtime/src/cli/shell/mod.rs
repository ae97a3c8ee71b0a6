//! What every command uses: the catalogue, output and exit codes, and the shape of a command.
#![allow(clippy::print_stderr, reason = "errors and warnings of the tool go to standard error")]

pub(super) mod command;
pub(super) mod json;
pub(super) mod panics;

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::ValueEnum;

use crate::catalogue::Catalogue;
use crate::source::{Report, suggest_name};

/// Exit code of a run that ended in a fault, and of a scenario that failed.
pub const FAULTED: u8 = 1;
/// Exit code of a file that does not load, and of an invalid command line.
pub const NOT_LOADED: u8 = 2;

/// The catalogue and the output of a running command.
pub struct Shell {
    catalogue: Catalogue,
    colour: Colour,
    arguments: clap::Command,
    /// Whether some output was lost.
    is_cut: AtomicBool,
}

impl Shell {
    pub(crate) const fn new(catalogue: Catalogue, colour: Colour, arguments: clap::Command) -> Self {
        Self { catalogue, colour, arguments, is_cut: AtomicBool::new(false) }
    }

    /// Returns the arguments of the tool, including those of all commands.
    #[must_use]
    pub const fn arguments(&self) -> &clap::Command {
        &self.arguments
    }

    /// Returns the catalogue.
    #[must_use]
    pub const fn catalogue(&self) -> &Catalogue {
        &self.catalogue
    }

    /// Whether standard output may have colours.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        self.colour.is_on(&std::io::stdout())
    }

    /// Whether standard error may have colours.
    pub(crate) fn has_colour_on_stderr(&self) -> bool {
        self.colour.is_on(&std::io::stderr())
    }

    /// Prints a line to standard output.
    ///
    /// A reader that closes the pipe early, such as `head`, is no error. Any other failure is reported once.
    pub fn say(&self, text: &str) {
        let mut out = std::io::stdout().lock();
        let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush()) else { return };
        if error.kind() != ErrorKind::BrokenPipe && !self.is_cut.swap(true, Ordering::Relaxed) {
            self.error(format_args!("cannot write to standard output: {error}"));
        }
    }

    /// Whether some output was lost.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }

    /// Prints a value to standard output as JSON.
    pub fn say_json(&self, value: &impl serde::Serialize) {
        self.say(&serde_json::to_string_pretty(value).expect("every key is a string"));
    }

    /// Prints the diagnostics of a graph to standard error.
    pub fn show(&self, report: &Report) {
        eprint!("{}", report.render(self.colour.is_on(&std::io::stderr())));
    }

    /// Prints the diagnostics of a graph that does not load, and returns the exit code.
    pub fn reject(&self, report: &Report) -> u8 {
        self.show(report);
        NOT_LOADED
    }

    /// Prints an error to standard error.
    pub fn error(&self, message: impl Display) {
        eprintln!("error: {message}");
    }

    /// Prints an error to standard error and returns the exit code of an invalid command line.
    pub fn refuse(&self, message: impl Display) -> u8 {
        self.error(message);
        NOT_LOADED
    }

    /// Prints a warning to standard error.
    pub fn warning(&self, message: impl Display) {
        eprintln!("warning: {message}");
    }
}

/// When to use colours.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(crate) enum Colour {
    Auto,
    Always,
    Never,
}

impl Colour {
    /// Whether output to that stream has colours.
    pub(crate) fn is_on(self, stream: &impl IsTerminal) -> bool {
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Auto => stream.is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()),
        }
    }
}

/// Describes a name that is not known: the message, and below it the most similar name or another way out.
pub(crate) fn unknown<'n>(what: &str, name: &str, known: impl Iterator<Item = &'n str>, otherwise: &str) -> String {
    let help = suggest_name(name, known).map_or_else(|| otherwise.to_owned(), |best| format!("did you mean `{best}`?"));
    format!("unknown {what} `{name}`\nhelp: {help}")
}
