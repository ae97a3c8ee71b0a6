//! What the nodes of this folder share.

use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::{Grid, ImageShape};

/// Checks that a mask has the size of the image; `input` is the input with the mask.
pub(crate) fn check_same_array(image: &ImageShape, input: &str, mask: &Grid) -> Result<(), Mistakes> {
    if (image.rows, image.cols) == (mask.rows, mask.cols) {
        return Ok(());
    }
    let message =
        format!("`{input}` is {} by {} tactels, but `image` is {} by {}", mask.rows, mask.cols, image.rows, image.cols);
    Err(Mistake::input(input, message).help("wire both from one pad").into())
}
