//! `contact_area`: the area of a contact in square metres, counted in tactels and interpolated between them.

mod interpolation;

use tactflow_runtime::node::{Describe, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::Scalar;

use super::moments::{Inputs, image_shape};
use interpolation::interpolated;

/// Measures the area of a contact in square metres.
///
/// `area` is the number of tactels of the region times the area of one, the pitch along x times the pitch along y. It
/// jumps by a whole tactel whenever a tactel passes the threshold, even if the contact hardly changes.
///
/// `interpolated` is finer: the area where the image, interpolated between the tactels (cubic convolution, R. Keys
/// 1981), is above `threshold`, compared at 16 points a tactel. The foam spreads a contact, so the image is smooth
/// between the tactels and the place where it crosses the threshold is well defined. Set `threshold` to the threshold
/// of `binarize` (its `release`, if it has one), so that both describe the same contact. For Gaussian prints at any
/// position between the tactels, the error is 0.6 of the error of the count at a radius of less than two tactels, and a
/// fifth at four. Without `threshold` it is absent.
///
/// Both are areas of the print that the foam has spread, and grow with the force: an edge without any width has an area
/// too. Both are absent without a region. `area` of `moments` is the count in tactels.
///
/// ```toml
/// [nodes.contact_area]
/// type = "contact_area"
/// in.image = "calibrate.image"
/// in.region = "label.region"
/// threshold = 0.010                   # the `release` of `binarize` [N]
/// ```
#[derive(Describe)]
pub struct ContactArea {
    /// Area of a tactel [m²].
    tactel: f64,
    threshold: Option<f64>,
}

/// Parameters of `contact_area`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Value at the edge of the contact, for `interpolated`: the threshold of `binarize`, or its `release` if it has
    /// one.
    #[param(unit = "U")]
    threshold: Option<f64>,
}

/// What `contact_area` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Number of tactels times the area of one.
    #[port(unit = "m2", frame = "A", quantity = "area")]
    area: Out<Scalar>,
    /// Area where the interpolated image is above `threshold`; absent without `threshold`.
    #[port(unit = "m2", frame = "A", quantity = "area")]
    interpolated: Out<Scalar>,
}

impl Node for ContactArea {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let [along_x, along_y] = image_shape(&setup.inputs)?.pitch;
        Ok(Self { tactel: along_x * along_y, threshold: params.threshold })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.area.set(inputs.region.count() as f64 * self.tactel);
        if let Some(threshold) = self.threshold {
            out.interpolated.set(interpolated(&inputs.image, &inputs.region, threshold) * self.tactel);
        }
    }
}

#[cfg(test)]
mod tests;
