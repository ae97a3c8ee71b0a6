//! `moments`: force, pressure, centre of gravity and orientation of a contact (paper eqs. 1 and 2, and section III).
//!
//! f is the sum over the region R, c its centre of gravity (eq. 1), p = f / |R| (eq. 2). The orientation is that of the
//! principal axis of the second central moments in metres, counted from the sensor's +x toward +y. A round or square
//! patch has none: below a least anisotropy it is absent.
//!
//! c and the second moments are weighted by the force; by what the force has above the threshold, which takes out the
//! step at the edge of the mask; or not at all. f and p are those of eqs. 1 and 2 with any weight.
//!
//! Moments are counted about the region's first tactel in whole tactels, so that what has no extent is exactly zero and
//! not a rounding error with a direction.

mod sums;

use tactflow_runtime::node::{Mistakes, Node, Ratio, Setup, Tick};
use tactflow_runtime::signal::ImageShape;
use tactflow_runtime::{inputs, outputs, params};

use super::on_one_array;
use crate::motion::axis::half_angle;

pub use sums::{Ellipse, Sums, Weighing, Weight, add_up, ellipse};

params! {
    /// Below this anisotropy, from 0 (round) to 1 (a line), there is no orientation [1].
    min_anisotropy: Ratio = Ratio(0.1),
    /// What a tactel counts in place and shape: its "force", its "excess" above `threshold`, or the same as all others
    /// ("area").
    weight: Weight = Weight::Force,
    /// Where the excess begins, for `weight = "excess"`: that of the `binarize` [unit of the image].
    threshold: Option<f64>,
}

inputs! {
    /// The image that forces are taken from.
    image: Image["U", "A"],
    /// The tactels of the contact, R.
    region: Mask["A"],
}

outputs! {
    /// Sum over the region, f (eq. 1) [unit of the image].
    force: Scalar["U", "A"],
    /// Mean over the region, p = f / |R| (eq. 2) [unit of the image per tactel]; absent for a region of nothing.
    pressure: Scalar["U/tactel", "A"],
    /// Centre of gravity along the sensor's x from the pad's middle (eq. 1) [m]; absent if the weights' sum is not
    /// positive.
    x: Scalar["m", "A"],
    /// Centre of gravity along the sensor's y from the pad's middle (eq. 1) [m]; absent if the weights' sum is not
    /// positive.
    y: Scalar["m", "A"],
    /// Number of tactels of the region, |R| [tactel].
    area: Scalar["tactel", "A"],
    /// Direction of the region's long axis from +x toward +y, in (-pi/2, pi/2] [rad]; absent if it has none.
    orientation: Scalar["rad mod pi", "A"],
    /// From 0 (round) to 1 (a line): difference of the principal second moments over their sum [1]; absent if the
    /// weights' sum is not positive.
    anisotropy: Scalar["1", "A"],
}

/// The array, the weight, and when a contact has an orientation.
pub struct Moments {
    shape: ImageShape,
    weighing: Weighing,
    min_anisotropy: f64,
}

impl tactflow_runtime::node::Describe for Moments {
    const NAME: &'static str = "moments";
    const SUMMARY: &'static str = "measures a contact: force, pressure, centre of gravity and orientation";
    const DOC: &'static str = "The features of the paper's section III, from the tactels of a region R with the values \
        f_ij at the places c_ij:\n\n\
        - `force` f = Σ f_ij (eq. 1), `area` |R|, `pressure` p = f / |R| (eq. 2);\n\
        - `x`, `y`: the centre of gravity c = Σ f_ij c_ij / f (eq. 1), in metres from the pad's middle. On a pitch of \
        5 mm it is good to about 0.5 mm (Fig. 2), as the foam spreads a contact over several tactels;\n\
        - `orientation`: the long axis of the ellipse with the same second moments, from the sensor's +x toward +y, \
        modulo pi;\n\
        - `anisotropy`: from 0 for a round patch to 1 for a line.\n\n\
        **Absence.** A round or a square patch has no orientation: below `min_anisotropy` it is absent, and servoing on \
        the other features goes on. All outputs are absent without a region.\n\n\
        **Weights.** The paper weights place and shape by the force. A tactel at the edge of the mask then enters \
        with the whole of the threshold at once, which shows as an error of the angle. `weight = \"excess\"` takes \
        f_ij - `threshold` (nothing, where that is negative), so that a tactel enters with nothing: on \
        bars of 8 to 14 by 2 to 3 tactels with 2 % noise the angle's error is 0.20° instead of 0.33°, on short ones of 6 \
        to 8 tactels 0.46° instead of 0.73°, and the centre of a print of 2 mm is off by 0.11 mm instead of 0.17 mm. It \
        holds for `x`, `y`, `orientation` and `anisotropy` alike, so that the axis goes through the point that is told. Give it \
        the threshold of the `binarize`, its `release` if it has one. `weight = \"area\"` takes every tactel as 1: \
        the shape of the mask alone, for a pad whose values are not to be trusted. `force`, `pressure` and `area` do \
        not depend on it.\n\n\
        **Pressure** says less than it seems: force and area grow together, and it cannot be below the threshold (or \
        `release`) of the `binarize`.";
    const EXAMPLE: &'static str = r#"
[nodes.moments]
type = "moments"
in.image = "calibrate.image"
in.region = "label.region"
weight = "excess"                   # without the step at the edge of the mask
threshold = 0.010                   # as the `release` of the `binarize` [N]
"#;
}

impl Node for Moments {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = setup.inputs.image.clone();
        on_one_array(&shape, "region", &setup.inputs.region)?;
        let weighing = Weighing::new(params.weight, params.threshold)?;
        let (x, y) = (shape.x(shape.cols as f64 - 1.0), shape.y(shape.rows as f64 - 1.0));
        (setup.outputs.x.range, setup.outputs.y.range) = ([-x, x], [-y, y]);
        setup.outputs.area.range = [0.0, shape.tactels() as f64];
        Ok(Self { shape, weighing, min_anisotropy: *params.min_anisotropy })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let sums = add_up(&inputs.image, &inputs.region);
        out.force.set(sums.force);
        out.area.set(sums.area);
        if sums.area > 0.0 {
            out.pressure.set(sums.force / sums.area);
        }
        let sums = match self.weighing {
            Weighing::Force => sums,
            other => other.add_up(&inputs.image, &inputs.region),
        };
        if sums.force > 0.0 {
            let (j, i) = (sums.x / sums.force, sums.y / sums.force);
            out.x.set(self.shape.x(sums.first[1] + j));
            out.y.set(self.shape.y(sums.first[0] + i));
            let ellipse = ellipse(&sums, self.shape.pitch);
            let anisotropy = ellipse.anisotropy();
            out.anisotropy.set(anisotropy);
            if anisotropy > 0.0 && anisotropy >= self.min_anisotropy {
                out.orientation.set(half_angle(ellipse.sine, ellipse.cosine));
            }
        }
    }
}

#[cfg(test)]
mod tests;
