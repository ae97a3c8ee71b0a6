//! `tactile_source`: a pad's image in the sensor's frame, with its sum and its peak.

mod order;
mod sums;

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Image, Scalar};

use order::{order, transposed};
pub use sums::sum_and_peak;

/// Converts a pad's image to the sensor's frame, with its sum and its peak.
///
/// The first node behind a pad. All nodes after it count rows along the sensor's +y and columns along its +x, from the
/// middle of the pad; z points out of the pad toward the object. Devices have their own order: `transpose` swaps rows
/// and columns, then `flip_x` and `flip_y` reverse the columns and the rows. To check it, press the corner toward +x
/// and +y: `x` and `y` of `moments` must both be positive.
///
/// `sum` and `peak` cover every tactel and not only a chosen region, so they include a second contact, and one that is
/// too small to be a region. Force ceilings use them. The sum is exact for whole counts, and has the same bits on every
/// machine.
///
/// All outputs are absent while the pad sends nothing. A frame that the pad repeats is not new.
///
/// ```toml
/// [nodes.source]
/// type = "tactile_source"
/// in.image = "pad.image"
/// flip_y = false                      # `true` if the first row of the device is the one toward +y
/// ```
#[derive(Describe)]
pub struct TactileSource {
    /// Index in the device's image of each tactel; `None` if the device has the order of the sensor.
    order: Option<Box<[u32]>>,
}

/// Parameters of `tactile_source`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Whether to swap rows and columns, before any flip.
    #[param(default = false)]
    transpose: bool,
    /// Whether to reverse the columns: the device counts them against the sensor's +x.
    #[param(default = false)]
    flip_x: bool,
    /// Whether to reverse the rows: the device counts them against the sensor's +y.
    #[param(default = false)]
    flip_y: bool,
}

/// What `tactile_source` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The newest image, in the device's order of rows and columns.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    image: In<'a, Image>,
}

/// What `tactile_source` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The image in the sensor's frame: row i along +y, column j along +x.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    image: Out<Image>,
    /// Sum over the whole image.
    #[port(unit = "U", frame = "A", quantity = "sum")]
    sum: Out<Scalar>,
    /// Largest tactel of the whole image.
    #[port(unit = "U", frame = "A", quantity = "peak")]
    peak: Out<Scalar>,
}

impl Node for TactileSource {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let image = &setup.inputs.image;
        if image.tactels() == 0 {
            let message = format!("an image of {} by {} has no tactels", image.rows, image.cols);
            return Err(Mistake::input("image", message).into());
        }
        setup.outputs.image = if params.transpose { transposed(image) } else { image.clone() };
        let is_reordered = params.transpose | params.flip_x | params.flip_y;
        Ok(Self { order: is_reordered.then(|| order(&setup.outputs.image, &params)) })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let (from, to) = (inputs.image.cells(), out.image.write().cells_mut());
        let (sum, peak) = match &self.order {
            None => sums::copy_sum_and_peak(from, to),
            Some(order) => {
                for (cell, at) in to.iter_mut().zip(order) {
                    *cell = from[*at as usize];
                }
                sum_and_peak(to)
            }
        };
        out.sum.set(sum);
        out.peak.set(peak);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{ImageShape, Shape, Unit};

    use super::*;

    fn shape(rows: usize, cols: usize) -> Shape {
        ImageShape { rows, cols, pitch: [0.001, 0.002], unit: Unit::RAW }.into()
    }

    fn run(params: &str, cols: usize, cells: &[f32]) -> NodeRig {
        let mut rig = NodeRig::new::<TactileSource>(params, &[("image", shape(cells.len() / cols, cols))]).unwrap();
        rig.set("image", Image::from_cells(cols, cells));
        rig.step();
        rig
    }

    #[test]
    fn the_device_order_becomes_the_order_of_the_sensor() {
        let device = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let wide = |cells: [f32; 6]| Image::from_cells(3, &cells);
        let tall = |cells: [f32; 6]| Image::from_cells(2, &cells);
        let cases = [
            ("", wide([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])),
            ("flip_x = true", wide([3.0, 2.0, 1.0, 6.0, 5.0, 4.0])),
            ("flip_y = true", wide([4.0, 5.0, 6.0, 1.0, 2.0, 3.0])),
            ("flip_x = true\nflip_y = true", wide([6.0, 5.0, 4.0, 3.0, 2.0, 1.0])),
            ("transpose = true", tall([1.0, 4.0, 2.0, 5.0, 3.0, 6.0])),
            ("transpose = true\nflip_x = true", tall([4.0, 1.0, 5.0, 2.0, 6.0, 3.0])),
            ("transpose = true\nflip_y = true", tall([3.0, 6.0, 2.0, 5.0, 1.0, 4.0])),
        ];
        for (params, sensor) in cases {
            let rig = run(params, 3, &device);
            assert_eq!(rig.get::<Image>("image"), Some(&sensor), "{params}");
            assert_eq!((rig.get("sum"), rig.get("peak")), (Some(&21.0), Some(&6.0)), "{params}");
            let Shape::Image(shape) = rig.shape("image") else { panic!("an image") };
            assert_eq!((shape.rows, shape.cols), (sensor.rows(), sensor.cols()), "{params}");
            let pitch = if params.contains("transpose") { [0.002, 0.001] } else { [0.001, 0.002] };
            assert_eq!(shape.pitch, pitch, "{params}");
        }
    }

    #[test]
    fn an_image_without_tactels_is_refused() {
        for (rows, cols) in [(0, 0), (0, 4), (4, 0)] {
            let refused = NodeRig::new::<TactileSource>("", &[("image", shape(rows, cols))]);
            assert_eq!(places("", &refused), ["shape-mismatch: `in.image`"], "{rows} by {cols}");
        }
    }

    #[test]
    fn the_sum_of_counts_is_exact_where_f32_is_not() {
        let mut cells = vec![1.0; 4097];
        cells[4000] = 16_777_216.0;
        let rig = run("", 4097, &cells);
        assert_eq!(rig.get::<Scalar>("sum"), Some(&16_781_312.0));
    }

    proptest! {
        #[test]
        fn sum_and_peak_include_every_tactel(cells in prop::collection::vec(-5000..5000i32, 1..300), flip in any::<bool>()) {
            let image: Vec<f32> = cells.iter().map(|count| *count as f32).collect();
            let rig = run(&format!("flip_x = {flip}"), image.len(), &image);
            prop_assert_eq!(rig.get::<Scalar>("sum"), Some(&f64::from(cells.iter().sum::<i32>())));
            prop_assert_eq!(rig.get::<Scalar>("peak"), Some(&f64::from(*cells.iter().max().unwrap())));
        }
    }
}
