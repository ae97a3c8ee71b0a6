//! `moments` in closed form, against the eigenvectors of the covariance, and on rendered bars.

use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Grid, Unit};

use super::*;
use tactflow_runtime::random::Random;

const PITCH: [f64; 2] = [0.005, 0.004];

fn rig(params: &str, rows: usize, cols: usize, pitch: [f64; 2]) -> NodeRig {
    let image = ImageShape { rows, cols, pitch, unit: Unit::NEWTON };
    NodeRig::new::<Moments>(params, &[("region", Grid::from(&image).into()), ("image", image.into())]).unwrap()
}

/// Shows an image, and the tactels above `threshold` as the region.
fn show(rig: &mut NodeRig, image: &Image, threshold: f32) {
    let mut region = Mask::empty(image.rows(), image.cols());
    for (at, _) in image.cells().iter().enumerate().filter(|(_, value)| **value > threshold) {
        region.insert(at / image.cols(), at % image.cols());
    }
    rig.set("image", image.clone());
    rig.set("region", region);
    rig.step();
}

fn get(rig: &NodeRig, output: &str) -> Option<f64> {
    rig.get::<Scalar>(output).copied()
}

fn render(rows: usize, cols: usize, value: impl Fn(usize, usize) -> f64) -> Image {
    let cells: Vec<f32> = (0..rows * cols).map(|at| value(at / cols, at % cols) as f32).collect();
    Image::from_cells(cols, &cells)
}

fn assert_near(found: Option<f64>, expected: Option<f64>, what: &str) {
    let is_near = found.zip(expected).map_or(found == expected, |(a, b)| (a - b).abs() < 1e-12);
    assert!(is_near, "{what}: {found:?} is not {expected:?}");
}

#[test]
fn rectangles_in_closed_form() {
    // first row, first column, rows, columns of a patch of 2 N on 16 by 70
    let cases = [(0, 0, 1, 1), (3, 5, 1, 2), (3, 5, 2, 1), (4, 4, 4, 4), (2, 60, 3, 9), (2, 63, 9, 3), (0, 0, 16, 70)];
    for (top, left, rows, cols) in cases {
        let mut rig = rig("min_anisotropy = 0", 16, 70, PITCH);
        let is_in = |i, j| (top..top + rows).contains(&i) && (left..left + cols).contains(&j);
        show(&mut rig, &render(16, 70, |i, j| if is_in(i, j) { 2.0 } else { 0.0 }), 1.0);
        let what = format!("{rows} by {cols}");
        let (r, c) = (rows as f64, cols as f64);
        let (m20, m02) = ((c * c - 1.0) / 12.0 * PITCH[0] * PITCH[0], (r * r - 1.0) / 12.0 * PITCH[1] * PITCH[1]);
        let anisotropy = if rows * cols == 1 { 0.0 } else { (m20 - m02).abs() / (m20 + m02) };
        let orientation = if m20 > m02 { 0.0 } else { FRAC_PI_2 };
        assert_near(get(&rig, "force"), Some(2.0 * r * c), &what);
        assert_near(get(&rig, "area"), Some(r * c), &what);
        assert_near(get(&rig, "pressure"), Some(2.0), &what);
        assert_near(get(&rig, "x"), Some((left as f64 + (c - 1.0) / 2.0 - 34.5) * PITCH[0]), &what);
        assert_near(get(&rig, "y"), Some((top as f64 + (r - 1.0) / 2.0 - 7.5) * PITCH[1]), &what);
        assert_near(get(&rig, "anisotropy"), Some(anisotropy), &what);
        assert_near(get(&rig, "orientation"), (anisotropy > 0.0).then_some(orientation), &what);
    }
}

#[test]
fn an_undefined_feature_is_absent() {
    let disc = |i: usize, j: usize| f64::from(u8::from((i as f64 - 7.5).hypot(j as f64 - 7.5) < 5.0));
    let cases: [(&str, Image, f32, [bool; 4]); 8] = [
        ("nothing", render(16, 16, |_, _| 0.0), 0.0, [false, false, false, false]),
        ("no force", render(16, 16, |_, _| 0.0), -1.0, [true, false, false, false]),
        ("a pull", render(16, 16, |i, _| -(i as f64)), -4.5, [true, false, false, false]),
        ("a tactel", render(16, 16, |i, j| f64::from(u8::from(i == 9 && j == 3))), 0.0, [true, true, true, false]),
        ("a square", render(16, 16, |i, j| f64::from(u8::from(i < 6 && j < 6))), 0.0, [true, true, true, false]),
        ("a disc", render(16, 16, disc), 0.0, [true, true, true, false]),
        ("a line", render(16, 16, |i, _| f64::from(u8::from(i == 9))), 0.0, [true, true, true, true]),
        ("a checked square", render(16, 16, |i, j| ((i + j) % 2) as f64), 0.0, [true, true, true, false]),
    ];
    for (what, image, threshold, present) in cases {
        let mut rig = rig("", 16, 16, [0.005; 2]);
        show(&mut rig, &image, threshold);
        assert!(get(&rig, "force").is_some() && get(&rig, "area").is_some(), "{what}");
        let found = ["pressure", "x", "anisotropy", "orientation"].map(|output| get(&rig, output).is_some());
        assert_eq!(found, present, "{what}");
        assert_eq!(get(&rig, "y").is_some(), present[1], "{what}");
    }
}

