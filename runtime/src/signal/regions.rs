//! The connected regions of a mask, as runs of tactels.

use super::mask::Grid;
use super::unit::Unit;

/// What is known of a list of regions at load.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RegionsShape {
    /// The array they lie on.
    pub grid: Grid,
    /// Unit of a region's force.
    pub unit: Unit,
}

/// A run of neighbouring tactels in one row: columns `start..end` of `row`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Run {
    /// Row of the run.
    pub row: u16,
    /// First column.
    pub start: u16,
    /// First column past the run.
    pub end: u16,
    /// Index of the run's region in the list.
    pub region: u16,
}

/// One connected region.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Region {
    /// Number of tactels, |R|.
    pub area: u32,
    /// Sum of the tactels' values, f.
    pub force: f64,
}

/// Connected regions in the order in which their first tactels stand in raster order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Regions {
    runs: Vec<Run>,
    regions: Vec<Region>,
}

impl Regions {
    /// Takes over a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.runs.clone_from(&other.runs);
        self.regions.clone_from(&other.regions);
    }

    /// An empty list with room for every region that an array of `rows` by `cols` can have.
    #[must_use]
    pub fn with_room(rows: usize, cols: usize) -> Self {
        let most = rows * cols.div_ceil(2);
        Self { runs: Vec::with_capacity(most), regions: Vec::with_capacity(most) }
    }

    /// The regions.
    #[must_use]
    pub fn list(&self) -> &[Region] {
        &self.regions
    }

    /// The runs of all regions, in raster order.
    #[must_use]
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// Both lists, to be filled within the room they have.
    pub fn parts_mut(&mut self) -> (&mut Vec<Run>, &mut Vec<Region>) {
        (&mut self.runs, &mut self.regions)
    }
}
