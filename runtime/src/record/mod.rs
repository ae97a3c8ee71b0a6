//! What a run leaves behind: a row a tick, a column a scalar; and the points of a surface.

mod columns;
#[cfg(feature = "cli")]
mod points;
mod recorder;
mod writer;

pub use columns::{Column, Columns, recorded};
#[cfg(feature = "cli")]
pub use points::{Chosen, Points, Wanted};
pub use recorder::Recorder;
pub use writer::Format;
