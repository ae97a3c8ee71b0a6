//! Calibration of a pad and of what carries it: the curves of its tactels, its mount on the arm, and the weight of the
//! tool.
//!
//! From a log of presses with a reference force to a curve for each tactel: [`log`] is the input, [`samples`] finds which tactel bore which force, [`fit`] fits its [`curve`], [`file`] writes
//! and reads the curves, [`report`] measures how good they are and [`plot`] draws it.
//!
//! From still postures of an arm: [`pad_mount`] is where the pad is on the tip, from one point that was touched in
//! several postures, and [`tool_weight`] is the mass and the centre of mass of the tool, from the wrenches of a force
//! sensor.
//!
//! None of this runs in a graph: there the node `calibrate` reads the file, and the bench holds the numbers.

pub mod curve;
pub mod file;
pub mod fit;
pub mod log;
pub mod pad_mount;
#[cfg(feature = "cli")]
pub mod plot;
pub mod report;
pub mod samples;
pub mod tool_weight;

use tactflow_runtime::signal::Unit;

pub use curve::{CurveKind, ForceCurve, Tactel};

/// The curves of all tactels of an array.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// Kind of all curves.
    pub kind: CurveKind,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Unit of the readings.
    pub reading: Unit,
    /// Unit of the forces.
    pub unit: Unit,
    /// The tactels row by row; `None` for a dead one.
    pub tactels: Vec<Option<Tactel>>,
}

#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