#[test]
fn an_orientation_needs_the_smallest_anisotropy() {
    // 2 by 3: (8 - 3) / (8 + 3)
    for (params, has_axis) in [("min_anisotropy = 0.4545", true), ("min_anisotropy = 0.4546", false)] {
        let mut rig = rig(params, 2, 3, [0.005; 2]);
        show(&mut rig, &render(2, 3, |_, _| 1.0), 0.0);
        assert_eq!(get(&rig, "orientation").is_some(), has_axis, "{params}");
        assert_near(get(&rig, "anisotropy"), Some(5.0 / 11.0), params);
    }
}

#[test]
fn the_anisotropy_of_a_line_is_one() {
    let mut random = Random::new(3, 0);
    for round in 0..200 {
        let values: Vec<f64> = (0..16).map(|_| 0.1 + random.uniform(0.0, 1.0)).collect();
        let mut rig = rig("min_anisotropy = 0.999999", 16, 16, PITCH);
        show(&mut rig, &render(16, 16, |i, j| if i == j { values[i] } else { 0.0 }), 0.0);
        let anisotropy = get(&rig, "anisotropy").unwrap();
        assert!(anisotropy <= 1.0, "{anisotropy} in round {round}");
        assert_near(get(&rig, "orientation"), Some(libm::atan2(PITCH[1], PITCH[0])), "along the diagonal");
    }
    let mut rig = rig("min_anisotropy = 1", 2, 3, PITCH);
    show(&mut rig, &render(2, 3, |i, _| i as f64), 0.0);
    assert_eq!((get(&rig, "anisotropy"), get(&rig, "orientation")), (Some(1.0), Some(0.0)));
}

#[test]
fn a_shift_by_a_tactel_is_a_shift_by_the_pitch() {
    let at = |di: usize, dj: usize| {
        let mut rig = rig("", 16, 16, PITCH);
        let blob = |i: usize, j: usize| {
            let (i, j) = (i as f64 - di as f64 - 6.3, j as f64 - dj as f64 - 5.2);
            libm::exp(-(i * i + j * j) / 3.0)
        };
        show(&mut rig, &render(16, 16, blob), 0.1);
        [get(&rig, "x").unwrap(), get(&rig, "y").unwrap()]
    };
    let [x, y] = at(0, 0);
    for (di, dj) in [(0, 1), (1, 0), (3, 4), (2, 5)] {
        let [shifted_x, shifted_y] = at(di, dj);
        assert!((shifted_x - x - dj as f64 * PITCH[0]).abs() < 1e-9, "{di}, {dj}");
        assert!((shifted_y - y - di as f64 * PITCH[1]).abs() < 1e-9, "{di}, {dj}");
    }
}

/// An edge of some length on a pad of 80 by 80 mm, spread by 4 mm of foam, turned about a point off the middle.
fn bar(degrees: f64, length_mm: f64, pitch: [f64; 2]) -> Image {
    let (sine, cosine) = libm::sincos(degrees.to_radians());
    let (cols, rows) = ((0.08 / pitch[0]) as usize, (0.08 / pitch[1]) as usize);
    let foam_mm = 4.0 * SQRT_2;
    render(rows, cols, |i, j| {
        let x = 1e3 * (j as f64 - (cols as f64 - 1.0) / 2.0) * pitch[0] - 1.3;
        let y = 1e3 * (i as f64 - (rows as f64 - 1.0) / 2.0) * pitch[1] + 0.7;
        let (along, across) = (cosine * x + sine * y, cosine * y - sine * x);
        let end = |sign: f64| libm::erf((0.5 * length_mm + sign * along) / foam_mm);
        0.5 * (end(1.0) + end(-1.0)) * libm::exp(-(across / foam_mm).powi(2))
    })
}

