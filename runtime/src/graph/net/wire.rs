//! Wires whose source is resolved, and where each was written.

use crate::graph::plan::PortRef;
use crate::graph::syntax::AgeLimit;
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Key};

/// A wire to an input of a node.
#[derive(Debug, Clone)]
pub(crate) struct Wire {
    /// Index of the input in the node's declaration.
    pub(crate) input: usize,
    pub(crate) key: Key,
    pub(crate) origin: WireOrigin,
    pub(crate) source: PortRef,
}

/// Where a wire was written: at the node, or at the part whose input the node reads.
#[derive(Debug, Clone)]
pub(crate) struct WireOrigin {
    /// The text that names the source.
    pub(crate) word: Spanned<String>,
    /// The scope of that text.
    pub(crate) scope: usize,
    /// The text at the node, if it refers to an input of its part.
    pub(crate) inner: Option<Spanned<String>>,
    /// The strictest age limit of the node's own wire and all wires into the parts around it.
    pub(crate) age: Option<AgeLimit>,
}

impl WireOrigin {
    /// Creates a diagnostic at this wire.
    pub(crate) fn diagnostic(&self, code: Code, message: String) -> Diagnostic {
        let diagnostic = Diagnostic::new(code, self.word.span.clone(), message);
        match &self.inner {
            Some(inner) => diagnostic.note(inner.span.clone(), "the part reads it here"),
            None => diagnostic,
        }
    }
}

/// A wire to a command or a report of a role.
#[derive(Debug, Clone)]
pub(crate) struct CommandWire {
    pub(crate) role: usize,
    /// The task whose file has the wire.
    pub(crate) task: usize,
    /// Index of the command, or of the report, in the role's declaration.
    pub(crate) command: usize,
    /// Whether the wire leads to a report, which informs the device and moves nothing.
    pub(crate) is_report: bool,
    pub(crate) origin: WireOrigin,
    pub(crate) source: PortRef,
}
