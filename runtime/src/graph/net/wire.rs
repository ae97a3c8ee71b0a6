//! Wires that lead somewhere, and where each is written.

use crate::graph::plan::PortRef;
use crate::graph::syntax::Age;
use crate::node::Word;
use crate::source::{Code, Diagnostic, Key};

/// A wire that goes somewhere.
#[derive(Debug, Clone)]
pub(crate) struct Wire {
    /// Index of the input in the node's declaration.
    pub(crate) input: usize,
    pub(crate) key: Key,
    pub(crate) origin: Origin,
    pub(crate) source: PortRef,
}

/// Where a wire was written: the node's own, or the one into its part that it passes on.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    /// The wire that says where it comes from.
    pub(crate) word: Word,
    /// The scope it stands in.
    pub(crate) scope: usize,
    /// The node's own wire, where that only passes on an input of its part.
    pub(crate) inner: Option<Word>,
    /// How old what comes over the wire may be, as the strictest says of the node's own and all into the parts around.
    pub(crate) age: Option<Age>,
}

impl Origin {
    /// A mistake of this wire.
    pub(crate) fn mistake(&self, code: Code, message: String) -> Diagnostic {
        let diagnostic = Diagnostic::new(code, self.word.span.clone(), message);
        match &self.inner {
            Some(inner) => diagnostic.note(inner.span.clone(), "the part takes it here"),
            None => diagnostic,
        }
    }
}

/// A wire under [commands] that goes somewhere.
#[derive(Debug, Clone)]
pub(crate) struct CommandWire {
    pub(crate) role: usize,
    /// Index of the command, or of the report, in the role's declaration.
    pub(crate) command: usize,
    /// Whether it only tells the role something, and moves nothing.
    pub(crate) is_report: bool,
    pub(crate) origin: Origin,
    pub(crate) source: PortRef,
}
