//! What every command uses: the catalogue, output and exit codes, and the shape of a command.

pub(super) mod command;
pub(super) mod json;
pub(super) mod panics;
pub(super) mod patience;
#[cfg(feature = "mcap")]
pub(super) mod replays;
pub(super) mod stream;

use std::fmt::Display;
use std::fs::File;
use std::io::{self, IsTerminal, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use clap::ValueEnum;

use self::patience::Patience;
use self::stream::{Lost, OutStream};
use crate::catalogue::Catalogue;
use crate::cli::text::number::count_of;
use crate::source::{Report, suggest_name};

/// Interval at which the end of a write is awaited.
const POLL_INTERVAL: Duration = Duration::from_micros(200);

/// Exit code of a run that ended in a fault, and of a scenario that failed.
pub const FAULTED: u8 = 1;
/// Exit code of a file that does not load, and of an invalid command line.
pub const NOT_LOADED: u8 = 2;
/// Exit code of a command that a signal ended before its work began.
pub const INTERRUPTED: u8 = 130;

/// The catalogue and the output of a running command.
pub struct Shell {
    catalogue: Catalogue,
    colour: Colour,
    arguments: clap::Command,
    out: OutStream,
    err: OutStream,
    patience: Mutex<Patience>,
    /// Whether standard output is a file of the run, so that all texts go to standard error.
    is_out_taken: AtomicBool,
    /// Whether standard output is text for people, so that a warning may stand there.
    is_out_text: AtomicBool,
    /// Whether a reader did not read for a while, so that nothing waits for the order of lines any more.
    is_stuck: AtomicBool,
}

impl Shell {
    /// Creates a shell that writes errors and warnings to `err`.
    pub(crate) fn new(catalogue: Catalogue, colour: Colour, arguments: clap::Command, err: OutStream) -> Self {
        let (out, patience) = (OutStream::new(standard_output()), Mutex::default());
        let [is_out_taken, is_out_text, is_stuck] = [false; 3].map(AtomicBool::new);
        Self { catalogue, colour, arguments, out, err, patience, is_out_taken, is_out_text, is_stuck }
    }

    /// Returns the arguments of the tool, including those of all commands.
    #[must_use]
    pub const fn arguments(&self) -> &clap::Command {
        &self.arguments
    }

    /// Returns the catalogue.
    pub const fn catalogue(&self) -> &Catalogue {
        &self.catalogue
    }

    /// Whether the output of a command may have colours.
    #[must_use]
    pub fn has_colour(&self) -> bool {
        if self.is_out_taken() { self.has_colour_on_stderr() } else { self.colour.is_on(&stdout()) }
    }

    /// Whether standard error may have colours.
    pub(crate) fn has_colour_on_stderr(&self) -> bool {
        self.colour.is_on(&stderr())
    }

    /// Prints a line to standard output.
    ///
    /// It returns before the line is written. A reader that closes the pipe early, such as `head`, is no error. Any
    /// other failure is reported at the end, once.
    pub fn say(&self, text: &str) {
        let (stream, other) = if self.is_out_taken() { (&self.err, &self.out) } else { (&self.out, &self.err) };
        self.come_after(other);
        stream.print(format!("{text}\n"));
    }

    /// Prints a value to standard output as JSON.
    pub fn say_json(&self, value: &impl serde::Serialize) {
        self.say(&serde_json::to_string_pretty(value).expect("every key is a string"));
    }

    /// Prints the diagnostics of a graph to standard error.
    pub fn show(&self, report: &Report) {
        self.print_beside(report.render(self.has_colour_on_stderr()));
    }

    /// Prints the diagnostics of a graph that does not load, and returns the exit code.
    pub fn reject(&self, report: &Report) -> u8 {
        self.show(report);
        NOT_LOADED
    }

    /// Prints an error to standard error.
    pub fn error(&self, message: impl Display) {
        self.print_beside(format!("error: {message}\n"));
    }

    /// Prints an error to standard error and returns the exit code of an invalid command line.
    pub fn refuse(&self, message: impl Display) -> u8 {
        self.error(message);
        NOT_LOADED
    }

    /// Prints a warning to standard error.
    pub fn warning(&self, message: impl Display) {
        self.print_beside(format!("warning: {message}\n"));
    }

    /// Prints a line to standard error that is neither an error nor a warning.
    pub fn say_beside(&self, text: &str) {
        self.print_beside(format!("{text}\n"));
    }

    fn print_beside(&self, text: String) {
        self.come_after(&self.out);
        self.err.print(text);
    }

    /// Draws a text on standard error in the place of the last drawing, if it is a terminal.
    pub(crate) fn draw(&self, text: &str) {
        if stderr().is_terminal() {
            self.err.draw(text.to_owned());
        }
    }

    /// Returns standard error.
    pub(crate) const fn err(&self) -> &OutStream {
        &self.err
    }

    /// Uses standard output for a file of the run; from now on, every text goes to standard error.
    pub(crate) fn take_output(&self) {
        self.is_out_taken.store(true, Ordering::Relaxed);
    }

    /// Notes that standard output is text for people. If nobody reads standard error, its last warning goes there.
    pub(crate) fn print_text(&self) {
        self.is_out_text.store(true, Ordering::Relaxed);
    }

    /// Whether nobody reads standard output any more.
    pub(crate) fn is_out_closed(&self) -> bool {
        self.out.is_closed()
    }

    fn is_out_taken(&self) -> bool {
        self.is_out_taken.load(Ordering::Relaxed)
    }

    /// Returns how long to wait for readers of the output.
    pub(crate) fn patience(&self) -> Patience {
        self.patience.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Sets how long to wait for readers of the output.
    pub(crate) fn set_patience(&self, patience: &Patience) {
        *self.patience.lock().unwrap_or_else(PoisonError::into_inner) = patience.clone();
        for stream in [&self.out, &self.err] {
            stream.set_patience(patience.clone());
        }
    }

    /// Waits for a moment until the lines so far are written, before a log goes on in standard error.
    pub(crate) fn begin_log(&self) {
        self.come_after(&self.out);
    }

    /// Waits for a moment until the lines before are written, so that both streams keep their order on a terminal.
    fn come_after(&self, other: &OutStream) {
        let is_stuck = self.is_stuck.load(Ordering::Relaxed);
        let mut waiting = self.patience().begin_short();
        while !is_stuck && !other.is_idle() {
            if !waiting.goes_on(other.progress()) {
                self.is_stuck.store(true, Ordering::Relaxed);
                return;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Writes what is left of the output, says what was lost, and returns the exit code.
    pub(crate) fn finish(&self, code: u8) -> u8 {
        self.settle();
        let (out, err) = (self.out.lost(), self.err.lost());
        if err.lines > 0 {
            let message = format!("warning: {}\n", lost_text("standard error", &err));
            let can_take_it = err.error.is_none() && !self.err.is_closed();
            if can_take_it {
                self.err.print(message);
            } else if self.is_out_text.load(Ordering::Relaxed) && !self.is_out_taken() {
                self.out.print(message);
            }
        }
        // The reader closed the pipe, as `head` does, which is no error.
        let is_cut = out.lines > 0 && !out.is_closed_by_reader;
        if is_cut {
            self.error(lost_text("standard output", &out));
        }
        self.settle();
        if is_cut { code.max(FAULTED) } else { code }
    }

    /// Waits until the output is written, or until its readers are given up.
    fn settle(&self) {
        let mut waiting = self.patience().begin();
        while !(self.out.is_idle() && self.err.is_idle()) {
            if !waiting.goes_on(self.out.progress() + self.err.progress()) {
                self.out.give_up();
                self.err.give_up();
                return;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }
}

/// Describes what a stream has lost.
fn lost_text(stream: &str, lost: &Lost) -> String {
    let count = count_of(lost.lines as usize, "line");
    match &lost.error {
        Some(error) => format!("cannot write to {stream}: {error}: {count} lost"),
        None => format!("{stream} was not read in time: {count} lost"),
    }
}

/// Returns standard output as a file, for a thread that writes it.
pub(crate) fn standard_output() -> io::Result<File> {
    duplicate(&stdout())
}

/// Returns standard error as a file, for a thread that writes it.
pub(crate) fn standard_error() -> io::Result<File> {
    duplicate(&stderr())
}

#[cfg(unix)]
fn duplicate(stream: &impl std::os::fd::AsFd) -> io::Result<File> {
    stream.as_fd().try_clone_to_owned().map(File::from)
}

#[cfg(windows)]
fn duplicate(stream: &impl std::os::windows::io::AsHandle) -> io::Result<File> {
    stream.as_handle().try_clone_to_owned().map(File::from)
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
