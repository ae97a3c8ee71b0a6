//! From a tactile image to features (paper section III).
//!
//! A pad's image passes [`tactile_source`] (the sensor's frame) → [`calibrate`] → [`binarize`] → [`label`] (finds the
//! contact) → [`moments`] (its position, force and orientation) → [`smooth`].
//!
//! Besides them, [`select_region`] selects one of several regions; [`hough`], [`eccentricity`], [`principal_axes`] and
//! [`contact_area`] measure the shape of a region; [`one_pole`] and [`median`] are other filters.

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

use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::{Grid, ImageShape};

/// Checks that a mask has the size of the image; `input` is the input with the mask.
fn check_same_array(image: &ImageShape, input: &str, mask: &Grid) -> Result<(), Mistakes> {
    if (image.rows, image.cols) == (mask.rows, mask.cols) {
        return Ok(());
    }
    let message =
        format!("`{input}` is {} by {} tactels, but `image` is {} by {}", mask.rows, mask.cols, image.rows, image.cols);
    Err(Mistake::input(input, message).help("wire both from one pad").into())
}
