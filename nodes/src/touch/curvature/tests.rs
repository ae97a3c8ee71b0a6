//! `curvature` against curves that are drawn on a pad, and against a least-squares solution by nalgebra.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::random::Random;
use tactflow_runtime::signal::{Grid, Unit};

use super::*;

const ROWS: usize = 24;
const COLS: usize = 28;
const PITCH: [f64; 2] = [0.004, 0.005];
/// Any line at all.
const ANY: &str = "min_anisotropy = 0.0\nmin_length_m = 1e-9\nmin_radius_m = 1e-9";

fn image_shape() -> ImageShape {
    ImageShape { rows: ROWS, cols: COLS, pitch: PITCH, unit: Unit::NEWTON }
}

fn built(params: &str) -> Result<NodeRig, Mistakes> {
    let shape = image_shape();
    let wires = [
        ("region", Grid::from(&shape).into()),
        ("image", shape.into()),
        ("twist", tactflow_runtime::signal::TwistShape.into()),
    ];
    NodeRig::new::<Curvature>(params, &wires)
}

/// Shows an image whose values are a function of the place [m]; the region is where they are at least 0.01. Returns the
/// turn, the length and the rate.
fn show(rig: &mut NodeRig, value: &dyn Fn(f64, f64) -> f64) -> [Option<f64>; 3] {
    let shape = image_shape();
    let (mut image, mut region) = (Image::zeros(ROWS, COLS), Mask::empty(ROWS, COLS));
    for (i, j) in (0..ROWS).flat_map(|i| (0..COLS).map(move |j| (i, j))) {
        let value = value(shape.x(j as f64), shape.y(i as f64));
        image.cells_mut()[i * COLS + j] = value as f32;
        if value >= 0.01 || value.is_nan() {
            region.insert(i, j);
        }
    }
    rig.set("image", image);
    rig.set("region", region);
    rig.step();
    ["turn", "length", "rate"].map(|output| rig.get::<Scalar>(output).copied())
}

/// Returns x, y and the direction that the last image has.
fn place(rig: &NodeRig) -> [Option<f64>; 3] {
    ["x", "y", "orientation"].map(|output| rig.get::<Scalar>(output).copied())
}

/// The print of a line n = c s² whose axis is at an angle to x: a bell across the line and a squared cosine along it,
/// with the standard deviation of a uniform bar of this `length`.
fn line(c: f64, length: f64, angle: f64) -> impl Fn(f64, f64) -> f64 {
    let (sine, cosine) = libm::sincos(angle);
    // The variance of a squared cosine up to its zeros at ±h is h² (1/3 - 2/pi²).
    let h = length / (12.0 * (1.0 / 3.0 - 2.0 / PI.powi(2))).sqrt();
    move |x, y| {
        let (s, n) = (cosine * x + sine * y, cosine * y - sine * x);
        let (along, across) = (libm::cos(0.5 * PI * s / h), (n - c * s * s) / 0.004);
        if s.abs() <= h { along * along * libm::exp(-0.5 * across * across) } else { 0.0 }
    }
}

#[test]
fn a_parabola_has_its_curvature_at_any_angle() {
    for degrees in [-80.0_f64, -45.0, -10.0, 0.0, 30.0, 60.0] {
        for curvature in [-12.0, -4.0, 0.0, 5.0, 10.0] {
            let value = line(0.5 * curvature, 0.07, degrees.to_radians());
            let [turn, length, _] = show(&mut built("").unwrap(), &value).map(Option::unwrap_or_default);
            let found = turn / length;
            assert!((found - curvature).abs() < 0.4 + 0.05 * curvature.abs(), "{degrees}: {found} of {curvature}");
            assert!((length - 0.07).abs() < 0.005, "{degrees}: {length}");
        }
    }
}

#[test]
fn an_arc_has_the_curvature_of_its_circle() {
    for radius in [0.06, 0.1, -0.08] {
        let value = move |x: f64, y: f64| {
            let (from_centre, is_seen) = (libm::hypot(x, y - radius), x.abs() <= 0.032);
            let across = (from_centre - radius.abs()) / 0.004;
            if is_seen { libm::exp(-0.5 * across * across) } else { 0.0 }
        };
        let [turn, length, _] = show(&mut built("").unwrap(), &value).map(Option::unwrap_or_default);
        let expected = (1.0 + 0.054 * (0.064 / radius) * (0.064 / radius)) / radius;
        assert!((turn / length - expected).abs() < 0.05 / radius.abs(), "{radius}: {} of {expected}", turn / length);
    }
}

