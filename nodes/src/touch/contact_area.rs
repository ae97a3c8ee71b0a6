//! `contact_area`: the area of a contact in square metres, counted in tactels and between them.
//!
//! Counting is |R| times the area of a tactel: it jumps by a tactel when one passes the threshold. The finer area is that
//! where the image, interpolated between the tactels, is above the threshold: cubic convolution (R. Keys, "Cubic
//! convolution interpolation for digital image processing", 1981), compared at four by four points a tactel. It is the
//! same quantity with less noise from the lattice, and changes by a sixteenth of a tactel.
//!
//! A tactel that lies in the region with all its neighbours counts whole. Beyond the rim of the pad the image goes on as
//! it is there, so a contact that covers the pad has the area of the pad.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{Image, ImageShape, Mask};
use tactflow_runtime::{inputs, outputs, params};

use super::on_one_array;

params! {
    /// Where the contact ends, for the finer estimate: that of the `binarize`; not given, there is none
    /// [unit of the image].
    threshold: Option<f64>,
}

inputs! {
    /// The image that is interpolated.
    image: Image["U", "A"],
    /// The tactels of the contact, R.
    region: Mask["A"],
}

outputs! {
    /// Number of tactels times the area of one [m²].
    area: Scalar["m2", "A"],
    /// Area where the interpolated image is above `threshold` [m²]; absent when that is not given.
    interpolated: Scalar["m2", "A"],
}

/// The array, and where a contact ends.
pub struct ContactArea {
    shape: ImageShape,
    threshold: Option<f64>,
}

impl tactflow_runtime::node::Describe for ContactArea {
    const NAME: &'static str = "contact_area";
    const SUMMARY: &'static str = "measures the area of a contact in square metres";
    const DOC: &'static str = "`area` is the number of tactels of the region times the area of one, the pitch along x \
        times the pitch along y. It jumps by a whole tactel whenever one passes the threshold, though the contact \
        hardly changed.\n\n\
        `interpolated` is finer: the area where the image, interpolated between the tactels (cubic convolution, R. Keys \
        1981), is above `threshold`, compared at 16 points a tactel. The foam spreads a contact, so the image is smooth \
        between the tactels and tells where the threshold is crossed. Give it the threshold of the `binarize` (its \
        `release`, if it has one), so that both speak of the same contact. For Gaussian prints anywhere between the \
        tactels, its error is 0.6 of the count's at a radius of less than two tactels and a fifth at four. Without \
        `threshold` it is absent.\n\n\
        Both are areas of the print that the foam has spread, and grow with the force: an edge without any width has an \
        area too. Both are absent without a region; `area` of `moments` is the count in tactels.";
    const EXAMPLE: &'static str = r#"
[nodes.contact_area]
type = "contact_area"
in.image = "calibrate.image"
in.region = "label.region"
threshold = 0.010                   # as the `release` of the `binarize` [N]
"#;
}

impl Node for ContactArea {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = setup.inputs.image.clone();
        on_one_array(&shape, "region", &setup.inputs.region)?;
        Ok(Self { shape, threshold: params.threshold })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let tactel = self.shape.pitch[0] * self.shape.pitch[1];
        out.area.set(inputs.region.count() as f64 * tactel);
        if let Some(threshold) = self.threshold {
            out.interpolated.set(interpolated(&inputs.image, &inputs.region, threshold) * tactel);
        }
    }
}

/// Points along a tactel's side at which the interpolated image is compared.
const POINTS: usize = 4;
/// Tactels that a point between two centres is interpolated from, with one to spare on either side.
const TAPS: usize = 5;

/// Weights of a tactel and its neighbours at each point along its side (R. Keys 1981, a = -1/2).
const WEIGHTS: [[f64; TAPS]; POINTS] = weights();

