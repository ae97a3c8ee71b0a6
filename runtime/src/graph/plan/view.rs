//! The ports that a run shows.

use super::port::PortRef;

/// The ports that a run shows.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlannedView {
    pub(crate) ports: Vec<PlannedShow>,
    /// Ports of the x and the y of the contact, marked in the first image.
    pub(crate) mark: Option<[PortRef; 2]>,
}

/// A port that is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PlannedShow {
    /// Its name as written in the graph file.
    pub(crate) name: String,
    pub(crate) source: PortRef,
}
