//! The order of the tactels: from the rows and columns of the device to those of the sensor.

use tactflow_runtime::signal::ImageShape;

use super::Params;

/// Returns the shape with rows and columns swapped.
pub(super) fn transposed(image: &ImageShape) -> ImageShape {
    let [along_x, along_y] = image.pitch;
    ImageShape { rows: image.cols, cols: image.rows, pitch: [along_y, along_x], unit: image.unit }
}

/// Returns the index in the device's image of each tactel of the sensor's.
pub(super) fn order(sensor: &ImageShape, params: &Params) -> Box<[u32]> {
    let &ImageShape { rows, cols, .. } = sensor;
    let from = |i: usize, j: usize| {
        let i = if params.flip_y { rows - 1 - i } else { i };
        let j = if params.flip_x { cols - 1 - j } else { j };
        (if params.transpose { j * rows + i } else { i * cols + j }) as u32
    };
    (0..rows).flat_map(|i| (0..cols).map(move |j| from(i, j))).collect()
}