/// Root of the mean squared error over all angles [degrees].
fn angle_error(length_mm: f64, pitch: [f64; 2], threshold: f32, noise: f64) -> f64 {
    let mut random = Random::new(7, 0);
    let squares = (-89..=90).map(|degrees| {
        let mut image = bar(f64::from(degrees), length_mm, pitch);
        for cell in image.cells_mut() {
            let gauss = random.normal();
            *cell += (noise * gauss) as f32;
        }
        let mut rig = rig("", image.rows(), image.cols(), pitch);
        show(&mut rig, &image, threshold);
        let error = get(&rig, "orientation").unwrap().to_degrees() - f64::from(degrees);
        let error = error - 180.0 * (error / 180.0).round();
        error * error
    });
    (squares.sum::<f64>() / 180.0).sqrt()
}

#[test]
fn the_orientation_of_a_bar_is_its_angle() {
    // The step at the edge of the mask is what is left without noise; a lower threshold makes it smaller.
    let cases = [
        (40.0, [0.005; 2], 0.003, 0.0, 0.03),
        (40.0, [0.004, 0.006], 0.003, 0.0, 0.03),
        (60.0, [0.005; 2], 0.1, 0.0, 0.2),
        (60.0, [0.005; 2], 0.1, 0.02, 0.3),
        (40.0, [0.005; 2], 0.1, 0.02, 0.6),
    ];
    for (length_mm, pitch, threshold, noise, bound) in cases {
        let error = angle_error(length_mm, pitch, threshold, noise);
        let what = format!("{length_mm} mm, pitch {pitch:?}, threshold {threshold}, noise {noise}");
        assert!(error < bound, "{error} degrees for {what}");
    }
}

#[test]
fn a_weight_changes_position_and_shape_but_neither_force_nor_pressure() {
    // A row of 1, 2 and 6 above a threshold of 0.5: the weighted mean column, and anisotropy 1.
    let image = render(4, 8, |i, j| if i == 2 { [0.0, 0.5, 1.0, 2.0, 6.0, 0.0, 0.0, 0.0][j] } else { 0.0 });
    let cases = [
        ("", (2.0 + 3.0 * 2.0 + 4.0 * 6.0) / 9.0),
        ("weight = \"force\"", (2.0 + 3.0 * 2.0 + 4.0 * 6.0) / 9.0),
        ("weight = \"area\"", 3.0),
        ("weight = \"excess\"\nthreshold = 0.5", (2.0 * 0.5 + 3.0 * 1.5 + 4.0 * 5.5) / 7.5),
        ("weight = \"excess\"\nthreshold = 1.5", (3.0 * 0.5 + 4.0 * 4.5) / 5.0),
    ];
    for (params, column) in cases {
        let mut rig = rig(params, 4, 8, PITCH);
        show(&mut rig, &image, 0.5);
        assert_near(get(&rig, "x"), Some((column - 3.5) * PITCH[0]), params);
        assert_near(get(&rig, "y"), Some(0.5 * PITCH[1]), params);
        let found = ["force", "area", "pressure", "anisotropy", "orientation"].map(|output| get(&rig, output));
        assert_eq!(found, [9.0, 3.0, 3.0, 1.0, 0.0].map(Some), "{params}");
    }
    let mut rig = rig("weight = \"excess\"\nthreshold = 7", 4, 8, PITCH);
    show(&mut rig, &image, 0.5);
    let found = ["force", "pressure", "x", "y", "anisotropy", "orientation"].map(|output| get(&rig, output).is_some());
    assert_eq!(found, [true, true, false, false, false, false], "no tactel is above the threshold");
}

#[test]
fn with_the_excess_as_weight_a_tactel_enters_without_a_jump() {
    // The last tactel of a row passes the threshold: how far the centre jumps.
    let jump = |params: &str| {
        let at = |last: f64| {
            let mut rig = rig(params, 1, 6, PITCH);
            show(&mut rig, &render(1, 6, |_, j| [3.0, 4.0, 3.0, 2.0, last, 0.0][j]), 0.5);
            get(&rig, "x").unwrap()
        };
        at(0.501) - at(0.499)
    };
    assert!(jump("") > 1e-4 && jump("weight = \"excess\"\nthreshold = 0.5") < 5e-6);
}

