//! The least-squares parabola across the long axis of a region.

use tactflow_runtime::signal::{Image, ImageShape, Mask};

/// Smallest part of the fourth moment that the parabola can explain [1]. It is 0 for tactels at only two places along
/// the axis, through which any parabola goes, and 4/9 for a uniform bar.
const MIN_SHARE: f64 = 0.05;

/// Returns the curvature at the centre of gravity of a region [1/m], positive from +x toward +y on the way along the
/// axis, or `None` if the region does not determine it.
///
/// `centre` is the centre of gravity from the middle of the pad [m] and `axis` the unit vector of the long axis, both
/// for the same weights.
pub(super) fn parabola(
    shape: &ImageShape,
    weight: impl Fn(f64) -> f64,
    image: &Image,
    region: &Mask,
    centre: [f64; 2],
    axis: [f64; 2],
) -> Option<f64> {
    let (mut s, mut bend) = ([0.0; 5], 0.0);
    for i in 0..region.rows() {
        let (row, y) = (image.row(i), shape.y(i as f64) - centre[1]);
        for (k, word) in region.row(i).iter().enumerate() {
            let mut rest = *word;
            while rest != 0 {
                let j = 64 * k + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let x = shape.x(j as f64) - centre[0];
                let (along, across) = (axis[0] * x + axis[1] * y, axis[0] * y - axis[1] * x);
                let mut term = weight(f64::from(row[j]));
                bend += term * across * along * along;
                for sum in &mut s {
                    *sum += term;
                    term *= along;
                }
            }
        }
    }
    let explained = s[4] - s[3] * s[3] / s[2] - s[2] * s[2] / s[0];
    let is_determined = s[0] > 0.0 && s[2] > 0.0 && explained > MIN_SHARE * s[4];
    is_determined.then(|| {
        let c = bend / explained;
        let slope = c * s[3] / s[2];
        let stretch = 1.0 + slope * slope;
        2.0 * c / (stretch * stretch.sqrt())
    })
}
