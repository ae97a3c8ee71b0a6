//! Binary images with one bit per tactel.

use serde::{Deserialize, Serialize};

use super::image::ImageShape;

/// The size and pitch of an array of tactels.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Grid {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    /// Distance between the centres of neighbouring tactels along x and along y [m].
    pub pitch: [f64; 2],
}

impl From<&ImageShape> for Grid {
    fn from(shape: &ImageShape) -> Self {
        Self { rows: shape.rows, cols: shape.cols, pitch: shape.pitch }
    }
}

/// A set of tactels: bit j of word j/64 in row i. Bits past the last column are zero.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Mask {
    words: Box<[u64]>,
    cols: usize,
    stride: usize,
}

impl Mask {
    /// Copies a value of the same shape, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.words.clone_from(&other.words);
        (self.cols, self.stride) = (other.cols, other.stride);
    }

    /// Creates the empty set of an array of `rows` by `cols`.
    #[must_use]
    pub fn empty(rows: usize, cols: usize) -> Self {
        let stride = cols.div_ceil(64);
        Self { words: vec![0; rows * stride].into(), cols, stride }
    }

    /// Returns the number of columns.
    #[must_use]
    pub const fn cols(&self) -> usize {
        self.cols
    }

    /// Returns the number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.words.len().checked_div(self.stride).unwrap_or(0)
    }

    /// Returns the number of 64-bit words per row.
    #[must_use]
    pub const fn stride(&self) -> usize {
        self.stride
    }

    /// Returns all words, row by row.
    #[must_use]
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Returns all words for writing. Bits past the last column must stay zero.
    pub fn words_mut(&mut self) -> &mut [u64] {
        &mut self.words
    }

    /// Returns the words of row `i`.
    #[must_use]
    pub fn row(&self, i: usize) -> &[u64] {
        &self.words[i * self.stride..(i + 1) * self.stride]
    }

    /// Whether tactel (i, j) is in the set.
    #[must_use]
    pub fn contains(&self, i: usize, j: usize) -> bool {
        j < self.cols && self.row(i)[j / 64] >> (j % 64) & 1 == 1
    }

    /// Adds tactel (i, j) to the set.
    pub fn insert(&mut self, i: usize, j: usize) {
        debug_assert!(j < self.cols, "column {j} of {}", self.cols);
        self.words[i * self.stride + j / 64] |= 1 << (j % 64);
    }

    /// Removes every tactel.
    pub fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Returns the number of tactels in the set.
    #[must_use]
    pub fn count(&self) -> usize {
        self.words.iter().map(|word| word.count_ones() as usize).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mask_wider_than_a_word_keeps_its_rows_apart() {
        let mut mask = Mask::empty(3, 130);
        mask.insert(1, 129);
        mask.insert(2, 0);
        assert_eq!((mask.rows(), mask.stride(), mask.count()), (3, 3, 2));
        assert!(mask.contains(1, 129) && mask.contains(2, 0) && !mask.contains(1, 128));
        mask.clear();
        assert_eq!(mask.count(), 0);
    }
}
