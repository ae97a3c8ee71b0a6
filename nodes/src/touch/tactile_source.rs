//! `tactile_source`: a pad's image in the sensor's frame, with what a guard must know of the whole of it.
//!
//! Row i runs along the sensor's +y and column j along +x; devices count otherwise, so rows and columns may change
//! places and be taken in reverse. `sum` and `peak` read every tactel and not a chosen region: force ceilings and the
//! checks of recordings hang on them. The sum is made in f64, in lanes whose number is fixed: exact for whole counts,
//! and the same bits on every machine.

use tactflow_runtime::node::{Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::ImageShape;
use tactflow_runtime::{inputs, outputs, params};

params! {
    /// Whether rows and columns change places, before any flip.
    transpose: bool = false,
    /// Whether the columns come in reverse order: the device counts them against the sensor's +x.
    flip_x: bool = false,
    /// Whether the rows come in reverse order: the device counts them against the sensor's +y.
    flip_y: bool = false,
}

inputs! {
    /// The newest image, as the pad counts its rows and columns [the pad's unit].
    image: Image["U", "A"],
}

outputs! {
    /// The image in the sensor's frame: row i along +y, column j along +x [the pad's unit].
    image: Image["U", "A"],
    /// Sum over the whole image [the pad's unit].
    sum: Scalar["U", "A"],
    /// Greatest tactel of the whole image [the pad's unit].
    peak: Scalar["U", "A"],
}

const LANES: usize = 8;

/// Where each tactel comes from; nothing if the pad counts as the sensor does.
pub struct TactileSource {
    order: Option<Box<[u32]>>,
}

impl tactflow_runtime::node::Describe for TactileSource {
    const NAME: &'static str = "tactile_source";
    const SUMMARY: &'static str = "takes a pad's image into the sensor's frame, with its sum and its peak";
    const DOC: &'static str = "The first node behind a pad. Everything after it counts rows along the sensor's +y and \
        columns along its +x, from the middle of the pad, with z out of the pad toward the object. Devices count \
        otherwise: `transpose` exchanges rows and columns, then `flip_x` and `flip_y` reverse the columns and the rows. \
        Try it: press the corner toward +x and +y; `x` and `y` of `moments` must both be positive.\n\n\
        `sum` and `peak` read every tactel and not a chosen region, so that a second contact, or one that is too small to \
        count, is seen too: force ceilings hang on them. The sum is exact for whole counts, and has the same bits on every \
        machine.\n\n\
        All outputs are absent while the pad gives nothing. A frame that the pad repeats is not new.";
    const EXAMPLE: &'static str = r#"
[nodes.source]
type = "tactile_source"
in.image = "pad.image"
flip_y = false                      # set it where the device's first row is the one toward +y
"#;
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
        setup.outputs.image = turned(image, params.transpose);
        let is_turned = params.transpose | params.flip_x | params.flip_y;
        Ok(Self { order: is_turned.then(|| order(&setup.outputs.image, &params)) })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let (from, to) = (inputs.image.cells(), out.image.write().cells_mut());
        let (sum, peak) = match &self.order {
            None => copy_sum_and_peak(from, to),
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

fn turned(image: &ImageShape, transpose: bool) -> ImageShape {
    if !transpose {
        return image.clone();
    }
    let [along_x, along_y] = image.pitch;
    ImageShape { rows: image.cols, cols: image.rows, pitch: [along_y, along_x], unit: image.unit }
}

/// Index in the device's image of each tactel of the sensor's.
fn order(sensor: &ImageShape, params: &Params) -> Box<[u32]> {
    let &ImageShape { rows, cols, .. } = sensor;
    let from = |i: usize, j: usize| {
        let i = if params.flip_y { rows - 1 - i } else { i };
        let j = if params.flip_x { cols - 1 - j } else { j };
        (if params.transpose { j * rows + i } else { i * cols + j }) as u32
    };
    (0..rows).flat_map(|i| (0..cols).map(move |j| from(i, j))).collect()
}

/// Sum and greatest of all cells, in eight lanes and a fixed tree: the same bits on every machine.
#[must_use]
pub fn sum_and_peak(cells: &[f32]) -> (f64, f64) {
    let mut lanes = Lanes::default();
    let (chunks, rest) = cells.as_chunks();
    chunks.iter().for_each(|chunk| lanes.add(chunk));
    lanes.finish(rest)
}

/// The same of cells that are copied on the way.
fn copy_sum_and_peak(from: &[f32], to: &mut [f32]) -> (f64, f64) {
    let mut lanes = Lanes::default();
    let ((chunks, rest), (copies, copied)) = (from.as_chunks(), to.as_chunks_mut());
    for (chunk, copy) in chunks.iter().zip(copies) {
        *copy = *chunk;
        lanes.add(chunk);
    }
    copied.copy_from_slice(rest);
    lanes.finish(rest)
}

struct Lanes {
    sums: [f64; LANES],
    peaks: [f32; LANES],
}

impl Default for Lanes {
    fn default() -> Self {
        Self { sums: [0.0; LANES], peaks: [f32::NEG_INFINITY; LANES] }
    }
}

fn greater(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

impl Lanes {
    #[inline]
    #[expect(
        clippy::needless_range_loop,
        reason = "an index into arrays of one length becomes vectors, three iterators do not"
    )]
    fn add(&mut self, chunk: &[f32; LANES]) {
        for lane in 0..LANES {
            self.sums[lane] += f64::from(chunk[lane]);
            self.peaks[lane] = greater(self.peaks[lane], chunk[lane]);
        }
    }

    /// Adds what is left of a last chunk, and the lanes.
    fn finish(mut self, rest: &[f32]) -> (f64, f64) {
        for ((sum, peak), value) in self.sums.iter_mut().zip(&mut self.peaks).zip(rest) {
            *sum += f64::from(*value);
            *peak = greater(*peak, *value);
        }
        let [a, b, c, d, e, f, g, h] = self.sums;
        let sum = ((a + e) + (c + g)) + ((b + f) + (d + h));
        (sum, self.peaks.into_iter().fold(f32::NEG_INFINITY, greater).into())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Image, Scalar, Shape, Unit};

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
    fn the_device_is_turned_into_the_sensors_frame() {
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
    fn an_image_of_nothing_is_refused() {
        for (rows, cols) in [(0, 0), (0, 4), (4, 0)] {
            assert!(NodeRig::new::<TactileSource>("", &[("image", shape(rows, cols))]).is_err(), "{rows} by {cols}");
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
        fn sum_and_peak_read_every_tactel(cells in prop::collection::vec(-5000..5000i32, 1..300), flip in any::<bool>()) {
            let image: Vec<f32> = cells.iter().map(|count| *count as f32).collect();
            let rig = run(&format!("flip_x = {flip}"), image.len(), &image);
            prop_assert_eq!(rig.get::<Scalar>("sum"), Some(&f64::from(cells.iter().sum::<i32>())));
            prop_assert_eq!(rig.get::<Scalar>("peak"), Some(&f64::from(*cells.iter().max().unwrap())));
        }
    }
}
