//! `curvature`: how a line bends, where it is, and the turning rate that follows it.
//!
//! A least-squares polynomial n = a + b s + c s² (+ d s³) over the tactels, with s along the long axis and n across it,
//! both from the centre of gravity. w is the weight of the tactel, times the kernel if there is a reach. The normal
//! equations Σ_j S_(i+j) p_j = Σ w n s^i, with S_k = Σ w s^k, are solved by a Cholesky factorization, for s in lengths of
//! the line. The curvature is κ = n'' / (1 + n'²)^(3/2).
//!
//! The centre of gravity of a bend is beside the line, by κ L²/24 for a length L. The curve is not.

mod curve;

use std::f64::consts::{FRAC_PI_2, PI};

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Image, ImageShape, Mask, Scalar, Twist};

use super::common::check_same_array;
use super::moments::{Weighing, Weight, ellipse};
use curve::{Axes, Curve, curve};

/// Measures how a line bends, where it is, and the turning rate with which a sensor follows it.
///
/// `x`, `y` and `orientation` are the point and the tangent of the line beside the middle of the pad. The centre of
/// gravity is beside a line that bends: for a bend of 44 mm radius of which 30 mm are seen, by 0.85 mm. If the line ends
/// before the middle, they are those of its end. While the contact is no line that can be trusted, they are the centre
/// of gravity and the long axis, as of `moments`.
///
/// A controller of the orientation lags behind a line that turns: at the turning rate ω it is ω / kp behind, and ω
/// times the delay of its filters in addition. The rate is known before: a sensor that moves with the speed v along a
/// line of curvature κ must turn with ω = κ v. Wire `rate` to `wz` of a `compose_twist`, and add that twist to the
/// servoing with a `twist_adder`. Only the rest is left to the controller.
///
/// κ is the curvature at the same point, of a least-squares curve across the long axis of the region, in 1/m. It is
/// positive if the line turns from +x toward +y on its way. The curve is a parabola. With `degree = 3` it is a cubic,
/// which also follows a line whose bend changes within the region. A cubic is noisier: the standard deviation of its
/// direction is 2.5 times that of a parabola over the same length.
///
/// The end of a region is seldom square to the line: an `image_window` cuts it along rows or columns, and the pad along
/// its edges. A cubic takes an oblique end for a bend that changes. For straight lines that cross eight rows at up to
/// 6°, its direction is off by 0.8° (rms). With `reach_m`, the weight of a tactel at the distance s along the line falls
/// as (1 - (s / reach)²)², the biweight kernel of local regression (Cleveland 1979): with 22.5 mm in ten rows it is
/// off by 0.35°. Let the region be a little longer than twice the reach, so that no end counts.
///
/// `turn` is κ L for a length L: the angle between the two ends of an arc. A line whose bend changes, which `degree = 3`
/// follows, can turn by another angle from end to end. `length` L is that of a uniform bar with the same standard
/// deviation σ along the axis, sqrt(12) σ. The curvature is `turn` / `length`. For an arc of radius R it is too large by
/// the fraction 0.054 (L/R)².
///
/// v is the part of `in.twist` along the line: wire the guidance that moves the sensor. Without this wire, and while
/// the twist is absent, `rate` is absent.
///
/// `turn`, `length` and `rate` are absent if the contact is no line that can be trusted: if its anisotropy is less than
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
    /// Degree of the curve: 2 for a parabola, or 3 for a line whose bend changes.
    #[param(unit = "1", range = 2..=3, default = 2)]
    degree: usize,
    /// Distance along the line from the middle of the pad at which the weight of a tactel has fallen to zero. Without it,
    /// all tactels of the region count alike.
    #[param(unit = "m", above = 0.0)]
    reach_m: Option<f64>,
    /// Smallest anisotropy of a line, from 0 (round) to 1 (a line).
    #[param(unit = "1", range = 0.0..=1.0, usual = ..=0.95, default = 0.6)]
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
    /// The line along the sensor's x from the middle of the pad; absent if the sum of the weights is not positive.
    #[port(unit = "m", frame = "A", quantity = "x")]
    x: Out<Scalar>,
    /// The line along the sensor's y from the middle of the pad; absent if the sum of the weights is not positive.
    #[port(unit = "m", frame = "A", quantity = "y")]
    y: Out<Scalar>,
    /// Direction of the line from +x toward +y, in (-pi/2, pi/2]; absent if its anisotropy is less than
    /// `min_anisotropy`.
    #[port(unit = "rad mod pi", frame = "A", quantity = "orientation")]
    orientation: Out<Scalar>,
    /// Curvature times length: the angle by which an arc turns, from +x toward +y on the way along its axis; absent if it
    /// is no line.
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
        let shape = &setup.inputs.image;
        let (x, y) = (shape.x(shape.cols as f64 - 1.0), shape.y(shape.rows as f64 - 1.0));
        (setup.outputs.x.range, setup.outputs.y.range) = ([-x, x], [-y, y]);
        Ok(Self { shape: setup.inputs.image.clone(), weighing, params })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let sums = self.weighing.add_up(&inputs.image, &inputs.region);
        let Some(centre) = sums.centre(&self.shape) else { return };
        let ellipse = ellipse(&sums, self.shape.pitch);
        let angle = ellipse.orientation(self.params.min_anisotropy);
        let length = (12.0 * ellipse.variances()[0]).sqrt();
        let line = angle.and_then(|angle| self.line(&inputs.image, &inputs.region, centre, angle, length));
        let [x, y] = line.as_ref().map_or(centre, Line::point);
        out.x.set(x);
        out.y.set(y);
        if let Some(angle) = angle {
            out.orientation.set(line.as_ref().map_or(angle, |line| line.direction(angle)));
        }
        let Some(line) = line else { return };
        let curvature = line.curve.curvature();
        out.turn.set(curvature * length);
        out.length.set(length);
        if let Some(twist) = inputs.twist {
            let v = twist.linear();
            out.rate.set(curvature * (line.axis[0] * v.x + line.axis[1] * v.y));
        }
    }
}

