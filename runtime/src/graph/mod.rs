//! A graph: text in, plan or all mistakes out. Pure, but for the files it reads.

mod sources;
mod value;

pub use sources::{SourceFile, Sources};
pub use value::{Item, Key, Table, Value, parse_table};