const fn weights() -> [[f64; TAPS]; POINTS] {
    let mut weights = [[0.0; TAPS]; POINTS];
    let mut point = 0;
    while point < POINTS {
        let place = (point as f64 + 0.5) / POINTS as f64 - 0.5;
        let mut tap = 0;
        while tap < TAPS {
            weights[point][tap] = cubic((place - (tap as f64 - 2.0)).abs());
            tap += 1;
        }
        point += 1;
    }
    weights
}

/// Weight of a tactel at a distance of that many tactels.
const fn cubic(away: f64) -> f64 {
    if away < 1.0 {
        (1.5 * away - 2.5) * away * away + 1.0
    } else if away < 2.0 {
        ((-0.5 * away + 2.5) * away - 4.0) * away + 2.0
    } else {
        0.0
    }
}

/// Area where the interpolated image is above the threshold, in and next to the region [tactels].
fn interpolated(image: &Image, region: &Mask, threshold: f64) -> f64 {
    let (rows, cols) = (image.rows(), image.cols());
    let [top, bottom, left, right] = bounds(region);
    let mut points = 0;
    for i in top.saturating_sub(1)..(bottom + 1).min(rows) {
        for j in left.saturating_sub(1)..(right + 1).min(cols) {
            points += match neighbours(region, i, j) {
                0 => 0,
                9 => POINTS * POINTS,
                _ => points_above(image, region, threshold, i, j),
            };
        }
    }
    points as f64 / (POINTS * POINTS) as f64
}

/// First row, first row past the region, first column, first column past it; nothing of an empty region.
fn bounds(region: &Mask) -> [usize; 4] {
    let [mut top, mut bottom, mut left, mut right] = [usize::MAX, 0, usize::MAX, 0];
    for i in 0..region.rows() {
        for (k, word) in region.row(i).iter().enumerate().filter(|(_, word)| **word != 0) {
            (top, bottom) = (top.min(i), i + 1);
            left = left.min(64 * k + word.trailing_zeros() as usize);
            right = right.max(64 * (k + 1) - word.leading_zeros() as usize);
        }
    }
    [top, bottom, left, right]
}

/// How many of a tactel and its eight neighbours are in the region; beyond the rim of the pad it goes on.
fn neighbours(region: &Mask, i: usize, j: usize) -> usize {
    let (last_row, last_col) = (region.rows() - 1, region.cols() - 1);
    let rows = [i.saturating_sub(1), i, (i + 1).min(last_row)];
    let cols = [j.saturating_sub(1), j, (j + 1).min(last_col)];
    rows.into_iter().map(|i| cols.into_iter().filter(|j| region.contains(i, *j)).count()).sum()
}

