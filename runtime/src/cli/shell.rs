//! What a command speaks through: the catalogue, colours, and where words go.

use std::fmt::Display;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::ValueEnum;

use super::NOT_LOADED;
use crate::catalogue::Catalogue;
use crate::source::Report;

/// What a command is run in.
pub struct Shell {
    catalogue: Catalogue,
    colour: Colour,
    arguments: clap::Command,
    /// Whether something that was to be said is lost.
    is_cut: AtomicBool,
}

impl Shell {
    pub(super) const fn new(catalogue: Catalogue, colour: Colour, arguments: clap::Command) -> Self {
        Self { catalogue, colour, arguments, is_cut: AtomicBool::new(false) }
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

    /// Whether what is drawn on standard error may have colours.
    pub(super) fn has_colour_on_stderr(&self) -> bool {
        self.colour.is_on(&std::io::stderr())
    }

    /// Prints to standard output, and ends the line. A reader that has seen enough, `head` say, is no mistake of ours;
    /// a disk that is full is one of somebody's, and is told once.
    pub fn say(&self, text: &str) {
        let mut out = std::io::stdout().lock();
        let Err(error) = writeln!(out, "{text}").and_then(|()| out.flush()) else { return };
        if error.kind() != ErrorKind::BrokenPipe && !self.is_cut.swap(true, Ordering::Relaxed) {
            self.error(format_args!("cannot write to standard output: {error}"));
        }
    }

    /// Whether something that was to be said is lost.
    pub(super) fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
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
