//! The path of a file that a parameter names.

use std::ops::Range;
use std::path::PathBuf;

/// A file, named relative to the file it stands in; or `builtin:NAME`, one that the catalogue brings along.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePath {
    /// Where it is.
    pub path: PathBuf,
    /// Where its name stands.
    pub span: Range<usize>,
    /// Its bytes, if it is one that the catalogue brings along.
    pub builtin: Option<&'static [u8]>,
}
