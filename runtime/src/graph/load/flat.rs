//! The flat graph: parts are expanded, and each name belongs to a scope.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::graph::syntax::{
    Allowance, BenchDocument, Block, GraphTable, LimitOwner, LimitSection, ModeBlock, PolicyTable, WireEntry,
};
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Key, Named, Value};

/// What a name in a scope refers to, by index.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Entity {
    Role(usize),
    Node(usize),
    Part(usize),
    /// A part whose file cannot be read, which has its own diagnostic.
    Unknown,
}

/// The names that the wires of one file can use.
#[derive(Debug, Default)]
pub(crate) struct Scope {
    pub(crate) names: BTreeMap<String, (Key, Entity)>,
    pub(crate) exports: Named<Spanned<String>>,
    /// Inputs that the part declares, with their documentation.
    pub(crate) declared: Named<Spanned<String>>,
    /// Wires into the part, in the scope of its parent.
    pub(crate) inputs: Named<WireEntry>,
    pub(crate) parent: Option<usize>,
    /// The name of the part in the scope of its parent.
    pub(crate) part: Option<Key>,
    /// The role of the graph for each name of a role in this file that differs from it.
    pub(crate) roles: BTreeMap<String, String>,
    /// Where the text of the file of a part is.
    pub(crate) text: Range<usize>,
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
    /// The type of each role.
    pub(crate) roles: Named<Spanned<String>>,
    /// The arm that carries each sensor which names one.
    pub(crate) carriers: Named<Spanned<String>>,
    pub(crate) nodes: Vec<FlatNode>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) commands: Vec<(Key, WireEntry)>,
    /// The limits of the task, the bench, the robots and the command line.
    pub(crate) limits: Vec<LimitSection>,
    pub(crate) modes: Vec<ModeBlock>,
    /// The section [policy] as written, and parsed if it is valid.
    pub(crate) policy: Option<(Value, Option<PolicyTable>)>,
    pub(crate) bench: Option<BenchDocument>,
    pub(crate) allow: Vec<Allowance>,
}

impl FlatGraph {
    /// Returns whether the section [graph] has an unknown key, which may be meant for a missing one.
    pub(crate) fn has_unknown_setting(&self, diagnostics: &[Diagnostic]) -> bool {
        let keys = || self.settings.iter().filter_map(Value::as_table).flat_map(|table| &table.entries);
        let is_key = |found: &Diagnostic| keys().any(|(key, _)| key.span == found.span);
        diagnostics.iter().any(|found| found.code == Code::UnknownKey && is_key(found))
    }

    /// Returns the role of the graph that a name means which is written at `at`: in the file of a scope, or in one of
    /// those around it, which may override a value of the part.
    pub(crate) fn role_at<'n>(&'n self, scope: usize, name: &'n str, at: usize) -> &'n str {
        let around = std::iter::successors(Some(scope), |scope| self.scopes[*scope].parent);
        let mut scopes = around.map(|scope| &self.scopes[scope]);
        let own = scopes.find(|scope| scope.text.contains(&at));
        own.and_then(|scope| scope.roles.get(name)).map_or(name, String::as_str)
    }

    /// Returns the limits of all sections, each with its name.
    pub(crate) fn all_limits(&self) -> impl Iterator<Item = &(Key, Value)> {
        self.limits.iter().flat_map(|section| &section.table.entries)
    }

    /// Returns the limit of which a place is a part.
    pub(crate) fn limit_at(&self, place: &Range<usize>) -> Option<&(Key, Value)> {
        self.all_limits().find(|(_, value)| value.span.start <= place.start && place.end <= value.span.end)
    }

    /// Returns the section [limits] of the task, or `None` if it has none.
    pub(crate) fn task_limits(&self) -> Option<&LimitSection> {
        self.limits.iter().find(|section| section.owner == LimitOwner::Task)
    }

    /// Returns the names of the modes.
    pub(crate) fn mode_names(&self) -> impl Iterator<Item = &str> + Clone {
        self.modes.iter().map(|mode| mode.key.name.as_str())
    }

    /// Returns the index of each mode by its name.
    pub(crate) fn mode_numbers(&self) -> BTreeMap<&str, usize> {
        self.mode_names().enumerate().map(|(number, name)| (name, number)).collect()
    }
}