/// At how many points of a tactel the interpolated image is above the threshold.
fn points_above(image: &Image, region: &Mask, threshold: f64, i: usize, j: usize) -> usize {
    let at = |k: usize, tap: usize, all: usize| (k + tap).saturating_sub(2).min(all - 1);
    // What is above the threshold but of another region is not counted here: it reaches up to the threshold only.
    let value = |i: usize, j: usize| {
        let value = f64::from(image.row(i)[j]) - threshold;
        if region.contains(i, j) { value } else { value.min(0.0) }
    };
    let mut columns = [[0.0; TAPS]; POINTS];
    for tap in 0..TAPS {
        for col in 0..TAPS {
            let value = value(at(i, tap, image.rows()), at(j, col, image.cols()));
            for (column, weights) in columns.iter_mut().zip(&WEIGHTS) {
                column[col] += weights[tap] * value;
            }
        }
    }
    let dot = |a: &[f64; TAPS], b: &[f64; TAPS]| a.iter().zip(b).fold(0.0, |sum, (a, b)| sum + a * b);
    columns.iter().map(|column| WEIGHTS.iter().filter(|weights| dot(column, weights) > 0.0).count()).sum()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Grid, Scalar, Shape, Unit};

    use super::super::binarize::binarize;
    use super::*;
    use crate::random::Random;

    const PITCH: [f64; 2] = [0.005, 0.004];
    const TACTEL: f64 = PITCH[0] * PITCH[1];

    /// Shapes of an image of `rows` by `cols`, and of a mask of `mask_cols` columns.
    fn wires(rows: usize, cols: usize, mask_cols: usize) -> [(&'static str, Shape); 2] {
        let image = ImageShape { rows, cols, pitch: PITCH, unit: Unit::NEWTON };
        [("region", Grid { cols: mask_cols, ..Grid::from(&image) }.into()), ("image", image.into())]
    }

    fn rig(params: &str, rows: usize, cols: usize) -> NodeRig {
        NodeRig::new::<ContactArea>(params, &wires(rows, cols, cols)).unwrap()
    }

    /// Both areas in tactels, of an image whose region is what is above the threshold.
    fn areas(rows: usize, cols: usize, threshold: f64, value: impl Fn(usize, usize) -> f64) -> (f64, f64) {
        let cells: Vec<f32> = (0..rows * cols).map(|at| value(at / cols, at % cols) as f32).collect();
        let mut region = Mask::empty(rows, cols);
        binarize(&cells, threshold as f32, &mut region);
        areas_of(&format!("threshold = {threshold:?}"), Image::from_cells(cols, &cells), region)
    }

    fn areas_of(params: &str, image: Image, region: Mask) -> (f64, f64) {
        let mut rig = rig(params, image.rows(), image.cols());
        rig.set("image", image);
        rig.set("region", region);
        rig.step();
        (*rig.get::<Scalar>("area").unwrap() / TACTEL, *rig.get::<Scalar>("interpolated").unwrap() / TACTEL)
    }

    #[test]
    fn a_tactel_amid_its_region_counts_whole_though_the_image_dips_there() {
        // As a hysteresis may leave it: the middle is in the region, but below the threshold.
        let (mut image, mut region) = (Image::zeros(7, 7), Mask::empty(7, 7));
        for (i, j) in (2..5).flat_map(|i| (2..5).map(move |j| (i, j))) {
            image.cells_mut()[i * 7 + j] = if (i, j) == (3, 3) { 0.1 } else { 1.0 };
            region.insert(i, j);
        }
        let (_, dipped) = areas_of("threshold = 0.5", image.clone(), region);
        // The other tactels see the middle as it is; the middle itself has all of its sixteen points.
        let mut region = Mask::empty(7, 7);
        (2..5)
            .flat_map(|i| (2..5).map(move |j| (i, j)))
            .filter(|at| *at != (3, 3))
            .for_each(|(i, j)| region.insert(i, j));
        let (_, hollow) = areas_of("threshold = 0.5", image, region);
        assert!(dipped > hollow, "{dipped} and {hollow} tactels");
    }

    #[test]
    fn areas_in_closed_form() {
        let one = |i: usize, j: usize| f64::from(u8::from((i, j) == (3, 4)));
        let corner = |i: usize, j: usize| f64::from(u8::from((i, j) == (0, 0)));
        let half = |_: usize, j: usize| f64::from(u8::from(j < 5));
        let slope = |_: usize, j: usize| j as f64 / 10.0;
        type Value<'a> = &'a dyn Fn(usize, usize) -> f64;
        let cases: [(&str, usize, usize, f64, Value<'_>, f64, f64); 10] = [
            ("a covered pad", 8, 9, 0.5, &|_, _| 1.0, 72.0, 72.0),
            ("a row that is a pad", 1, 7, 0.5, &|_, _| 1.0, 7.0, 7.0),
            ("nothing", 8, 9, 0.5, &|_, _| 0.0, 0.0, 0.0),
            ("half a pad", 8, 10, 0.5, &half, 40.0, 40.0),
            // A straight line stays one, so it crosses at column 3.3: 5/8 of column 3 lie before its first point above.
            ("a slope", 6, 10, 0.33, &slope, 36.0, 6.0 * 6.25),
            ("a slope, a point further", 6, 10, 0.29, &slope, 42.0, 6.0 * 6.5),
            // Weights at 1/8, 3/8, 5/8, 7/8 of the way to the next tactel: 0.964, 0.728, 0.390, 0.091.
            ("a tactel", 8, 9, 0.5, &one, 1.0, 1.0),
            ("a tactel, lower", 8, 9, 0.25, &one, 1.0, 1.0 + 4.0 * 0.25),
            ("a tactel, higher", 8, 9, 0.6, &one, 1.0, 1.0 - 4.0 / 16.0),
            // It goes on beyond the rim: 1.07, 1.05, 0.92, 0.65 across, times 0.346 a step to the side.
            ("a tactel in the corner", 8, 9, 0.25, &corner, 1.0, 1.0 + 2.0 * 3.0 / 16.0),
        ];
        for (what, rows, cols, threshold, value, area, interpolated) in cases {
            let found = areas(rows, cols, threshold, value);
            assert!((found.0 - area).abs() < 1e-9, "{what}: area {}, not {area}", found.0);
            assert!((found.1 - interpolated).abs() < 1e-9, "{what}: {}, not {interpolated}", found.1);
        }
    }

    #[test]
    fn a_gaussian_print_is_better_measured_between_the_tactels() {
        // spread along x and y [tactels], threshold as part of the peak; greatest relative error, and part of the count's
        let cases = [
            (0.8, 0.8, 0.1, 0.08, 0.7),
            (1.2, 1.2, 0.1, 0.02, 0.5),
            (1.5, 2.5, 0.1, 0.01, 0.25),
            (2.5, 2.5, 0.2, 0.01, 0.2),
        ];
        for (sx, sy, threshold, most, part) in cases {
            let exact = PI * sx * sy * 2.0 * libm::log(1.0 / threshold);
            let mut random = Random::new(2, 0);
            let mut squares = [0.0; 2];
            for _ in 0..300 {
                let (x, y) = (7.0 + random.uniform(0.0, 1.0), 7.0 + random.uniform(0.0, 1.0));
                let (area, interpolated) = areas(16, 16, threshold, |i, j| {
                    let (u, v) = ((j as f64 - x) / sx, (i as f64 - y) / sy);
                    libm::exp(-0.5 * (u * u + v * v))
                });
                for (square, area) in squares.iter_mut().zip([area, interpolated]) {
                    *square += (area / exact - 1.0) * (area / exact - 1.0);
                }
            }
            let [counted, finer] = squares.map(|sum: f64| (sum / 300.0).sqrt());
            assert!(finer < most && finer < part * counted, "{sx}, {sy}: {finer:.4}, counted {counted:.4}");
        }
    }

    #[test]
    fn another_region_is_not_counted() {
        let cells = |others: &[usize]| {
            let mut cells = [0.0; 80];
            cells[33] = 1.0;
            others.iter().for_each(|at| cells[*at] = 1.0);
            Image::from_cells(10, &cells)
        };
        let mut region = Mask::empty(8, 10);
        region.insert(3, 3);
        let alone = areas_of("threshold = 0.25", cells(&[]), region.clone());
        assert_eq!(areas_of("threshold = 0.25", cells(&[37, 77]), region.clone()), alone);
        let touching = areas_of("threshold = 0.25", cells(&[44]), region.clone()).1;
        assert!(touching >= alone.1 && touching <= alone.1 + 0.5, "a corner in common: {touching}");
    }

    #[test]
    fn without_a_threshold_tactels_are_counted_only() {
        let mut rig = rig("", 8, 10);
        rig.set("image", Image::zeros(8, 10));
        rig.set("region", Mask::empty(8, 10));
        rig.step();
        assert_eq!((rig.get("area"), rig.get::<Scalar>("interpolated")), (Some(&0.0), None));
        assert!(NodeRig::new::<ContactArea>("threshold = \"1\"", &wires(8, 10, 10)).is_err());
        assert!(NodeRig::new::<ContactArea>("", &wires(8, 10, 9)).is_err(), "two arrays");
    }
}
