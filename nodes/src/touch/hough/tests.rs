//! `hough` on exact lines, at all angles, and on contacts that are no line.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Grid, Image, Mask, Shape, Unit};

use super::*;
use tactflow_runtime::random::Random;

fn wires(rows: usize, cols: usize, pitch: [f64; 2]) -> [(&'static str, Shape); 2] {
    let image = ImageShape { rows, cols, pitch, unit: Unit::NEWTON };
    [("region", Grid::from(&image).into()), ("image", image.into())]
}

/// Returns direction, offset and strength of the tactels with a positive value, on 16 by 16.
fn run(params: &str, pitch: [f64; 2], value: impl Fn(f64, f64) -> f64) -> [Option<f64>; 3] {
    let mut rig = NodeRig::new::<Hough>(params, &wires(16, 16, pitch)).unwrap();
    let (mut image, mut region) = (Image::zeros(16, 16), Mask::empty(16, 16));
    for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
        let value = value(j as f64, i as f64);
        image.cells_mut()[16 * i + j] = value as f32;
        if value > 0.0 {
            region.insert(i, j);
        }
    }
    rig.set("image", image);
    rig.set("region", region);
    rig.step();
    ["orientation", "offset", "strength"].map(|output| rig.get::<Scalar>(output).copied())
}

fn is(holds: bool) -> f64 {
    f64::from(u8::from(holds))
}

#[test]
fn rows_columns_and_diagonals_are_exact() {
    type Value<'a> = &'a dyn Fn(f64, f64) -> f64;
    let cases: [(&str, Value<'_>, f64, f64); 6] = [
        ("a row", &|_, y| is(y == 10.0), 0.0, 0.0125),
        ("a row below the middle", &|x, y| is(y == 3.0 && x > 4.0), 0.0, -0.0225),
        ("two rows", &|_, y| is(y == 10.0 || y == 11.0), 0.0, 0.015),
        ("a column", &|x, _| is(x == 10.0), FRAC_PI_2, -0.0125),
        ("a diagonal", &|x, y| is(y == x), FRAC_PI_4, 0.0),
        ("the other, beside the middle", &|x, y| is(x + y == 19.0), -FRAC_PI_4, 0.02 / 2.0_f64.sqrt()),
    ];
    for (what, value, angle, offset) in cases {
        let [found, away, strength] = run("", [0.005; 2], value);
        assert!((found.unwrap() - angle).abs() < 1e-12, "{what}: {found:?}");
        assert!((away.unwrap() - offset).abs() < 1e-12, "{what}: {away:?}");
        assert!(strength.unwrap() > 0.7, "{what}: {strength:?}");
    }
}

#[test]
fn lines_of_one_tactel_are_found_at_any_angle_and_pitch() {
    for pitch in [[0.005; 2], [0.004, 0.006]] {
        let mut squares = 0.0;
        for degrees in (-89..=90).step_by(7) {
            let (sine, cosine) = libm::sincos(f64::from(degrees).to_radians());
            let away = |x: f64, y: f64| ((y - 7.8) * pitch[1] * cosine - (x - 7.1) * pitch[0] * sine).abs();
            let [found, offset, _] = run("", pitch, |x, y| (1.0 - away(x, y) / 0.006).max(0.0));
            let off = found.unwrap() - f64::from(degrees).to_radians();
            squares += libm::sin(off) * libm::sin(off) / 26.0;
            assert!(libm::sin(off).abs() < 0.045, "{degrees} degrees, pitch {pitch:?}: {found:?}");
            let drawn = 0.3 * pitch[1] * cosine + 0.4 * pitch[0] * sine;
            let side = if libm::cos(off) > 0.0 { 1.0 } else { -1.0 };
            assert!((side * offset.unwrap() - drawn).abs() < 3e-4, "{degrees} degrees, pitch {pitch:?}: {offset:?}");
        }
        // Rows and columns of the pad attract such a line a little.
        assert!(squares.sqrt().to_degrees() < 0.7, "{} degrees, pitch {pitch:?}", squares.sqrt().to_degrees());
    }
}

#[test]
fn a_shift_by_a_tactel_changes_the_offset_only() {
    let mut random = Random::new(4, 0);
    let values: Vec<f64> = (0..256).map(|_| random.uniform(0.0, 1.0)).collect();
    let at = |di: f64, dj: f64| {
        run("min_strength = 0", [0.005, 0.004], |x, y| {
            let (x, y) = (x - dj, y - di);
            let is_in = (1.0..11.0).contains(&x) && (0.5 * x - y + 2.0).abs() < 1.5;
            if is_in { values[(16.0 * y + x) as usize] } else { 0.0 }
        })
        .map(Option::unwrap)
    };
    let [angle, offset, strength] = at(0.0, 0.0);
    for (di, dj) in [(1.0, 0.0), (0.0, 1.0), (4.0, 3.0)] {
        let [shifted, away, strong] = at(di, dj);
        assert!((shifted - angle).abs() < 1e-9 && (strong - strength).abs() < 1e-9, "{di}, {dj}");
        let way = di * 0.004 * libm::cos(angle) - dj * 0.005 * libm::sin(angle);
        assert!((away - offset - way).abs() < 1e-9, "{di}, {dj}: {away}");
    }
}

#[test]
fn without_a_line_orientation_and_offset_are_absent() {
    let disc = |x: f64, y: f64| is(libm::hypot(x - 7.3, y - 7.8) < 4.0);
    let [angle, offset, strength] = run("", [0.005; 2], disc);
    assert_eq!((angle, offset), (None, None));
    assert!(strength.unwrap() < 0.3, "{strength:?}");
    assert_eq!(run("", [0.005; 2], |_, _| 0.0), [None; 3]);
    let tactel = run("min_strength = 0", [0.005; 2], |x, y| is(x == 3.0 && y == 4.0));
    assert_eq!(tactel, [None, None, Some(0.0)], "all directions are equal");
    let faint = run("weight = \"excess\"\nthreshold = 2.0", [0.005; 2], |x, y| is(x == y));
    assert_eq!(faint, [None; 3], "all weights are 0");
    // 3 by 6: half as wide as long
    let bar = |x: f64, y: f64| is((4.0..10.0).contains(&x) && (6.0..9.0).contains(&y));
    for (params, has_line) in [("min_strength = 0.35", true), ("min_strength = 0.55", false)] {
        let [angle, _, strength] = run(params, [0.005; 2], bar);
        assert_eq!(angle.is_some(), has_line, "{params}: {strength:?}");
    }
}

#[test]
fn wrong_parameters_are_refused() {
    let cases = [
        ("offset_step = 0.0049", At::Param("offset_step".into())),
        ("weight = \"excess\"", At::Param("weight".into())),
        ("threshold = 1.0", At::Key("threshold".into())),
    ];
    for (params, at) in cases {
        let mistakes = NodeRig::new::<Hough>(params, &wires(4, 4, [0.005, 0.004])).err().unwrap();
        assert_eq!((mistakes.len(), &mistakes[0].at), (1, &at), "{params}");
    }
    let flat = NodeRig::new::<Hough>("", &wires(4, 4, [0.0; 2])).err().unwrap();
    assert_eq!(flat[0].at, At::Input("image".into()));
    for (bad, place) in [
        ("angles = 7", "bad-value: `7`"),
        ("offset_step = 0", "bad-value: `0`"),
        ("min_strength = 1.1", "bad-value: `1.1`"),
    ] {
        assert_eq!(places(bad, &NodeRig::new::<Hough>(bad, &wires(4, 4, [0.005; 2]))), [place], "{bad}");
    }
}
