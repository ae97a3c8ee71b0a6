//! The ports that a run shows.

use super::port::PortRef;

/// The ports that a run shows.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlannedView {
    pub(crate) ports: Vec<PlannedShow>,
}

/// A port that is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct PlannedShow {
    /// Its name as written in the graph file.
    pub(crate) name: String,
    pub(crate) source: PortRef,
    /// Ports of the x and the y of the contact that is marked in it, if it is an image.
    pub(crate) mark: Option<[PortRef; 2]>,
}
