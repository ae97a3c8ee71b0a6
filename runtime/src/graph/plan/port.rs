//! The ports of a graph: references to them, and their shapes and frames.

use crate::signal::Shape;

/// The source of a wire: a role, a node or the modes of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Producer {
    /// A role, by its index in the graph file.
    Role(usize),
    /// A node, by its index in the flat graph.
    Node(usize),
    /// The modes of a task, by its index: a flag for each.
    Task(usize),
}

impl Producer {
    /// Returns the index of the node, or `None` for another producer.
    pub(crate) const fn node(self) -> Option<usize> {
        match self {
            Self::Node(node) => Some(node),
            Self::Role(_) | Self::Task(_) => None,
        }
    }
}

/// A reference to one output of a producer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct PortRef {
    pub(crate) producer: Producer,
    pub(crate) port: usize,
}

/// A port with its name, shape and frames.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPort {
    /// Its full name: `node.port`.
    pub name: String,
    /// Its shape, with units.
    pub shape: Shape,
    /// Its frames, `None` where the wires do not determine one.
    pub frames: Vec<Option<String>>,
}
