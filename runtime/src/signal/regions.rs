//! The connected regions of a mask, as runs of tactels.

use serde::{Deserialize, Serialize};

use super::mask::Grid;
use super::unit::Unit;

/// The shape of a list of regions.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RegionsShape {
    /// The array of tactels.
    pub grid: Grid,
    /// Unit of a region's force.
    pub unit: Unit,
}

/// A run of neighbouring tactels in one row: columns `start..end` of `row`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Run {
    /// Row.
    pub row: u16,
    /// First column.
    pub start: u16,
    /// Column after the last.
    pub end: u16,
    /// Index of the run's region in the list.
    pub region: u16,
}

/// One connected region.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Region {
    /// Number of tactels, |R| in the paper.
    pub area: u32,
    /// Sum of the tactel values, f in the paper [unit of the image].
    pub force: f64,
}

/// Connected regions, in the raster order of their first tactels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Regions {
    runs: Vec<Run>,
    regions: Vec<Region>,
}

impl Regions {
    /// Copies a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.runs.clone_from(&other.runs);
        self.regions.clone_from(&other.regions);
    }

    /// Creates an empty list with the capacity for every set of regions in an array of `rows` by `cols`.
    #[must_use]
    pub fn with_room(rows: usize, cols: usize) -> Self {
        let max_runs = rows * cols.div_ceil(2);
        Self { runs: Vec::with_capacity(max_runs), regions: Vec::with_capacity(max_runs) }
    }

    /// Returns the regions.
    #[must_use]
    pub fn list(&self) -> &[Region] {
        &self.regions
    }

    /// Returns the runs of all regions, in raster order.
    #[must_use]
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Returns both lists for writing. Do not exceed their capacity: a step must not allocate.
    pub fn parts_mut(&mut self) -> (&mut Vec<Run>, &mut Vec<Region>) {
        (&mut self.runs, &mut self.regions)
    }
}
