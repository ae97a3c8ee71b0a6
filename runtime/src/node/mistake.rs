//! What a node says is wrong with its parameters or its wires.

use std::io;
use std::ops::Range;
use std::sync::Arc;

use super::file_path::FilePath;
use crate::source::Code;

/// The place of a mistake, in the words of the graph file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum At {
    /// The value of a parameter, by its dotted path.
    Param(String),
    /// The key of a parameter, by its dotted path.
    Key(String),
    /// The wire of an input, by its name (`x`, or `in.x`'s last part).
    Input(String),
    /// A place that is known already.
    Span(Range<usize>),
    /// A place in a file of data that the graph names.
    Data {
        /// The file, and where its name stands.
        file: Box<FilePath>,
        /// Its text, which all mistakes in it share.
        text: Arc<str>,
        /// The place in that text.
        span: Range<usize>,
    },
    /// The node as a whole.
    Node,
}

/// One mistake: where, what, and a way out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mistake {
    /// What sort of mistake.
    pub code: Code,
    /// Where.
    pub at: At,
    /// What is wrong: lower case, no full stop, names in backticks.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

/// One or more mistakes.
pub type Mistakes = Vec<Mistake>;

impl Mistake {
    /// A mistake of any sort.
    pub fn new(code: Code, at: At, message: impl Into<String>) -> Self {
        Self { code, at, message: message.into(), help: None }
    }

    /// The value at a parameter's dotted path will not do.
    pub fn param(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::BadValue, At::Param(path.into()), message)
    }

    /// The key at a parameter's dotted path is one too many.
    pub fn key(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::UnknownKey, At::Key(path.into()), message)
    }

    /// What comes in on an input does not fit the rest.
    pub fn input(name: impl Into<String>, message: impl Into<String>) -> Self {
        Self::new(Code::ShapeMismatch, At::Input(name.into()), message)
    }

    /// A file of data is not what it should be, at a place in its text.
    pub fn data(file: &FilePath, text: impl Into<Arc<str>>, span: Range<usize>, message: impl Into<String>) -> Self {
        let at = At::Data { file: Box::new(file.clone()), text: text.into(), span };
        Self::new(Code::BadData, at, message)
    }

    /// A file cannot be read.
    #[must_use]
    pub fn unreadable(file: &FilePath, error: &io::Error) -> Self {
        let message = format!("cannot read `{}`: {error}", file.path.display());
        Self::new(Code::Unreadable, At::Span(file.span.clone()), message)
    }

    /// The same mistake with a way out.
    #[must_use]
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
