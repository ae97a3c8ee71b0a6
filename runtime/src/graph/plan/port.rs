//! The ports of a graph: which role or node owns one, and what is known of it.

use crate::signal::Shape;

/// What a wire can come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Producer {
    /// A role, by its index in the graph file.
    Role(usize),
    /// A node, by its index in the flat graph.
    Node(usize),
}

impl Producer {
    /// The index of the node, or `None` for a role.
    pub(crate) const fn node(self) -> Option<usize> {
        match self {
            Self::Node(node) => Some(node),
            Self::Role(_) => None,
        }
    }
}

/// One output of a role or a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct PortRef {
    pub(crate) producer: Producer,
    pub(crate) port: usize,
}

/// A port with everything that is known of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPort {
    /// Its name: `node.port`.
    pub name: String,
    /// Its shape, units filled in.
    pub shape: Shape,
    /// Its frames, where the wires tell them.
    pub frames: Vec<Option<String>>,
}
