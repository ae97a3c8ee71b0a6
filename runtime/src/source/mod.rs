//! Source texts, the TOML values in them, and diagnostics.
//!
//! This is the lowest layer: it has no notion of graphs, nodes or devices.

mod attach;
mod diagnostic;
mod fix;
mod map;
mod named;
mod report;
mod suggest;
mod syntax;
mod value;

pub use diagnostic::{Code, Diagnostic, Diagnostics, Severity};
pub use fix::Edit;
pub use map::{AttachedFiles, BuiltinFile, Location, SourceFile, SourceMap, UnknownBuiltin};
pub(crate) use named::Named;
pub use report::Report;
pub use suggest::{did_you_mean, quoted, suggest_name, suggest_path, suggestion};
pub use syntax::parse_table;
pub(crate) use value::{FactRef, Meant};
pub use value::{Item, Key, Table, Value};
