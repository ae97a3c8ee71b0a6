//! Texts, the values in them, and what is wrong with them.
//!
//! The ground floor: it knows TOML, places and messages, and nothing of graphs or nodes.

mod diagnostic;
mod map;
mod suggest;
mod value;

pub use diagnostic::{Code, Diagnostic, Report, Severity};
pub use map::{BuiltinFile, Location, SourceFile, SourceMap};
pub use suggest::{closest, meant};
pub use value::{Item, Key, Table, Value, parse_table};