#[test]
fn wrong_parameters_and_shapes_are_refused() {
    let image = ImageShape { rows: 4, cols: 5, pitch: PITCH, unit: Unit::NEWTON };
    let grid = Grid::from(&image);
    let cases = [
        ("min_anisotropy = -0.1", "bad-value: `-0.1`"),
        ("min_anisotropy = 1.1", "bad-value: `1.1`"),
        ("min_anisotropy = nan", "bad-value: `nan`"),
        ("weight = \"excess\"", "missing-key: `weight`"),
        ("threshold = 0.1", "unknown-key: `threshold`"),
        ("weight = \"area\"\nthreshold = 0.1", "unknown-key: `threshold`"),
        ("weight = 1", "bad-value: `1`"),
    ];
    for (bad, place) in cases {
        let wires = [("image", image.clone().into()), ("region", grid.clone().into())];
        assert_eq!(places(bad, &NodeRig::new::<Moments>(bad, &wires)), [place], "{bad}");
    }
    let other = Grid { rows: 5, ..grid };
    let mistakes = NodeRig::new::<Moments>("", &[("image", image.into()), ("region", other.into())]).err().unwrap();
    assert_eq!(mistakes[0].at, At::Input("region".into()));
}

fn images() -> impl Strategy<Value = Image> {
    let size = (1..12usize, prop_oneof![1..20usize, 60..140usize]);
    size.prop_flat_map(|(rows, cols)| {
        prop::collection::vec(0..4096u16, rows * cols)
            .prop_map(move |cells| Image::from_cells(cols, &cells.into_iter().map(f32::from).collect::<Vec<_>>()))
    })
}

proptest! {
    #[test]
    fn the_axes_are_those_of_the_covariance(image in images(), threshold in 0..4000u16) {
        let threshold = f32::from(threshold);
        let mut rig = rig("min_anisotropy = 0", image.rows(), image.cols(), PITCH);
        show(&mut rig, &image, threshold);
        let place = |at: usize| Vector2::new((at % image.cols()) as f64 * PITCH[0], (at / image.cols()) as f64 * PITCH[1]);
        let region = || {
            let cells = image.cells().iter().enumerate().filter(|(_, value)| **value > threshold);
            cells.map(|(at, value)| (f64::from(*value), place(at)))
        };
        let force: f64 = region().map(|(value, _)| value).sum();
        prop_assert_eq!(get(&rig, "force"), Some(force));
        prop_assert_eq!(get(&rig, "area"), Some(region().count() as f64));
        prop_assume!(force > 0.0);
        let centre = region().fold(Vector2::zeros(), |sum, (value, at)| sum + at * value) / force;
        let middle = place(image.cells().len() - 1) / 2.0;
        assert_near(get(&rig, "x"), Some(centre.x - middle.x), "x");
        assert_near(get(&rig, "y"), Some(centre.y - middle.y), "y");
        let spread = region().fold(Matrix2::zeros(), |sum, (value, at)| sum + (at - centre) * (at - centre).transpose() * value);
        let eigen = spread.symmetric_eigen();
        let long = eigen.eigenvalues.imax();
        let (major, minor) = (eigen.eigenvalues[long], eigen.eigenvalues[1 - long]);
        prop_assume!(region().count() > 1);
        let anisotropy = get(&rig, "anisotropy").unwrap();
        prop_assert!((anisotropy - (major - minor) / (major + minor)).abs() < 1e-9);
        prop_assume!(anisotropy > 1e-3);
        let angle = get(&rig, "orientation").unwrap();
        prop_assert!(angle > -FRAC_PI_2 && angle <= FRAC_PI_2);
        let axis = eigen.eigenvectors.column(long);
        let off = libm::atan2(axis.y, axis.x) - angle;
        prop_assert!(libm::sin(off).abs() < 1e-6, "off by {off}");
    }

    #[test]
    fn a_mirrored_image_mirrors(image in images(), threshold in 0..4000u16) {
        let mirrored = render(image.rows(), image.cols(), |i, j| image.row(i)[image.cols() - 1 - j].into());
        let read = |image: &Image| {
            let mut rig = rig("min_anisotropy = 0.01", image.rows(), image.cols(), PITCH);
            show(&mut rig, image, f32::from(threshold));
            ["x", "y", "anisotropy", "orientation"].map(|output| get(&rig, output))
        };
        let ([x, y, anisotropy, angle], mirror) = (read(&image), read(&mirrored));
        assert_near(mirror[0], x.map(|x| -x), "x");
        assert_near(mirror[1], y, "y");
        prop_assume!(anisotropy.is_some_and(|anisotropy| anisotropy > 0.02));
        let off = mirror[3].unwrap() + angle.unwrap();
        prop_assert!((off - PI * (off / PI).round()).abs() < 1e-9, "off by {off}");
    }
}
