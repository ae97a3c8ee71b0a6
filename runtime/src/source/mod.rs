//! Source texts, the TOML values in them, and diagnostics.
//!
//! This is the lowest layer: it has no notion of graphs, nodes or devices.

mod diagnostic;
mod map;
mod named;
mod suggest;
mod value;

pub use diagnostic::{Code, Diagnostic, Diagnostics, Report, Severity};
pub use map::{BuiltinFile, Location, SourceFile, SourceMap};
pub(crate) use named::Named;
pub(crate) use suggest::quoted;
pub use suggest::{suggest_name, suggestion};
pub(crate) use value::FactRef;
pub use value::{Item, Key, Table, Value, parse_table};