#[test]
fn a_line_that_bends_is_where_it_is_and_not_at_its_centre_of_gravity() {
    for degrees in [-80.0_f64, -45.0, -10.0, 0.0, 30.0, 60.0, 90.0] {
        for curvature in [-12.0, 0.0, 10.0] {
            let mut rig = built("").unwrap();
            show(&mut rig, &line(0.5 * curvature, 0.07, degrees.to_radians()));
            let [x, y, orientation] = place(&rig).map(Option::unwrap);
            let turned = (orientation - degrees.to_radians()).sin().abs();
            // The centre of gravity is 5 mm beside the bend of 12 1/m.
            assert!(x.hypot(y) < 3e-4 && turned < 0.02, "{degrees}, {curvature}: {x}, {y}, {orientation}");
        }
    }
}

#[test]
fn a_line_is_measured_beside_the_middle_of_the_pad() {
    // A parabola that is pressed more on one side, and one that ends before the middle.
    let (curvature, lopsided) = (8.0, |x: f64| 1.0 + 20.0 * x);
    let bend = |x: f64, y: f64| libm::exp(-0.5 * ((y - 0.5 * curvature * x * x) / 0.004).powi(2));
    let mut rig = built("").unwrap();
    show(&mut rig, &|x, y| if x.abs() < 0.035 { lopsided(x) * bend(x, y) } else { 0.0 });
    let [x, y, orientation] = place(&rig).map(Option::unwrap);
    assert!(x.abs() < 1e-4 && y.abs() < 2e-4 && orientation.abs() < 0.015, "{x}, {y}, {orientation}");
    show(&mut rig, &|x, y| if (0.01..0.05).contains(&x) { bend(x, y) } else { 0.0 });
    let [x, y, orientation] = place(&rig).map(Option::unwrap);
    let (expected_y, expected_angle) = (0.5 * curvature * x * x, libm::atan(curvature * x));
    assert!((x - 0.01).abs() < 3e-3, "{x}");
    assert!((y - expected_y).abs() < 1e-3 && (orientation - expected_angle).abs() < 0.05, "{y}, {orientation}");
}

#[test]
fn a_cubic_follows_a_bend_that_changes() {
    // n = d s³ has no curvature in the middle, and a parabola through it is turned.
    let value =
        |x: f64, y: f64| if x.abs() < 0.03 { libm::exp(-0.5 * ((y - 150.0 * x * x * x) / 0.004).powi(2)) } else { 0.0 };
    let turned = |degree: usize| {
        let mut rig = built(&format!("degree = {degree}")).unwrap();
        show(&mut rig, &value);
        place(&rig)[2].unwrap()
    };
    // For a uniform bar of half the length h, the slope of the parabola is 3/5 d h².
    assert!((turned(2) - 0.6 * 150.0 * 0.03 * 0.03).abs() < 0.01, "{}", turned(2));
    assert!(turned(3).abs() < 0.01, "{}", turned(3));
}

#[test]
fn an_oblique_end_turns_a_cubic_unless_it_counts_little() {
    // A straight line whose ends are cut along columns.
    let turned = |angle: f64, reach: &str| {
        let mut rig = built(&format!("degree = 3{reach}")).unwrap();
        let tilt = libm::tan(angle);
        show(&mut rig, &|x, y| if x.abs() < 0.0225 { libm::exp(-0.5 * ((y - tilt * x) / 0.004).powi(2)) } else { 0.0 });
        (place(&rig)[2].unwrap() - angle).to_degrees().abs()
    };
    for degrees in [5.0_f64, 9.0, -9.0] {
        let (all, near) = (turned(degrees.to_radians(), ""), turned(degrees.to_radians(), "\nreach_m = 0.0225"));
        assert!(all > 0.7 && near < 0.3, "{degrees}: {all} and {near}");
    }
}

