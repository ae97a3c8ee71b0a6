//! The least-squares polynomial across the long axis of a region.

use nalgebra::{Matrix4, Vector4};
use tactflow_runtime::signal::{Image, ImageShape, Mask};

/// Smallest part of a power of s that the lower powers cannot explain [1]. It is 0 for tactels at as many places along
/// the axis as there are lower powers. A uniform bar has 4/9 for s², and 4/25 for s³.
const MIN_SHARE: f64 = 0.05;

/// A polynomial n(s) at one place: s is along the long axis of a region and n across it, from +x toward +y.
#[derive(Debug, Clone, Copy)]
pub(super) struct Curve {
    /// Distance from the axis: n(s) [m].
    pub(super) offset: f64,
    /// Slope: n'(s).
    pub(super) slope: f64,
    /// Second derivative: n''(s) [1/m].
    bend: f64,
}

impl Curve {
    /// Returns the curvature [1/m], positive from +x toward +y on the way along the axis.
    pub(super) fn curvature(&self) -> f64 {
        let stretch = 1.0 + self.slope * self.slope;
        self.bend / (stretch * stretch.sqrt())
    }
}

/// The axes in which the polynomial is fitted.
pub(super) struct Axes {
    /// Centre of gravity from the middle of the pad [m].
    pub(super) centre: [f64; 2],
    /// Unit vector of the long axis.
    pub(super) axis: [f64; 2],
    /// Length of the region along it [m].
    pub(super) length: f64,
    /// Highest power of s: 2 or 3.
    pub(super) degree: usize,
    /// Place at which the polynomial is wanted: s [m].
    pub(super) at: f64,
    /// Distance along the axis from this place at which the weight of a tactel has fallen to zero [m].
    pub(super) reach: f64,
}

impl Axes {
    /// Returns the biweight kernel (1 - u²)² at a place: u is its distance from the wanted place in parts of the reach.
    fn near(&self, along: f64) -> f64 {
        let part = (along - self.at) / self.reach;
        let rest = (1.0 - part * part).max(0.0);
        rest * rest
    }
}

/// Returns the polynomial through a region, at one place, or `None` if the region does not determine it.
pub(super) fn curve(
    shape: &ImageShape,
    weight: impl Fn(f64) -> f64,
    image: &Image,
    region: &Mask,
    axes: &Axes,
) -> Option<Curve> {
    let near = |value: f64, along: f64| weight(value) * axes.near(along);
    // The place from which s is counted: the mean of what is near.
    let (mut sum, mut moment) = (0.0, 0.0);
    each(shape, image, region, axes, |value, along, _| {
        let weight = near(value, along);
        sum += weight;
        moment += weight * along;
    });
    let origin = moment / sum;
    // The sums of w s^k and of w n s^k.
    let (mut powers, mut right) = ([0.0; 7], [0.0; 4]);
    each(shape, image, region, axes, |value, along, across| {
        let (mut term, s) = (near(value, along), (along - origin) / axes.length);
        for (k, power) in powers.iter_mut().enumerate() {
            *power += term;
            if let Some(right) = right.get_mut(k) {
                *right += term * across;
            }
            term *= s;
        }
    });
    solve(&powers, &right, axes, axes.at - origin)
}

/// Visits the tactels of a region: the value of each, and its place along and across the axis from the centre [m].
fn each(shape: &ImageShape, image: &Image, region: &Mask, axes: &Axes, mut visit: impl FnMut(f64, f64, f64)) {
    let Axes { centre, axis, .. } = axes;
    for i in 0..region.rows() {
        let (row, y) = (image.row(i), shape.y(i as f64) - centre[1]);
        for (k, word) in region.row(i).iter().enumerate() {
            let mut rest = *word;
            while rest != 0 {
                let j = 64 * k + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let x = shape.x(j as f64) - centre[0];
                visit(f64::from(row[j]), axis[0] * x + axis[1] * y, axis[0] * y - axis[1] * x);
            }
        }
    }
}

/// Solves the normal equations, and returns the polynomial at a place [m]. Powers above the degree are left out.
fn solve(powers: &[f64; 7], right: &[f64; 4], axes: &Axes, at: f64) -> Option<Curve> {
    let Axes { length, degree, .. } = *axes;
    let normal = Matrix4::from_fn(|i, j| match (i.max(j) <= degree, i == j) {
        (true, _) => powers[i + j],
        (false, is_diagonal) => f64::from(u8::from(is_diagonal)),
    });
    let right = Vector4::from_fn(|i, _| if i <= degree { right[i] } else { 0.0 });
    let factor = normal.cholesky()?;
    let share = |k: usize| factor.l_dirty()[(k, k)] * factor.l_dirty()[(k, k)] / normal[(k, k)];
    if !(2..=degree).all(|k| share(k) > MIN_SHARE) {
        return None;
    }
    let [a, b, c, d] = factor.solve(&right).into();
    let s = at / length;
    Some(Curve {
        offset: a + s * (b + s * (c + s * d)),
        slope: (b + s * (2.0 * c + s * 3.0 * d)) / length,
        bend: (2.0 * c + 6.0 * s * d) / (length * length),
    })
}
