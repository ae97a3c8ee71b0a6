//! What a pad measures: a value for each tactel.

/// A value for each tactel of a pad, row by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cells<T> {
    cells: Box<[T]>,
    cols: usize,
}

impl<T: Copy + Default> Cells<T> {
    /// Copies a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.cells.clone_from(&other.cells);
        self.cols = other.cols;
    }

    /// Creates an image of zeros.
    #[must_use]
    pub fn zeros(rows: usize, cols: usize) -> Self {
        Self { cells: vec![T::default(); rows * cols].into(), cols }
    }

    /// Creates an image with the values of `cells`, row by row.
    ///
    /// # Panics
    /// If the length of `cells` is not a multiple of `cols`.
    #[must_use]
    pub fn from_cells(cols: usize, cells: &[T]) -> Self {
        assert!(cols > 0 && cells.len().is_multiple_of(cols), "{} cells do not fill rows of {cols}", cells.len());
        Self { cells: cells.into(), cols }
    }

    /// Returns all values, row by row.
    #[must_use]
    pub fn cells(&self) -> &[T] {
        &self.cells
    }

    /// Returns all values for writing, row by row.
    pub fn cells_mut(&mut self) -> &mut [T] {
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
    pub fn row(&self, i: usize) -> &[T] {
        &self.cells[i * self.cols..(i + 1) * self.cols]
    }
}

impl Cells<f32> {
    /// Whether every value is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        are_finite(&self.cells)
    }
}

impl<const N: usize> Cells<[f32; N]> {
    /// Whether every value is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        are_finite(self.cells.as_flattened())
    }
}

/// Whether every value is finite. Checks the bits of the exponents, so that the loop vectorises.
fn are_finite(values: &[f32]) -> bool {
    const EXPONENT: u32 = 0x7f80_0000;
    const ONE: u32 = 1 << 23;
    // Only an exponent of all ones (infinity or NaN) carries into the sign bit.
    let carries = values.iter().fold(0, |carries, v| carries | ((v.to_bits() & EXPONENT) + ONE));
    carries >> 31 == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_that_is_not_finite_is_found_at_every_position() {
        for at in 0..12 {
            for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
                let (mut image, mut vectors) = (Cells::<f32>::zeros(3, 4), Cells::<[f32; 3]>::zeros(2, 2));
                assert!(image.is_finite() && vectors.is_finite());
                image.cells_mut()[at] = bad;
                vectors.cells_mut()[at / 3][at % 3] = bad;
                assert!(!image.is_finite() && !vectors.is_finite());
            }
        }
    }
}
