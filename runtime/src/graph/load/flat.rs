//! The flat graph: parts are expanded, and each name belongs to a scope.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::graph::syntax::{Allowance, BenchDocument, Block, GraphTable, ModeBlock, PolicyTable, WireEntry};
use crate::node::Spanned;
use crate::source::{Key, Table, Value};

/// What a name in a scope refers to, by index.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Entity {
    Role(usize),
    Node(usize),
    Part(usize),
}

/// The names that the wires of one file can use.
#[derive(Debug, Default)]
pub(crate) struct Scope {
    pub(crate) names: BTreeMap<String, (Key, Entity)>,
    pub(crate) exports: Vec<(Key, Spanned<String>)>,
    /// Inputs that the part declares, with their documentation.
    pub(crate) declared: Vec<(Key, Spanned<String>)>,
    /// Wires into the part, in the scope of its parent.
    pub(crate) inputs: Vec<WireEntry>,
    pub(crate) parent: Option<usize>,
}

/// A node with its full name and its scope.
#[derive(Debug)]
pub(crate) struct FlatNode {
    pub(crate) name: String,
    pub(crate) scope: usize,
    pub(crate) block: Block,
}

/// A graph with all parts expanded, and its bench.
#[derive(Debug, Default)]
pub(crate) struct FlatGraph {
    pub(crate) table: Option<GraphTable>,
    /// The section [graph] as written.
    pub(crate) settings: Option<Value>,
    /// Span for diagnostics about the graph as a whole.
    pub(crate) place: Range<usize>,
    pub(crate) roles: Vec<(Key, Spanned<String>)>,
    pub(crate) nodes: Vec<FlatNode>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) commands: Vec<(Key, WireEntry)>,
    /// The section [limits] and its span.
    pub(crate) limits: Option<(Range<usize>, Table)>,
    pub(crate) modes: Vec<ModeBlock>,
    /// The section [policy] as written, and parsed if it is valid.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    pub(crate) bench: Option<BenchDocument>,
    pub(crate) allow: Vec<Allowance>,
}

impl FlatGraph {
    /// Returns the names of the declared roles.
    pub(crate) fn role_names(&self) -> impl Iterator<Item = &str> + Clone {
        self.roles.iter().map(|(key, _)| key.name.as_str())
    }

    /// Returns the names of the modes.
    pub(crate) fn mode_names(&self) -> impl Iterator<Item = &str> + Clone {
        self.modes.iter().map(|mode| mode.key.name.as_str())
    }
}
