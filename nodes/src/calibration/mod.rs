//! Calibration of a pad: from a log of presses with a reference force to a curve for each tactel.
//!
//! [`log`] is what is read, [`samples`] says which tactel bore which force, [`fit`] finds its [`curve`], [`file`] writes
//! and reads them, [`report`] says how good they are and [`plot`] draws them, as Fig. 1 of the paper does. Nothing of
//! this runs in a graph: there the node `calibrate` takes the file.

pub mod curve;
pub mod file;
pub mod fit;
pub mod log;
pub mod plot;
pub mod report;
pub mod samples;

use tactflow_runtime::signal::Unit;

pub use curve::{Curve, Kind, Tactel};

/// The curves of all tactels of an array.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Sort of all curves.
    pub kind: Kind,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Unit of what the sensor reads.
    pub reading: Unit,
    /// Unit of what comes out.
    pub unit: Unit,
    /// The tactels, row after row; none where one is dead.
    pub tactels: Vec<Option<Tactel>>,
}

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
