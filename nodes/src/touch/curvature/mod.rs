//! `curvature`: how a line bends, and the turning rate that follows it.
//!
//! A least-squares parabola n = a + b s + c s² over the tactels, with s along the long axis and n across it, both from
//! the centre of gravity. In these axes Σ w s = Σ w n = Σ w s n = 0, so with S_k = Σ w s^k the solution is
//!
//! ```text
//! c = Σ w n s² / (S_4 - S_3²/S_2 - S_2²/S_0)      b = -c S_3/S_2      κ = 2 c / (1 + b²)^(3/2)
//! ```

mod parabola;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Image, ImageShape, Mask, Scalar, Twist};

use super::common::check_same_array;
use super::moments::{Weighing, Weight, ellipse};
use parabola::parabola;

/// Measures how a line bends, and the turning rate with which a sensor follows it.
///
/// A controller of the orientation lags behind a line that turns: at the turning rate ω it is ω / kp behind, and ω
/// times the delay of its filters in addition. The rate is known before: a sensor that moves with the speed v along a
/// line of curvature κ must turn with ω = κ v. Wire `rate` to `wz` of a `compose_twist`, and add that twist to the
/// servoing with a `twist_adder`. Only the rest is left to the controller.
///
/// κ is that of a least-squares parabola across the long axis of the region, at the centre of gravity, in 1/m; it is
/// positive if the line turns from +x toward +y on its way. `turn` is κ L: the angle between the two ends of the line,
/// for a length L. `length` L is that of a uniform bar with the same standard deviation σ along the axis, sqrt(12) σ.
/// The curvature is `turn` / `length`. For an arc of radius R it is too large by the fraction 0.054 (L/R)².
///
/// v is the part of `in.twist` along the line: wire the guidance that moves the sensor. Without this wire, and while
/// the twist is absent, `rate` is absent.
///
/// All outputs are absent if the contact is no line that can be trusted: if its anisotropy is less than
/// `min_anisotropy`, if it is shorter than `min_length_m`, or if it bends more than with `min_radius_m`. A line that
/// leaves the pad at a corner is cut at an angle, which looks like a bend: measure within an `image_window`. Noise is
/// larger than in the orientation, so smooth `rate` with a `moving_average` or a `low_pass`.
///
/// ```toml
/// [nodes.curvature]
/// type = "curvature"
/// in.image = "calibrate.image"
/// in.region = "image_window.region"
/// in.twist = "guide.twist"
/// weight = "excess"                   # a tactel at the edge of the mask enters with 0
/// threshold = 0.010                   # the `release` of `binarize` [N]
/// ```
#[derive(Describe)]
pub struct Curvature {
    shape: ImageShape,
    weighing: Weighing,
    params: Params,
}

/// Parameters of `curvature`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Weight of each tactel: its value, its excess over `threshold`, or 1.
    #[param(default = Weight::Force)]
    weight: Weight,
    /// Zero of the excess, for `weight = "excess"`: the threshold of `binarize`, or its `release` if it has one.
    #[param(unit = "U")]
    threshold: Option<f64>,
    /// Smallest anisotropy of a line, from 0 (round) to 1 (a line).
    #[param(unit = "1", range = 0.0..=1.0, default = 0.6)]
    min_anisotropy: f64,
    /// Smallest length of a line.
    #[param(unit = "m", above = 0.0, default = 0.015)]
    min_length_m: f64,
    /// Smallest radius of a line.
    #[param(unit = "m", above = 0.0, default = 0.02)]
    min_radius_m: f64,
}

/// What `curvature` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The image with the values of the tactels.
    #[port(unit = "U", frame = "A")]
    image: In<'a, Image>,
    /// The tactels of the line.
    #[port(frame = "A")]
    region: In<'a, Mask>,
    /// Motion along the line.
    #[port(frame = "A", optional, sampled)]
    twist: Option<In<'a, Twist>>,
}

/// What `curvature` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Angle by which the line turns over its length, from +x toward +y on the way along its axis; absent if it is no
    /// line.
    #[port(unit = "rad", frame = "A", quantity = "turn")]
    turn: Out<Scalar>,
    /// Length of the line; absent if it is no line.
    #[port(unit = "m", frame = "A", quantity = "length")]
    length: Out<Scalar>,
    /// Angular speed about the sensor's z with which the sensor follows the line; absent if it is no line, and without
    /// a twist.
    #[port(unit = "rad/s", frame = "A")]
    rate: Out<Scalar>,
}

impl Node for Curvature {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        check_same_array(&setup.inputs.image, "region", &setup.inputs.region)?;
        let weighing = Weighing::new(params.weight, params.threshold)?;
        Ok(Self { shape: setup.inputs.image.clone(), weighing, params })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let Some(line) = self.line(&inputs.image, &inputs.region) else { return };
        out.turn.set(line.curvature * line.length);
        out.length.set(line.length);
        if let Some(twist) = inputs.twist {
            let v = twist.linear();
            out.rate.set(line.curvature * (line.axis[0] * v.x + line.axis[1] * v.y));
        }
    }
}

/// A line on the pad.
struct Line {
    /// Direction of its long axis along x and y.
    axis: [f64; 2],
    /// Length [m].
    length: f64,
    /// Curvature, from +x toward +y on the way along the axis [1/m].
    curvature: f64,
}

impl Curvature {
    /// Returns the line that a region is, or `None` if it is no line that can be trusted.
    fn line(&self, image: &Image, region: &Mask) -> Option<Line> {
        let sums = self.weighing.add_up(image, region);
        let centre = sums.centre(&self.shape)?;
        let ellipse = ellipse(&sums, self.shape.pitch);
        let (sine, cosine) = libm::sincos(ellipse.orientation(self.params.min_anisotropy)?);
        let length = (12.0 * ellipse.variances()[0]).sqrt();
        let axis = [cosine, sine];
        let curvature = parabola(&self.shape, |value| self.weighing.weight(value), image, region, centre, axis)?;
        let is_line = length >= self.params.min_length_m && curvature.abs() * self.params.min_radius_m <= 1.0;
        is_line.then_some(Line { axis, length, curvature })
    }
}

#[cfg(test)]
mod tests;