#[test]
fn a_contact_that_is_no_line_has_its_centre_of_gravity() {
    let round = |x: f64, y: f64| libm::exp(-0.5 * ((x - 0.003).powi(2) + (y + 0.002).powi(2)) / 6.4e-5);
    let mut rig = built("").unwrap();
    show(&mut rig, &round);
    let [x, y, orientation] = place(&rig);
    assert!((x.unwrap() - 0.003).abs() < 1e-4 && (y.unwrap() + 0.002).abs() < 1e-4, "{x:?}, {y:?}");
    assert_eq!(orientation, None);
    let mut rig = built("min_length_m = 0.05").unwrap();
    assert_eq!(show(&mut rig, &line(0.0, 0.04, 0.3))[0], None);
    assert!((place(&rig)[2].unwrap() - 0.3).abs() < 0.01, "a short line has a direction");
    show(&mut rig, &|_, _| 0.0);
    assert_eq!(place(&rig), [None; 3], "nothing");
}

#[test]
fn the_rate_turns_a_sensor_with_the_line() {
    let mut rig = built("").unwrap();
    let value = line(5.0, 0.07, 0.5);
    let [turn, length, rate] = show(&mut rig, &value).map(Option::unwrap_or_default);
    assert_eq!(rate, 0.0, "no twist has come yet");
    let (sine, cosine) = libm::sincos(0.5);
    // The motion, and its part along the line.
    for ([x, y], v) in
        [([cosine, sine], 1.0), ([-cosine, -sine], -1.0), ([-sine, cosine], 0.0), ([2.0, 0.0], 2.0 * cosine)]
    {
        rig.set("twist", Twist([0.01 * x, 0.01 * y, 0.3, 0.3, 0.3, 0.3].into()));
        let rate = show(&mut rig, &value)[2].unwrap();
        assert!((rate - 0.01 * v * turn / length).abs() < 2e-3, "{x}, {y}: {rate}");
    }
    rig.lose("twist");
    let shown = show(&mut rig, &value);
    assert_eq!((shown[0], shown[2]), (Some(turn), None), "without the twist only the rate is absent");
}

#[test]
fn what_is_no_line_is_absent() {
    type Value = Box<dyn Fn(f64, f64) -> f64>;
    let cases: [(&str, &str, Value); 6] = [
        ("nothing", "", Box::new(|_, _| 0.0)),
        ("a round print", "", Box::new(|x, y| libm::exp(-0.5 * (x * x + y * y) / 6.4e-5))),
        ("a short line", "min_length_m = 0.05", Box::new(line(0.0, 0.04, 0.0))),
        ("a tight bend", "min_radius_m = 0.15", Box::new(line(5.0, 0.07, 0.0))),
        (
            "one tactel",
            ANY,
            Box::new(|x, y| if x.abs() < 0.003 && x > 0.0 && (0.0..0.004).contains(&y) { 1.0 } else { 0.0 }),
        ),
        (
            "a value that is no number",
            "",
            Box::new(|x, y| if x > 0.0 && x < 0.003 { f64::NAN } else { line(5.0, 0.07, 0.0)(x, y) }),
        ),
    ];
    for (what, params, value) in cases {
        assert_eq!(show(&mut built(params).unwrap(), &value), [None; 3], "{what}");
    }
    assert!(show(&mut built("min_length_m = 0.03").unwrap(), &line(0.0, 0.04, 0.0))[0].is_some());
}

#[test]
fn wrong_parameters_are_refused() {
    for (bad, place) in [
        ("threshold = 0.1", "unknown-key: `threshold`"),
        ("weight = \"excess\"", "missing-key: `weight`"),
        ("min_anisotropy = 1.5", "bad-value: `1.5`"),
        ("min_radius_m = 0", "bad-value: `0`"),
        ("reach_m = 0", "bad-value: `0`"),
    ] {
        assert_eq!(places(bad, &built(bad)), [place], "{bad}");
    }
}

