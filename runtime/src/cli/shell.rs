//! What a command speaks through: the catalogue, colours, and where words go.

use std::fmt::Display;
use std::io::{IsTerminal, Write};

use clap::ValueEnum;

use super::NOT_LOADED;
use crate::catalogue::Catalogue;
use crate::diagnostic::Report;

/// What a command is run in.
pub struct Shell {
    catalogue: Catalogue,
    colour: Colour,
    arguments: clap::Command,
}

impl Shell {
    pub(super) const fn new(catalogue: Catalogue, colour: Colour, arguments: clap::Command) -> Self {
        Self { catalogue, colour, arguments }
    }

    /// The arguments of the tool, with those of all commands.
    #[must_use]
    pub const fn arguments(&self) -> &clap::Command {
        &self.arguments
    }

    /// What graphs may be made of.
    #[must_use]
    pub const fn catalogue(&self) -> &Catalogue {
        &self.catalogue
    }

    /// Whether what is said may have colours.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        self.colour.is_on(&std::io::stdout())
    }

    /// Prints to standard output, and ends the line. A reader that has seen enough, `head` say, is no mistake of ours.
    pub fn say(&self, text: &str) {
        let mut out = std::io::stdout().lock();
        let _ = writeln!(out, "{text}").and_then(|()| out.flush());
    }

    /// Prints something for a program to standard output, as JSON.
    pub fn say_json(&self, value: &impl serde::Serialize) {
        self.say(&serde_json::to_string_pretty(value).expect("what is said has names for keys, and finite numbers"));
    }

    /// Shows what is wrong with a graph, on standard error.
    pub fn show(&self, report: &Report) {
        eprint!("{}", report.render(self.colour.is_on(&std::io::stderr())));
    }

    /// Shows what is wrong with a graph that does not load; gives the exit code.
    pub fn complain(&self, report: &Report) -> u8 {
        self.show(report);
        NOT_LOADED
    }

    /// Says what went wrong, to standard error.
    pub fn error(&self, message: impl Display) {
        eprintln!("error: {message}");
    }

    /// Says what is to be looked at, to standard error.
    pub fn warning(&self, message: impl Display) {
        eprintln!("warning: {message}");
    }
}

/// When to use colours.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub(super) enum Colour {
    Auto,
    Always,
    Never,
}

impl Colour {
    pub(super) fn is_on(self, stream: &impl IsTerminal) -> bool {
        match self {
            Self::Always => true,
            Self::Never => false,
            Self::Auto => stream.is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty()),
        }
    }
}
