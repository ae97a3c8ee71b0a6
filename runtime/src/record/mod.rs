//! Recordings of runs: one row per tick with one column per scalar, and the points of a surface.

mod columns;
mod output;
#[cfg(feature = "cli")]
mod points;
mod recorder;
#[cfg(any(feature = "mcap", all(feature = "cli", unix)))]
mod ring;
#[cfg(feature = "cli")]
mod rows;
mod writer;

pub use columns::{PortColumn, PortColumns, recorded};
pub use output::{OutputFile, write_whole};
#[cfg(feature = "mcap")]
pub(crate) use output::{Writing, not_read};
#[cfg(feature = "cli")]
pub use points::{PointPorts, PointRecorder, PointsRequest};
#[cfg(feature = "mcap")]
pub(crate) use recorder::mode_line;
pub use recorder::{Recorded, Recorder};
#[cfg(any(feature = "mcap", all(feature = "cli", unix)))]
pub(crate) use ring::touched_ring;
#[cfg(feature = "cli")]
pub use rows::{RunColumn, RunRows, TaskModes};
pub use writer::{RecordFormat, RowFormat};
#[cfg(any(feature = "mcap", all(feature = "cli", unix)))]
pub(crate) use writer::{seconds as file_seconds, time_text as seconds_text};
