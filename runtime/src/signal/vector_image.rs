//! Images of a pad with three axes.

use serde::{Deserialize, Serialize};

use super::image::ImageShape;

/// The shape of a vector image: that of the image of one of its axes.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct VectorImageShape(pub ImageShape);

/// A vector image: `[x, y, z]` for each tactel, row by row.
///
/// x and y are the force with which the object drags the tactel along the axes of the sensor. z is the force with which
/// the object presses the tactel, positive as in an [`Image`](super::Image).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct VectorImage {
    cells: Box<[[f32; 3]]>,
    cols: usize,
}

impl VectorImage {
    /// Copies a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.cells.clone_from(&other.cells);
        self.cols = other.cols;
    }

    /// Creates an image of zeros.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { cells: vec![[0.0; 3]; rows * cols].into(), cols }
    }

    /// Returns all values, row by row.
    #[must_use]
    pub fn cells(&self) -> &[[f32; 3]] {
        &self.cells
    }

    /// Returns all values for writing, row by row.
    pub fn cells_mut(&mut self) -> &mut [[f32; 3]] {
        &mut self.cells
    }

    /// Returns the number of columns.
    #[must_use]
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.cells.len().checked_div(self.cols).unwrap_or(0)
    }

    /// Whether every value is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.cells.iter().flatten().all(|value| value.is_finite())
    }
}
