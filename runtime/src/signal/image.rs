//! Tactile images.

use serde::{Deserialize, Serialize};

use super::unit::Unit;

/// The shape of an image.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ImageShape {
    /// Number of rows; row i runs along the sensor's y.
    pub rows: usize,
    /// Number of columns; column j runs along the sensor's x.
    pub cols: usize,
    /// Distance between the centres of neighbouring tactels along x and along y [m].
    pub pitch: [f64; 2],
    /// Unit of the tactel values.
    pub unit: Unit,
}

impl ImageShape {
    /// Returns the number of tactels.
    #[must_use]
    pub const fn tactels(&self) -> usize {
        self.rows * self.cols
    }

    /// Returns half of the width and of the height of the pad [m].
    #[must_use]
    pub fn half(&self) -> [f64; 2] {
        [self.cols as f64 * self.pitch[0] / 2.0, self.rows as f64 * self.pitch[1] / 2.0]
    }

    /// Returns the x coordinate of column `j` from the centre of the pad [m].
    #[must_use]
    pub fn x(&self, j: f64) -> f64 {
        (j - (self.cols as f64 - 1.0) / 2.0) * self.pitch[0]
    }

    /// Returns the y coordinate of row `i` from the centre of the pad [m].
    #[must_use]
    pub fn y(&self, i: f64) -> f64 {
        (i - (self.rows as f64 - 1.0) / 2.0) * self.pitch[1]
    }
}

/// A tactile image: one value per tactel, row by row. z points out of the pad toward the object.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Image {
    cells: Box<[f32]>,
    cols: usize,
}

impl Image {
    /// Copies a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.cells.clone_from(&other.cells);
        self.cols = other.cols;
    }

    /// Creates an image of zeros.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { cells: vec![0.0; rows * cols].into(), cols }
    }

    /// Creates an image with the values of `cells`, row by row.
    ///
    /// # Panics
    /// If the length of `cells` is not a multiple of `cols`.
    #[must_use]
    pub fn from_cells(cols: usize, cells: &[f32]) -> Self {
        assert!(cols > 0 && cells.len().is_multiple_of(cols), "{} cells do not fill rows of {cols}", cells.len());
        Self { cells: cells.into(), cols }
    }

    /// Returns all values, row by row.
    #[must_use]
    pub fn cells(&self) -> &[f32] {
        &self.cells
    }

    /// Returns all values for writing, row by row.
    pub fn cells_mut(&mut self) -> &mut [f32] {
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

    /// Returns the values of row `i`.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f32] {
        &self.cells[i * self.cols..(i + 1) * self.cols]
    }

    /// Whether every value is finite. Checks the bits of the exponents, so that the loop vectorises.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        const EXPONENT: u32 = 0x7f80_0000;
        const ONE: u32 = 1 << 23;
        // Only an exponent of all ones (infinity or NaN) carries into the sign bit.
        let carries = self.cells.iter().fold(0, |carries, v| carries | ((v.to_bits() & EXPONENT) + ONE));
        carries >> 31 == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_cell_that_is_not_finite_is_found_at_every_position() {
        for at in 0..12 {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let mut image = Image::zeros(3, 4);
                assert!(image.is_finite());
                image.cells_mut()[at] = bad;
                assert!(!image.is_finite());
            }
        }
    }

    #[test]
    fn the_centre_of_the_pad_is_the_origin() {
        let shape = ImageShape { rows: 16, cols: 4, pitch: [0.01, 0.005], unit: Unit::NEWTON };
        assert!((shape.x(0.0) + 0.015).abs() < 1e-15 && (shape.x(3.0) - 0.015).abs() < 1e-15);
        assert!((shape.y(7.5)).abs() < 1e-15);
    }
}
