//! The noise-free image from the forces on the points: the foam spreads a load over several tactels.
//!
//! The force on each point is distributed by a Gaussian of the foam's spread, integrated over each tactel. So a probe
//! between two tactels is felt by both. At the rim of the pad the weights are normalised to sum to 1, so that no load
//! is lost.

use tactflow_runtime::signal::ImageShape;

use super::contact::Touch;

/// The load of a point along one axis: the first tactel that it loads, and the weights of the tactels from there on.
type Band = (usize, Vec<f64>);

/// Returns the bands of all points along one axis.
fn bands(tactels: usize, fine: usize, pitch: f64, spread: f64) -> Vec<Band> {
    let reach = (4.0 * spread / pitch).ceil() as usize;
    let band = |point: usize| {
        let tactel = point / fine;
        let (first, last) = (tactel.saturating_sub(reach), (tactel + reach + 1).min(tactels));
        // In tactels, from the rim of the pad.
        let at = (point as f64 + 0.5) / fine as f64;
        let gauss = |edge: usize| libm::erf((edge as f64 - at) * pitch / (spread * std::f64::consts::SQRT_2));
        let mut weights: Vec<f64> = (first..last).map(|tactel| gauss(tactel + 1) - gauss(tactel)).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        (first, weights)
    };
    (0..tactels * fine).map(band).collect()
}

/// The image that the loads leave on the tactels.
pub struct Imprint {
    along_x: Vec<Band>,
    along_y: Vec<Band>,
    cols: usize,
    /// Loads of one row of points, spread along x.
    row: Vec<f64>,
    /// Force on each tactel at the last [`Imprint::take`] [N].
    pub(super) forces: Vec<f64>,
}

impl Imprint {
    /// Returns an empty imprint for a pad with `fine` points along a side of a tactel, and a `spread` [m].
    #[must_use]
    pub fn new(shape: &ImageShape, fine: usize, spread: f64) -> Self {
        Self {
            along_x: bands(shape.cols, fine, shape.pitch[0], spread),
            along_y: bands(shape.rows, fine, shape.pitch[1], spread),
            cols: shape.cols,
            row: vec![0.0; shape.cols],
            forces: vec![0.0; shape.tactels()],
        }
    }

    /// Computes the forces on the tactels from points in raster order.
    pub fn take(&mut self, touching: &[Touch]) {
        self.forces.fill(0.0);
        for line in touching.chunk_by(|a, b| a.point[0] == b.point[0]) {
            self.row.fill(0.0);
            for touch in line {
                let (first, weights) = &self.along_x[touch.point[1]];
                let cells = self.row[*first..].iter_mut().zip(weights);
                cells.for_each(|(cell, weight)| *cell += weight * touch.force);
            }
            let (first, weights) = &self.along_y[line[0].point[0]];
            for (row, weight) in self.forces[first * self.cols..].chunks_exact_mut(self.cols).zip(weights) {
                row.iter_mut().zip(&self.row).for_each(|(cell, load)| *cell += weight * load);
            }
        }
    }
}
