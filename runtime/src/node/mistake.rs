//! Mistakes that a node or a device finds in its parameters or its wires.

use std::io;
use std::ops::Range;
use std::sync::Arc;

use super::file_path::FilePath;
use crate::source::{Code, Meant, did_you_mean, suggest_name, suggestion};

/// The place of a mistake, by the names of the graph file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum At {
    /// The value of a parameter, by its dotted path.
    Param(String),
    /// The key of a parameter, by its dotted path.
    Key(String),
    /// The wire of an input, by the input's name: `x` for `in.x`.
    Input(String),
    /// A place in the source map.
    Span(Range<usize>),
    /// A place in a data file that the graph names.
    Data {
        /// The file and the place of its name.
        file: Box<FilePath>,
        /// Its text, shared by all mistakes in it.
        text: Arc<str>,
        /// The place in that text.
        span: Range<usize>,
    },
    /// The node as a whole.
    Node,
}

/// One mistake: its place, what is wrong, and how to fix it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[must_use]
pub struct Mistake {
    /// The code.
    pub code: Code,
    /// The place.
    pub at: At,
    /// What is wrong: lower case, no full stop, names in backticks.
    pub message: String,
    /// How to fix it.
    pub help: Option<String>,
    /// The marked name and the one to write instead, if that fixes it.
    pub instead: Option<Box<(String, String)>>,
}

/// One or more mistakes.
pub type Mistakes = Vec<Mistake>;

impl Mistake {
    /// Creates a mistake with any code and place.
    pub fn new(code: Code, at: At, message: impl Into<String>) -> Self {
        Self { code, at, message: message.into(), help: None, instead: None }
    }

    /// The value of a parameter, by its dotted path, is wrong.
    pub fn param(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::BadValue, At::Param(path.into()), message)
    }

    /// A key, by its dotted path, is unknown.
    pub fn key(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::UnknownKey, At::Key(path.into()), message)
    }

    /// The shape of an input does not match the other inputs or the parameters.
    pub fn input(name: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::ShapeMismatch, At::Input(name.into()), message)
    }

    /// A data file is wrong at a place in its text.
    pub fn data(file: &FilePath, text: impl Into<Arc<str>>, span: Range<usize>, message: impl Into<String>) -> Self {
        let at = At::Data { file: Box::new(file.clone()), text: text.into(), span };
        Self::new(Code::BadData, at, message)
    }

    /// A file is not readable.
    pub fn unreadable(file: &FilePath, error: &io::Error) -> Self {
        let message = format!("cannot read `{}`: {error}", file.path.display());
        Self::new(Code::Unreadable, At::Span(file.span.clone()), message)
    }

    /// Adds the help for an unknown `name`, which is marked: the closest of the `known` names, or all of them.
    ///
    /// `what` names the known things in the plural, for example "features".
    pub fn suggest<'n>(self, name: &str, known: impl Iterator<Item = &'n str> + Clone, what: &str) -> Self {
        match suggest_name(name, known.clone()) {
            Some(best) => self.instead(name, best),
            None => self.help(suggestion(name, known, what)),
        }
    }

    /// Suggests `best` in place of `name`, which is marked.
    pub fn instead(self, name: &str, best: &str) -> Self {
        Self { instead: Some(Box::new((name.to_owned(), best.to_owned()))), ..self.help(did_you_mean(best)) }
    }

    /// Suggests the name that an unknown key, which is marked, misspells. `what` names the known things in the plural.
    pub(crate) fn meant(self, key: &str, meant: Meant<'_>, known: &[&str], what: &str) -> Self {
        match meant {
            Meant::Free(name) => self.instead(key, name),
            Meant::Taken(name) => self.help(format!("did you mean `{name}`, which is there already?")),
            Meant::Unknown => self.help(suggestion(key, known.iter().copied(), what)),
        }
    }

    /// Adds a way to fix it.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl From<Mistake> for Mistakes {
    fn from(mistake: Mistake) -> Self {
        vec![mistake]
    }
}

/// Returns the mistakes as an error if there are any.
///
/// # Errors
/// All the mistakes.
pub fn refuse_any(mistakes: impl IntoIterator<Item = Mistake>) -> Result<(), Mistakes> {
    let mistakes: Mistakes = mistakes.into_iter().collect();
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes) }
}

/// Returns both values, or the mistakes of both.
///
/// # Errors
/// The mistakes of `a`, then those of `b`.
pub fn collect_both<A, B>(a: Result<A, Mistakes>, b: Result<B, Mistakes>) -> Result<(A, B), Mistakes> {
    match (a, b) {
        (Ok(a), Ok(b)) => Ok((a, b)),
        (a, b) => Err([a.err(), b.err()].into_iter().flatten().flatten().collect()),
    }
}
