//! The section `[limits]` of a task, a bench or a robot, before names are resolved.

use std::ops::Range;

use super::read::read_table;
use super::reserved::LIMITS;
use crate::node::Reader;
use crate::source::{Item, Key, Table, Value};

/// Who states a section `[limits]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum LimitOwner {
    Task,
    Bench,
    /// The robot of the device with this name.
    Robot(String),
    CommandLine,
}

impl LimitOwner {
    /// Returns the noun for a message.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Self::Task => "the task",
            Self::Bench => "the bench",
            Self::Robot(_) => "the robot",
            Self::CommandLine => "`--set`",
        }
    }
}

/// The limits of one section: of all arms, or of those that it names.
#[derive(Debug, Clone)]
pub(crate) struct LimitSection {
    pub(crate) owner: LimitOwner,
    /// The place of its header.
    pub(crate) span: Range<usize>,
    /// The limits: numbers, lists of numbers, or either with a unit.
    pub(crate) table: Table,
    /// The role in `[limits.ROLE]`.
    pub(crate) role: Option<Key>,
    /// The task that states it, if a task does.
    pub(crate) task: usize,
}

impl LimitSection {
    /// Returns whether the task or the command line states it, and not the cell or a robot.
    pub(crate) fn is_of_task(&self) -> bool {
        matches!(self.owner, LimitOwner::Task | LimitOwner::CommandLine)
    }

    /// Returns whether a key is one of its limits.
    pub(crate) fn has(&self, key: &Key) -> bool {
        self.table.entries.iter().any(|(own, _)| own.span == key.span)
    }
}

/// Reads the section `[limits]` of a file, and its tables `[limits.ROLE]`.
pub(crate) fn read_limits(root: &Table, owner: &LimitOwner, reader: &mut Reader<'_>) -> Vec<LimitSection> {
    let Some((header, value)) = root.entry(LIMITS) else { return Vec::new() };
    let table = read_table(Some(value), reader);
    let is_role = |(_, value): &(Key, Value)| matches!(&value.item, Item::Table(table) if table.fact().is_none());
    let (roles, own): (Vec<_>, Vec<_>) = table.entries.into_iter().partition(is_role);
    let section = |span: Range<usize>, table: Table, role: Option<Key>| LimitSection {
        owner: owner.clone(),
        span,
        table,
        role,
        task: 0,
    };
    let of_role = |(key, value): (Key, Value)| match value.item {
        Item::Table(table) => Some(section(key.span.clone(), table, Some(key))),
        _ => None,
    };
    let mut sections = vec![section(header.span.clone(), Table { entries: own }, None)];
    sections.extend(roles.into_iter().filter_map(of_role));
    sections
}
