//! The flat graph: parts are expanded, and each name belongs to a scope.

use std::collections::BTreeMap;
use std::ops::Range;

use super::task::Task;
use crate::graph::syntax::{
    Allowance, BenchDocument, Block, CommandEntry, LimitOwner, LimitSection, LiveEntry, ModeBlock, PolicyTable,
    RecordTable, WireEntry,
};
use crate::node::Spanned;
use crate::source::{Item, Key, Named, Value};

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
    /// The innermost task around it.
    pub(crate) task: usize,
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
    /// The graph itself, and the parts that are tasks.
    pub(crate) tasks: Vec<Task>,
    /// The type of each role.
    pub(crate) roles: Named<Spanned<String>>,
    /// The arm that carries each sensor which names one.
    pub(crate) carriers: Named<Spanned<String>>,
    pub(crate) nodes: Vec<FlatNode>,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) commands: Vec<CommandEntry>,
    /// The span of the section [commands] of the graph itself if it is empty.
    pub(crate) empty_commands: Option<Range<usize>>,
    /// The limits of the task, the bench, the robots and the command line.
    pub(crate) limits: Vec<LimitSection>,
    /// The modes of all tasks.
    pub(crate) modes: Vec<ModeBlock>,
    pub(crate) bench: Option<BenchDocument>,
    pub(crate) allow: Vec<Allowance>,
    /// The parameters that may change while the graph runs.
    pub(crate) live: Vec<LiveEntry>,
    /// What a recording contains.
    pub(crate) record: Option<RecordTable>,
}

impl FlatGraph {
    /// Returns the graph itself as a task.
    pub(crate) fn root(&self) -> &Task {
        &self.tasks[0]
    }

    /// Returns the tasks around a scope, the innermost first.
    pub(crate) fn tasks_around(&self, scope: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(self.scopes[scope].task), |task| self.tasks[*task].parent)
    }

    /// Returns the task around a node whose modes decide about it, or `None` if no task around it has modes.
    pub(crate) fn task_with_modes(&self, node: usize) -> Option<usize> {
        self.tasks_around(self.nodes[node].scope).find(|task| self.tasks[*task].has_modes)
    }

    /// Returns the policy of a task: its own section [policy], or that of the file around it.
    pub(crate) fn policy(&self, task: usize) -> PolicyTable {
        let around = std::iter::successors(Some(task), |task| self.tasks[*task].parent);
        let mut sections = around.filter_map(|task| self.tasks[task].policy.as_ref());
        sections.next().and_then(|(_, policy)| policy.clone()).unwrap_or_default()
    }

    /// Returns the node whose parameter a name `node.param` means, and the words behind the name of the node.
    pub(crate) fn param<'n>(&self, name: &'n str) -> Option<(usize, Vec<&'n str>)> {
        let rest = |node: &FlatNode| name.strip_prefix(&node.name)?.strip_prefix('.');
        let found = self.nodes.iter().enumerate().filter_map(|(index, node)| Some((index, rest(node)?)));
        found.min_by_key(|(_, rest)| rest.len()).map(|(index, rest)| (index, rest.split('.').collect()))
    }

    /// Sets numbers by the names of their parameters. Returns the first name that means nothing.
    pub(crate) fn set_live(&mut self, values: &[(String, f64)]) -> Result<(), String> {
        for (name, number) in values {
            let found = self.param(name);
            let value = found.and_then(|(node, path)| self.nodes[node].block.params.at_mut(&path));
            value.ok_or_else(|| name.clone())?.item = Item::Float(*number);
        }
        Ok(())
    }

    /// Returns the name of a role in the file of a task, or its name in the graph if that file does not declare it.
    pub(crate) fn role_in(&self, task: usize, role: usize) -> &str {
        let names = self.tasks[task].parent.map(|_| &self.scopes[self.tasks[task].scope].names);
        let mut names = names.into_iter().flatten();
        let own = names.find(|(_, (_, entity))| matches!(entity, Entity::Role(own) if *own == role));
        own.map_or(&self.roles[role].0.name, |(name, _)| name)
    }

    /// Returns the full name of a mode: `left.servo` of the task `left`.
    pub(crate) fn mode_name(&self, mode: usize) -> String {
        let ModeBlock { key, task, .. } = &self.modes[mode];
        format!("{}{}", self.tasks[*task].prefix, key.name)
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

    /// Returns the names of the modes of a task, in its own file.
    pub(crate) fn mode_names(&self, task: usize) -> impl Iterator<Item = &str> + Clone {
        self.modes.iter().filter(move |mode| mode.task == task).map(|mode| mode.key.name.as_str())
    }

    /// Returns the index of each mode of a task by its name there.
    pub(crate) fn mode_numbers(&self, task: usize) -> BTreeMap<&str, usize> {
        let own = self.modes.iter().enumerate().filter(|(_, mode)| mode.task == task);
        own.map(|(number, mode)| (mode.key.name.as_str(), number)).collect()
    }
}