/// A line on the pad.
struct Line {
    /// Centre of gravity from the middle of the pad [m].
    centre: [f64; 2],
    /// Direction of its long axis along x and y.
    axis: [f64; 2],
    /// Place on this axis beside the middle of the pad, from the centre of gravity [m].
    at: f64,
    /// The line at this place.
    curve: Curve,
}

impl Line {
    /// Returns the point of the line [m].
    fn point(&self) -> [f64; 2] {
        let ([x, y], [cosine, sine], [s, n]) = (self.centre, self.axis, [self.at, self.curve.offset]);
        [x + cosine * s - sine * n, y + sine * s + cosine * n]
    }

    /// Returns the direction of the line there, for the angle of its long axis, in (-pi/2, pi/2] [rad].
    fn direction(&self, angle: f64) -> f64 {
        let turned = angle + libm::atan(self.curve.slope);
        if turned > FRAC_PI_2 {
            turned - PI
        } else if turned <= -FRAC_PI_2 {
            turned + PI
        } else {
            turned
        }
    }
}

impl Curvature {
    /// Returns the line that a region is, or `None` if it is no line that can be trusted.
    fn line(&self, image: &Image, region: &Mask, centre: [f64; 2], angle: f64, length: f64) -> Option<Line> {
        let (sine, cosine) = libm::sincos(angle);
        let axis = [cosine, sine];
        // The middle of the pad, or the end of the line that is nearer to it.
        let at = (-axis[0] * centre[0] - axis[1] * centre[1]).clamp(-0.5 * length, 0.5 * length);
        let axes = Axes {
            centre,
            axis,
            length,
            degree: self.params.degree,
            at,
            reach: self.params.reach_m.unwrap_or(f64::INFINITY),
        };
        let curve = curve(&self.shape, |value| self.weighing.weight(value), image, region, &axes)?;
        let is_line = length >= self.params.min_length_m && curve.curvature().abs() * self.params.min_radius_m <= 1.0;
        is_line.then_some(Line { centre, axis, at, curve })
    }
}

#[cfg(test)]
mod tests;