/// The curvature of the weighted least-squares polynomial in the axes of the covariance [1/m], and its point [m] and its
/// tangent beside the middle of the pad; `None` without a clear axis.
fn least_squares(
    tactels: &[(f64, Vector2<f64>)],
    degree: usize,
    reach: f64,
) -> Option<(f64, Vector2<f64>, Vector2<f64>)> {
    let sum: f64 = tactels.iter().map(|(weight, _)| weight).sum();
    let centre = tactels.iter().fold(Vector2::zeros(), |sum, (weight, at)| sum + at * *weight) / sum;
    let spread = tactels
        .iter()
        .fold(Matrix2::zeros(), |sum, (weight, at)| sum + (at - centre) * (at - centre).transpose() * *weight)
        / sum;
    let eigen = spread.symmetric_eigen();
    let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let axis = if axis.x < 0.0 { -axis } else { axis };
    let across = Vector2::new(-axis.y, axis.x);
    let length = (12.0 * eigen.eigenvalues.max()).sqrt();
    let at = axis.dot(&-centre).clamp(-0.5 * length, 0.5 * length);
    let near = |place: &Vector2<f64>| (1.0 - ((axis.dot(&(place - centre)) - at) / reach).powi(2)).max(0.0).powi(2);
    let tactels: Vec<_> = tactels.iter().map(|(weight, place)| (weight * near(place), *place)).collect();
    // In centimetres, which is better conditioned.
    let powers = |s: f64| (0..=degree).map(move |k| (100.0 * s).powi(k as i32));
    let rows = DMatrix::from_row_iterator(
        tactels.len(),
        degree + 1,
        tactels.iter().flat_map(|(weight, at)| powers(axis.dot(&(at - centre))).map(|power| weight.sqrt() * power)),
    );
    let right = tactels.iter().map(|(weight, at)| weight.sqrt() * 100.0 * across.dot(&(at - centre)));
    let p = rows.svd(true, true).solve(&DVector::from_iterator(tactels.len(), right), 1e-12).ok()?;
    let s = 100.0 * at;
    let falling = |j: usize, k: usize| ((j - k + 1)..=j).product::<usize>() as f64;
    let derivative = |k: usize| -> f64 { (k..=degree).map(|j| p[j] * falling(j, k) * s.powi((j - k) as i32)).sum() };
    let [n, slope, second] = [0, 1, 2].map(derivative);
    let is_clear = eigen.eigenvalues.max() > 1.2 * eigen.eigenvalues.min() && axis.x > 1e-3;
    let curvature = 100.0 * second / (1.0 + slope * slope).powf(1.5);
    let point = centre + 0.01 * (axis * s + across * n);
    is_clear.then(|| (curvature, point, (axis + across * slope).normalize()))
}

proptest! {
    #[test]
    fn it_is_the_least_squares_curve(
        seed in 0..10_000u64, threshold in 0.3..0.9f64, degree in 2..=3_usize, reach in prop::option::of(0.02..0.06f64),
    ) {
        let mut random = Random::new(seed, 0);
        let cells: Vec<f64> = (0..ROWS * COLS).map(|_| random.uniform(0.0, 1.0)).collect();
        let (cut, tilt) = (random.uniform(0.02, 0.05), random.uniform(-0.5, 0.5));
        // Random values in a band across the pad.
        let shape = &image_shape();
        let value = |x: f64, y: f64| {
            let (i, j) = ((y / PITCH[1] + 11.5).round() as usize, (x / PITCH[0] + 13.5).round() as usize);
            let value = cells[i * COLS + j];
            if (y - tilt * x).abs() < cut && value > threshold { f64::from(value as f32) } else { 0.0 }
        };
        let places = (0..ROWS).flat_map(|i| (0..COLS).map(move |j| (shape.x(j as f64), shape.y(i as f64))));
        let tactels: Vec<_> =
            places.map(|(x, y)| (value(x, y), Vector2::new(x, y))).filter(|(weight, _)| *weight > 0.0).collect();
        prop_assume!(tactels.len() > 10);
        let expected = least_squares(&tactels, degree, reach.unwrap_or(f64::INFINITY));
        prop_assume!(expected.is_some());
        let mut rig = built(&format!("{ANY}\ndegree = {degree}{}", reach.map(|it| format!("\nreach_m = {it:?}")).unwrap_or_default())).unwrap();
        let shown = show(&mut rig, &value);
        let (found, (expected, point, tangent)) = (shown[0].unwrap() / shown[1].unwrap(), expected.unwrap());
        prop_assert!((found - expected).abs() < 1e-6 * (1.0 + expected.abs()), "{} of {}", found, expected);
        let [x, y, orientation] = place(&rig).map(Option::unwrap);
        prop_assert!((Vector2::new(x, y) - point).norm() < 1e-9, "{} {} of {}", x, y, point);
        let (sine, cosine) = libm::sincos(orientation);
        prop_assert!((cosine * tangent.y - sine * tangent.x).abs() < 1e-7, "{} of {}", orientation, tangent);
    }
}
