//! The parameters of a node or a device in a test.

use std::path::Path;

use crate::node::{Mistakes, Reader};
use crate::source::{SourceMap, Value, parse_table};

/// Creates a node or a device from the parameters of a TOML text.
///
/// # Errors
/// The mistakes in the parameters.
///
/// # Panics
/// If the text is not TOML.
pub(super) fn with_params<T>(
    text: &str,
    make: impl FnOnce(&Value, &mut Reader<'_>) -> Option<T>,
) -> Result<T, Mistakes> {
    let mut sources = SourceMap::default();
    let table = parse_table(sources.add_file(Path::new("test.toml"), text));
    let table = table.unwrap_or_else(|error| panic!("{error:?}"));
    let mut reader = Reader::new(&sources);
    let made = make(&table, &mut reader);
    made.filter(|_| reader.mistakes.is_empty()).ok_or(reader.mistakes)
}
