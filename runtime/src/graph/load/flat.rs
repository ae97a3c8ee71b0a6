//! One flat graph: the parts are in place, names stand in scopes.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::graph::syntax::{Age, Bench, Block, GraphTable, ModeBlock, PolicyTable};
use crate::node::Word;
use crate::source::{Key, Table, Value};

/// A name in a scope.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Entity {
    Role(usize),
    Node(usize),
    Part(usize),
}

/// The names that a file's wires can use.
#[derive(Debug, Default)]
pub(crate) struct Scope {
    pub(crate) names: BTreeMap<String, (Key, Entity)>,
    pub(crate) exports: Vec<(Key, Word)>,
    /// Inputs that the part declares.
    pub(crate) declared: Vec<(Key, Word)>,
    /// Wires into the part; they stand in the scope of its parent.
    pub(crate) inputs: Vec<(Key, Word)>,
    pub(crate) parent: Option<usize>,
}

/// A node in its scope, with its full name.
#[derive(Debug)]
pub(crate) struct FlatNode {
    pub(crate) name: String,
    pub(crate) scope: usize,
    pub(crate) block: Block,
}

/// A graph without parts, and its bench.
#[derive(Debug, Default)]
pub(crate) struct FlatGraph {
    pub(crate) table: Option<GraphTable>,
    /// The section [graph] as it is written.
    pub(crate) settings: Option<Value>,
    /// Where to show what is missing in the graph as a whole.
    pub(crate) place: Range<usize>,
    pub(crate) roles: Vec<(Key, Word)>,
    pub(crate) nodes: Vec<FlatNode>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) commands: Vec<(Key, Key, Word)>,
    /// The section [limits] and its place.
    pub(crate) limits: Option<(Range<usize>, Table)>,
    pub(crate) modes: Vec<ModeBlock>,
    /// The section [policy], as it is written and as it reads.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    pub(crate) bench: Option<Bench>,
    /// Wires that may grow only so old, by the places of their sources.
    pub(crate) ages: BTreeMap<usize, Age>,
}
