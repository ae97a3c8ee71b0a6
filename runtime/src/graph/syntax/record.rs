//! The section `[record]`: what a recording of a whole run contains.

use super::sections::Sections;
use crate::node::{Param, Spanned};
use crate::source::Table;

/// The section `[record]`.
#[derive(Debug, Clone, Param)]
pub(crate) struct RecordTable {
    /// Patterns of the names of the recorded ports: `*` stands for any text. All ports without it.
    pub(crate) ports: Option<Vec<Spanned<String>>>,
    /// Whether images and masks are recorded.
    #[param(default = true)]
    pub(crate) images: bool,
    /// Size at which another file is begun.
    #[param(unit = "byte", range = 1e6..)]
    pub(crate) max_size: Option<f64>,
}

impl Sections<'_> {
    /// Reads the section [record] of a graph.
    pub(crate) fn record(&mut self, root: &Table) -> Option<RecordTable> {
        root.get("record").and_then(|value| RecordTable::read(value, &mut self.reader))
    }
}
