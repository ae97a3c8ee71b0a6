//! The path of a file that a parameter names.

use std::borrow::Cow;
use std::ops::Range;
use std::path::PathBuf;

/// The path of a file, relative to the file that names it, or `builtin:NAME` for a file of the catalogue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePath {
    /// The path.
    pub path: PathBuf,
    /// The place of its name in the source map.
    pub span: Range<usize>,
    /// The contents, if it is a file of the catalogue or of a recording.
    pub builtin: Option<Cow<'static, [u8]>>,
}
