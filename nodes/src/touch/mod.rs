//! From a tactile image to features (paper section III).
//!
//! A pad's image passes [`tactile_source`] (the sensor's frame) → [`calibrate`] → [`binarize`] → [`label`] (which
//! tactels are the contact) → [`moments`] (where it is, how strong, along which line) → [`smooth`].
//!
//! Beside them: [`select_region`] takes other regions than the contact; [`hough`], [`eccentricity`], [`principal_axes`]
//! and [`contact_area`] say more of a region's shape; [`one_pole`] and [`median`] are other filters.

pub mod binarize;
pub mod calibrate;
pub mod contact_area;
pub mod eccentricity;
pub mod hough;
pub mod label;
pub mod median;
pub mod moments;
pub mod one_pole;
pub mod principal_axes;
pub mod select_region;
pub mod smooth;
pub mod tactile_source;

use std::f64::consts::FRAC_PI_2;

use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::{Grid, ImageShape};

/// Mean length of the unit vectors of doubled axes below which the axes cancel each other [1].
const LEAST_RESULTANT: f64 = 1e-6;

/// Refuses a mask that does not lie on the array of the image; `input` is the wire that brings the mask.
fn on_one_array(image: &ImageShape, input: &str, mask: &Grid) -> Result<(), Mistakes> {
    if (image.rows, image.cols) == (mask.rows, mask.cols) {
        return Ok(());
    }
    let message =
        format!("`{input}` is {} by {} tactels, but `image` is {} by {}", mask.rows, mask.cols, image.rows, image.cols);
    Err(Mistake::input(input, message).help("take both from one pad").into())
}

/// Direction of the axis whose doubled angle has this sine and cosine, up to a common factor: in (-pi/2, pi/2] [rad].
#[must_use]
pub fn axis(sine: f64, cosine: f64) -> f64 {
    let angle = 0.5 * libm::atan2(sine, cosine);
    // A sine of -0, or one too small to count, would give the other name of the same axis.
    if angle > -FRAC_PI_2 { angle } else { FRAC_PI_2 }
}

/// An axis as the unit vector of its double, cosine and sine, which can be averaged: 89 and -89 degrees are neighbours.
fn doubled(angle: f64) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(2.0 * angle);
    [cosine, sine]
}

/// The axis whose double is the direction of a mean of such vectors; none if they cancel each other.
fn halved([cosine, sine]: [f64; 2]) -> Option<f64> {
    ((cosine * cosine + sine * sine).sqrt() >= LEAST_RESULTANT).then(|| axis(sine, cosine))
}

/// Numbers in [0, 1) that are the same in every run.
#[cfg(test)]
pub(crate) fn uniform(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 40) as f64 / 16_777_216.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_has_one_name() {
        let cases = [
            (0.0, 1.0, 0.0),
            (-0.0, 1.0, 0.0),
            (1.0, 0.0, FRAC_PI_2 / 2.0),
            (-1.0, 0.0, -FRAC_PI_2 / 2.0),
            (0.0, -1.0, FRAC_PI_2),
            (-0.0, -1.0, FRAC_PI_2),
            (-1e-300, -1.0, FRAC_PI_2),
        ];
        for (sine, cosine, angle) in cases {
            assert!((axis(sine, cosine) - angle).abs() < 1e-15, "{sine}, {cosine}: {}", axis(sine, cosine));
        }
    }
}
