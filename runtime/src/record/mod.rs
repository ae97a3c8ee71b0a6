//! Recordings of runs: one row per tick with one column per scalar, and the points of a surface.

mod columns;
#[cfg(feature = "cli")]
mod points;
mod recorder;
mod writer;

pub use columns::{PortColumn, PortColumns, recorded};
#[cfg(feature = "cli")]
pub use points::{PointPorts, PointRecorder, PointsRequest};
pub use recorder::Recorder;
pub use writer::RecordFormat;
