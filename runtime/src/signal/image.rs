//! Tactile images.

use serde::{Deserialize, Serialize};

use super::cells::Cells;
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
pub type Image = Cells<f32>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_of_the_pad_is_the_origin() {
        let shape = ImageShape { rows: 16, cols: 4, pitch: [0.01, 0.005], unit: Unit::NEWTON };
        assert!((shape.x(0.0) + 0.015).abs() < 1e-15 && (shape.x(3.0) - 0.015).abs() < 1e-15);
        assert!((shape.y(7.5)).abs() < 1e-15);
    }
}
