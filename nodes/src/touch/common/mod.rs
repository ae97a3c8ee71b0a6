//! What the nodes of this folder share.

pub(super) mod halves;

use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::{Grid, ImageShape};

/// Checks that a mask has the size of the image; `input` is the input with the mask.
pub(crate) fn check_same_array(image: &ImageShape, input: &str, mask: &Grid) -> Result<(), Mistakes> {
    if (image.rows, image.cols) == (mask.rows, mask.cols) {
        return Ok(());
    }
    let message =
        format!("`{input}` is {} by {} tactels, but `image` is {} by {}", mask.rows, mask.cols, image.rows, image.cols);
    Err(Mistake::input(input, message).help("wire both from the same pad").into())
}

/// Returns the number of a parameter as the value of a tactel.
pub(crate) fn narrow(param: &str, number: f64) -> Result<f32, Mistakes> {
    if (number as f32).is_finite() {
        return Ok(number as f32);
    }
    let message = format!("{number:e} is too large: a tactel is a 32-bit float");
    Err(Mistake::param(param, message).into())
}
