//! What a run leaves behind: a row a tick, a column a scalar.

mod columns;
mod recorder;
mod writer;

pub use columns::{Column, Columns, recorded};
pub use recorder::Recorder;
pub use writer::Format;
