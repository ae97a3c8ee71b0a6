//! From the forces on the points to the clean image: the foam spreads a load over its neighbours.
//!
//! Each point's force is shared out among the tactels by a bell of the foam's spread, integrated over each tactel, so a
//! probe between two tactels is felt by both. At the pad's rim, where the bell would reach over, the shares are scaled to
//! sum to 1: the foam ends there, and the load does not.

use tactflow_runtime::signal::ImageShape;

use super::contact::Touch;

/// Shares of the loads along one axis.
struct Shares {
    /// First tactel that each point reaches, and its share of each from there on.
    bands: Vec<(usize, Vec<f64>)>,
}

impl Shares {
    fn new(tactels: usize, fine: usize, pitch: f64, spread: f64) -> Self {
        let reach = (4.0 * spread / pitch).ceil() as usize;
        let band = |point: usize| {
            let tactel = point / fine;
            let (first, last) = (tactel.saturating_sub(reach), (tactel + reach + 1).min(tactels));
            // In tactels, from the pad's rim.
            let at = (point as f64 + 0.5) / fine as f64;
            let bell = |edge: usize| libm::erf((edge as f64 - at) * pitch / (spread * std::f64::consts::SQRT_2));
            let mut shares: Vec<f64> = (first..last).map(|tactel| bell(tactel + 1) - bell(tactel)).collect();
            let sum: f64 = shares.iter().sum();
            shares.iter_mut().for_each(|share| *share /= sum);
            (first, shares)
        };
        Self { bands: (0..tactels * fine).map(band).collect() }
    }
}

/// How the foam spreads loads.
pub struct Imprint {
    along_x: Shares,
    along_y: Shares,
    cols: usize,
    /// One row of points, spread along x.
    row: Vec<f64>,
    image: Vec<f64>,
}

impl Imprint {
    /// For a pad with `fine` points along a side of a tactel, and a spread [m].
    #[must_use]
    pub fn new(shape: &ImageShape, fine: usize, spread: f64) -> Self {
        Self {
            along_x: Shares::new(shape.cols, fine, shape.pitch[0], spread),
            along_y: Shares::new(shape.rows, fine, shape.pitch[1], spread),
            cols: shape.cols,
            row: vec![0.0; shape.cols],
            image: vec![0.0; shape.tactels()],
        }
    }

    /// The force on each tactel, as it was last taken [N].
    #[must_use]
    pub fn forces(&self) -> &[f64] {
        &self.image
    }

    /// Takes the imprint of these points, sorted by their rows.
    pub fn take(&mut self, touching: &[Touch]) {
        self.image.fill(0.0);
        for line in touching.chunk_by(|a, b| a.point[0] == b.point[0]) {
            self.row.fill(0.0);
            for touch in line {
                let (first, shares) = &self.along_x.bands[touch.point[1]];
                let cells = self.row[*first..].iter_mut().zip(shares);
                cells.for_each(|(cell, share)| *cell += share * touch.force);
            }
            let (first, shares) = &self.along_y.bands[line[0].point[0]];
            for (row, share) in self.image[first * self.cols..].chunks_exact_mut(self.cols).zip(shares) {
                row.iter_mut().zip(&self.row).for_each(|(cell, load)| *cell += share * load);
            }
        }
    }
}
