//! The noise-free forces on the tactels from the forces on the points: the foam spreads a load over several tactels.
//!
//! The force on each point is distributed by a Gaussian of the foam's spread, integrated over each tactel. So a probe
//! between two tactels is felt by both. At the rim of the pad the weights are normalised to sum to 1, so that no load
//! is lost. Friction is spread as the force that causes it, so that on no tactel it exceeds the friction limit.

use tactflow_runtime::signal::ImageShape;

use super::contact::{Contact, Touch};

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

/// The noise-free forces on the tactels [N].
#[derive(Debug, Clone)]
pub struct Forces {
    /// Along the pad's z, positive when the pad is pressed.
    pub normal: Vec<f64>,
    /// Friction along the pad's x and along its y, if the pad measures it.
    pub drag: Option<[Vec<f64>; 2]>,
}

/// Spreads the loads of points over the tactels.
pub struct Imprint {
    along_x: Vec<Band>,
    along_y: Vec<Band>,
    cols: usize,
    /// Loads of one row of points, spread along x.
    row: Vec<f64>,
    /// The forces at the last [`Imprint::take`].
    pub(super) forces: Forces,
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
            forces: Forces { normal: vec![0.0; shape.tactels()], drag: None },
        }
    }

    /// Computes the friction on each tactel too.
    #[must_use]
    pub fn with_drag(mut self) -> Self {
        self.forces.drag = Some([self.forces.normal.clone(), self.forces.normal.clone()]);
        self
    }

    /// Computes the forces on the tactels.
    pub fn take(&mut self, contact: &Contact) {
        let mut normal = std::mem::take(&mut self.forces.normal);
        self.spread(&contact.touching, |touch| touch.force, &mut normal);
        self.forces.normal = normal;
        if let Some(mut drag) = self.forces.drag.take() {
            for (axis, forces) in drag.iter_mut().enumerate() {
                self.spread(&contact.touching, |touch| contact.friction_at(touch)[axis], forces);
            }
            self.forces.drag = Some(drag);
        }
    }

    /// Adds up the `load` of each point, in raster order.
    fn spread(&mut self, touching: &[Touch], load: impl Fn(&Touch) -> f64, forces: &mut [f64]) {
        forces.fill(0.0);
        for line in touching.chunk_by(|a, b| a.point[0] == b.point[0]) {
            self.row.fill(0.0);
            for touch in line {
                let (first, weights) = &self.along_x[touch.point[1]];
                let cells = self.row[*first..].iter_mut().zip(weights);
                cells.for_each(|(cell, weight)| *cell += weight * load(touch));
            }
            let (first, weights) = &self.along_y[line[0].point[0]];
            for (row, weight) in forces[first * self.cols..].chunks_exact_mut(self.cols).zip(weights) {
                row.iter_mut().zip(&self.row).for_each(|(cell, load)| *cell += weight * load);
            }
        }
    }
}
