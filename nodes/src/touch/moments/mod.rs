//! `moments`: force, pressure, centre of gravity and orientation of a contact (paper eqs. 1 and 2, and section III).
//!
//! f is the sum over the region R, c its centre of gravity (eq. 1), p = f / |R| (eq. 2). The orientation is that of the
//! principal axis of the force-weighted second central moments in metres, counted from the sensor's +x toward +y. A
//! round or square patch has none: below a least anisotropy it is absent.
//!
//! Moments are counted about the region's first tactel in whole tactels, so that what has no extent is exactly zero and
//! not a rounding error with a direction.

use tactflow_runtime::node::{Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{Image, ImageShape, Mask};
use tactflow_runtime::{inputs, outputs, params};

use super::{axis, on_one_array};

params! {
    /// Below this anisotropy, from 0 (round) to 1 (a line), there is no orientation.
    min_anisotropy: f64 = 0.1,
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
    /// Centre of gravity along the sensor's x from the pad's middle (eq. 1) [m]; absent if the force is not positive.
    x: Scalar["m", "A"],
    /// Centre of gravity along the sensor's y from the pad's middle (eq. 1) [m]; absent if the force is not positive.
    y: Scalar["m", "A"],
    /// Number of tactels of the region, |R| [tactel].
    area: Scalar["tactel", "A"],
    /// Direction of the region's long axis from +x toward +y, in (-pi/2, pi/2] [rad]; absent if it has none.
    orientation: Scalar["rad mod pi", "A"],
    /// From 0 (round) to 1 (a line): difference of the principal second moments over their sum [1]; absent if the
    /// force is not positive.
    anisotropy: Scalar["1", "A"],
}

/// The array, and when a contact has an orientation.
pub struct Moments {
    shape: ImageShape,
    min_anisotropy: f64,
}

impl Node for Moments {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const NAME: &'static str = "moments";
    const SUMMARY: &'static str = "force, pressure, centre of gravity and orientation of a contact";

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = setup.inputs.image.clone();
        on_one_array(&shape, "region", &setup.inputs.region)?;
        if !(0.0..=1.0).contains(&params.min_anisotropy) {
            return Err(Mistake::param("min_anisotropy", "`min_anisotropy` is a number from 0 to 1").into());
        }
        Ok(Self { shape, min_anisotropy: params.min_anisotropy })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let sums = add_up(&inputs.image, &inputs.region);
        out.force.set(sums.force);
        out.area.set(sums.area);
        if sums.area > 0.0 {
            out.pressure.set(sums.force / sums.area);
        }
        if sums.force > 0.0 {
            let (j, i) = (sums.x / sums.force, sums.y / sums.force);
            out.x.set(self.shape.x(sums.first[1] + j));
            out.y.set(self.shape.y(sums.first[0] + i));
            let ellipse = ellipse(&sums, self.shape.pitch);
            let anisotropy = ellipse.anisotropy();
            out.anisotropy.set(anisotropy);
            if anisotropy > 0.0 && anisotropy >= self.min_anisotropy {
                out.orientation.set(axis(ellipse.sine, ellipse.cosine));
            }
        }
    }
}

/// Sums over a region, places counted in tactels from its first tactel in raster order.
#[derive(Debug, Default)]
pub struct Sums {
    /// Row and column of that first tactel.
    pub first: [f64; 2],
    /// Number of tactels.
    pub area: f64,
    /// Sum of their values.
    pub force: f64,
    /// Sum of value times column.
    pub x: f64,
    /// Sum of value times row.
    pub y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// One pass over the tactels of a region, in raster order.
#[must_use]
pub fn add_up(image: &Image, region: &Mask) -> Sums {
    let mut sums = Sums::default();
    let Some(at) = region.words().iter().position(|word| *word != 0) else { return sums };
    let stride = region.stride();
    let (top, left) = (at / stride, at % stride * 64 + region.words()[at].trailing_zeros() as usize);
    sums.first = [top as f64, left as f64];
    for i in top..region.rows() {
        let row = image.row(i);
        let (mut area, mut force, mut x, mut xx) = (0, 0.0, 0.0, 0.0);
        for (k, word) in region.row(i).iter().enumerate() {
            area += word.count_ones();
            let mut rest = *word;
            while rest != 0 {
                let j = 64 * k + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let (value, along) = (f64::from(row[j]), j as f64 - sums.first[1]);
                force += value;
                x += value * along;
                xx += value * along * along;
            }
        }
        let down = (i - top) as f64;
        sums.area += f64::from(area);
        sums.force += force;
        sums.x += x;
        sums.xx += xx;
        sums.y += force * down;
        sums.xy += x * down;
        sums.yy += force * down * down;
    }
    sums
}

/// Second central moments: their sum, and the double of the axis they give, as a sine and a cosine times its strength.
pub struct Ellipse {
    spread: f64,
    /// Sine of the doubled axis, times its strength.
    pub sine: f64,
    /// Cosine of the doubled axis, times its strength.
    pub cosine: f64,
}

/// The ellipse with the second central moments of a region whose force is positive.
#[must_use]
pub fn ellipse(sums: &Sums, pitch: [f64; 2]) -> Ellipse {
    let (x, y) = (sums.x / sums.force, sums.y / sums.force);
    let m20 = (sums.xx / sums.force - x * x) * pitch[0] * pitch[0];
    let m02 = (sums.yy / sums.force - y * y) * pitch[1] * pitch[1];
    let m11 = (sums.xy / sums.force - x * y) * pitch[0] * pitch[1];
    Ellipse { spread: m20 + m02, sine: 2.0 * m11, cosine: m20 - m02 }
}

impl Ellipse {
    /// From 0 to 1; zero without extent, and where tactels below zero leave no positive spread.
    #[must_use]
    pub fn anisotropy(&self) -> f64 {
        if self.spread > 0.0 {
            ((self.sine * self.sine + self.cosine * self.cosine).sqrt() / self.spread).min(1.0)
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests;
