//! From files to one flat graph: parts are put in place, `--set` and overrides are merged.

mod flat;
mod loader;

pub(crate) use flat::{Entity, FlatGraph, FlatNode, Scope};
pub use loader::Request;
pub(crate) use loader::{Loader, other_file};
