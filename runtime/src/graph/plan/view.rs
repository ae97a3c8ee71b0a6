//! What a run shows of its ports.

use super::port::PortRef;

/// What is shown of a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlannedView {
    pub(crate) ports: Vec<PlannedShow>,
    /// Where the contact is in the first image: its x and its y.
    pub(crate) mark: Option<[PortRef; 2]>,
}

/// A port that is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PlannedShow {
    /// As the graph file calls it.
    pub(crate) name: String,
    pub(crate) source: PortRef,
}
