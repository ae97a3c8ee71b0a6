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

use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::{Grid, ImageShape};

/// Refuses a mask that does not lie on the array of the image; `input` is the wire that brings the mask.
fn on_one_array(image: &ImageShape, input: &str, mask: &Grid) -> Result<(), Mistakes> {
    if (image.rows, image.cols) == (mask.rows, mask.cols) {
        return Ok(());
    }
    let message =
        format!("`{input}` is {} by {} tactels, but `image` is {} by {}", mask.rows, mask.cols, image.rows, image.cols);
    Err(Mistake::input(input, message).help("take both from one pad").into())
}
