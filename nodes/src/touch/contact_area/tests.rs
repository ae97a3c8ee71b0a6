//! `contact_area` in closed form, and on Gaussian prints.

use std::f64::consts::PI;

use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{Grid, Image, ImageShape, Mask, Shape, Unit};

use super::super::binarize::binarize;
use super::*;
use tactflow_runtime::random::Random;

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

/// Returns both areas in tactels, of an image whose region is the tactels above the threshold.
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
fn a_tactel_inside_the_region_counts_whole_even_if_the_image_dips_there() {
    // As a hysteresis may leave it: the middle is in the region, but below the threshold.
    let (mut image, mut region) = (Image::zeros(7, 7), Mask::empty(7, 7));
    for (i, j) in (2..5).flat_map(|i| (2..5).map(move |j| (i, j))) {
        image.cells_mut()[i * 7 + j] = if (i, j) == (3, 3) { 0.1 } else { 1.0 };
        region.insert(i, j);
    }
    let (_, dipped) = areas_of("threshold = 0.5", image.clone(), region);
    // Without the middle in the region, its points are compared one by one.
    let mut region = Mask::empty(7, 7);
    (2..5).flat_map(|i| (2..5).map(move |j| (i, j))).filter(|at| *at != (3, 3)).for_each(|(i, j)| region.insert(i, j));
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
        // The image continues beyond the rim: 1.07, 1.05, 0.92, 0.65 across, times 0.346 a step to the side.
        ("a tactel in the corner", 8, 9, 0.25, &corner, 1.0, 1.0 + 2.0 * 3.0 / 16.0),
    ];
    for (what, rows, cols, threshold, value, area, interpolated) in cases {
        let found = areas(rows, cols, threshold, value);
        assert!((found.0 - area).abs() < 1e-9, "{what}: area {}, not {area}", found.0);
        assert!((found.1 - interpolated).abs() < 1e-9, "{what}: {}, not {interpolated}", found.1);
    }
}

#[test]
fn for_gaussian_prints_the_interpolated_area_is_better() {
    // spread along x and y [tactels], threshold as part of the peak; bounds on the relative error, and on the ratio to the count's
    let cases = [
        (0.8, 0.8, 0.1, 0.08, 0.7),
        (1.2, 1.2, 0.1, 0.02, 0.5),
        (1.5, 2.5, 0.1, 0.01, 0.25),
        (2.5, 2.5, 0.2, 0.01, 0.2),
    ];
    for (sx, sy, threshold, bound, part) in cases {
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
        assert!(finer < bound && finer < part * counted, "{sx}, {sy}: {finer:.4}, counted {counted:.4}");
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
fn without_a_threshold_only_tactels_are_counted() {
    let mut rig = rig("", 8, 10);
    rig.set("image", Image::zeros(8, 10));
    rig.set("region", Mask::empty(8, 10));
    rig.step();
    assert_eq!((rig.get("area"), rig.get::<Scalar>("interpolated")), (Some(&0.0), None));
    let text = "threshold = \"1\"";
    assert_eq!(places(text, &NodeRig::new::<ContactArea>(text, &wires(8, 10, 10))), ["bad-value: `\"1\"`"]);
    assert_eq!(
        places("", &NodeRig::new::<ContactArea>("", &wires(8, 10, 9))),
        ["shape-mismatch: `in.region`"],
        "two arrays"
    );
}
