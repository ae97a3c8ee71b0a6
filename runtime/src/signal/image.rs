//! A tactile image.

use super::unit::Unit;

/// What is known of an image at load.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ImageShape {
    /// Number of rows; row i runs along the sensor's y.
    pub rows: usize,
    /// Number of columns; column j runs along the sensor's x.
    pub cols: usize,
    /// Distance between the centres of two neighbours along x and along y [m].
    pub pitch: [f64; 2],
    /// Unit of a tactel's value.
    pub unit: Unit,
}

impl ImageShape {
    /// Number of tactels.
    #[must_use]
    pub const fn tactels(&self) -> usize {
        self.rows * self.cols
    }

    /// Place of column `j` along the sensor's x, counted from the middle of the pad [m].
    #[must_use]
    pub fn x(&self, j: f64) -> f64 {
        (j - (self.cols as f64 - 1.0) / 2.0) * self.pitch[0]
    }

    /// Place of row `i` along the sensor's y, counted from the middle of the pad [m].
    #[must_use]
    pub fn y(&self, i: f64) -> f64 {
        (i - (self.rows as f64 - 1.0) / 2.0) * self.pitch[1]
    }
}

/// One value per tactel, row after row. z points out of the pad toward the object.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Image {
    cells: Box<[f32]>,
    cols: usize,
}

impl Image {
    /// Takes over a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.cells.clone_from(&other.cells);
        self.cols = other.cols;
    }

    /// An image of zeros.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { cells: vec![0.0; rows * cols].into(), cols }
    }

    /// An image with the values of `cells`, row after row.
    ///
    /// # Panics
    /// If `cells` is not a whole number of rows.
    #[must_use]
    pub fn from_cells(cols: usize, cells: &[f32]) -> Self {
        assert!(cols > 0 && cells.len().is_multiple_of(cols), "{} cells are no rows of {cols}", cells.len());
        Self { cells: cells.into(), cols }
    }

    /// All values, row after row.
    #[must_use]
    pub fn cells(&self) -> &[f32] {
        &self.cells
    }

    /// All values, to be written.
    pub fn cells_mut(&mut self) -> &mut [f32] {
        &mut self.cells
    }

    /// Number of columns.
    #[must_use]
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.cells.len().checked_div(self.cols).unwrap_or(0)
    }

    /// The values of row `i`.
    #[must_use]
    pub fn row(&self, i: usize) -> &[f32] {
        &self.cells[i * self.cols..(i + 1) * self.cols]
    }

    /// Whether every value is finite: bits and no float sums, so that it vectorises.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        const EXPONENT: u32 = 0x7f80_0000;
        const ONE: u32 = 1 << 23;
        // An exponent of ones, and no other, carries into the sign.
        let carries = self.cells.iter().fold(0, |carries, v| carries | ((v.to_bits() & EXPONENT) + ONE));
        carries >> 31 == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_bad_cell_is_seen_wherever_it_is() {
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
    fn the_middle_of_the_pad_is_the_origin() {
        let shape = ImageShape { rows: 16, cols: 4, pitch: [0.01, 0.005], unit: Unit::NEWTON };
        assert!((shape.x(0.0) + 0.015).abs() < 1e-15 && (shape.x(3.0) - 0.015).abs() < 1e-15);
        assert!((shape.y(7.5)).abs() < 1e-15);
    }
}
