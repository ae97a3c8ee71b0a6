//! The order of the cells: from their places in a frame to their places in the image.

use tactflow_runtime::node::Param;

/// A turn of the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum Turn {
    /// Exchanges rows and columns: the first row becomes the first column.
    Transpose,
    /// Reverses each row: the first column becomes the last one.
    FlipX,
    /// Reverses each column: the first row becomes the last one.
    FlipY,
    /// Turns by 90 degrees clockwise, with the first row on top: the first row becomes the last column.
    Rot90,
}

#[cfg(feature = "cli")]
impl Turn {
    /// All turns.
    pub(crate) const ALL: [Self; 4] = [Self::FlipX, Self::FlipY, Self::Transpose, Self::Rot90];

    /// Returns the word of a description for it.
    pub(crate) const fn word(self) -> &'static str {
        Self::CONTENTS.words[self as usize].0
    }
}

/// A grid of indices into the cells of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Grid {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    /// For each cell of the image, row after row, its index in the frame.
    pub(crate) places: Vec<usize>,
}

impl Grid {
    /// The cells in the order of the frame, row after row.
    pub(crate) fn new(rows: usize, cols: usize) -> Self {
        Self { rows, cols, places: (0..rows * cols).collect() }
    }

    /// The cells in the order of a table: cell `i` of the image is cell `lut[i]` of the frame.
    ///
    /// # Errors
    /// Which index is missing, and which is there twice.
    pub(crate) fn with_lut(rows: usize, cols: usize, lut: &[usize]) -> Result<Self, String> {
        let count = rows * cols;
        if lut.len() != count {
            return Err(format!("`lut` has {} indices, and {rows} by {cols} cells need {count}", lut.len()));
        }
        if let Some(beyond) = lut.iter().find(|index| **index >= count) {
            return Err(format!("`lut` has the index {beyond}, and the last cell is {}", count - 1));
        }
        let mut uses = vec![0_usize; count];
        lut.iter().for_each(|index| uses[*index] += 1);
        if let Some(twice) = uses.iter().position(|uses| *uses > 1) {
            let missing = uses.iter().position(|uses| *uses == 0).unwrap_or_default();
            return Err(format!("`lut` has the index {twice} twice, and the index {missing} is missing"));
        }
        Ok(Self { rows, cols, places: lut.to_vec() })
    }

    /// Returns the grid after a turn.
    pub(crate) fn turned(self, turn: Turn) -> Self {
        let Self { rows, cols, ref places } = self;
        let (new_rows, new_cols) = match turn {
            Turn::Transpose | Turn::Rot90 => (cols, rows),
            Turn::FlipX | Turn::FlipY => (rows, cols),
        };
        let source = |i: usize, j: usize| match turn {
            Turn::Transpose => (j, i),
            Turn::FlipX => (i, cols - 1 - j),
            Turn::FlipY => (rows - 1 - i, j),
            Turn::Rot90 => (rows - 1 - j, i),
        };
        let place = |index: usize| {
            let (i, j) = source(index / new_cols, index % new_cols);
            places[i * cols + j]
        };
        Self { rows: new_rows, cols: new_cols, places: (0..rows * cols).map(place).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turns_of_two_rows() {
        // 0 1 2
        // 3 4 5
        let cases = [
            (Turn::Transpose, (3, 2), [0, 3, 1, 4, 2, 5]),
            (Turn::FlipX, (2, 3), [2, 1, 0, 5, 4, 3]),
            (Turn::FlipY, (2, 3), [3, 4, 5, 0, 1, 2]),
            (Turn::Rot90, (3, 2), [3, 0, 4, 1, 5, 2]),
        ];
        for (turn, size, expected) in cases {
            let grid = Grid::new(2, 3).turned(turn);
            assert_eq!(((grid.rows, grid.cols), &*grid.places), (size, &expected[..]), "{turn:?}");
        }
        let mut whole = Grid::new(2, 3);
        for _ in 0..4 {
            whole = whole.turned(Turn::Rot90);
        }
        assert_eq!(whole, Grid::new(2, 3));
        let rotated = Grid::new(2, 3).turned(Turn::Transpose).turned(Turn::FlipX);
        assert_eq!(rotated, Grid::new(2, 3).turned(Turn::Rot90));
    }

    #[test]
    fn a_table_is_a_bijection_or_its_mistake_is_named() {
        assert_eq!(Grid::with_lut(1, 3, &[2, 0, 1]).unwrap().places, [2, 0, 1]);
        let cases = [
            (&[0, 1][..], "`lut` has 2 indices, and 1 by 3 cells need 3"),
            (&[0, 1, 3], "`lut` has the index 3, and the last cell is 2"),
            (&[0, 2, 2], "`lut` has the index 2 twice, and the index 1 is missing"),
        ];
        for (lut, expected) in cases {
            assert_eq!(Grid::with_lut(1, 3, lut).unwrap_err(), expected);
        }
    }
}
