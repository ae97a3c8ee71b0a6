//! `mock_pad` against its script.

use proptest::prelude::*;
use tactflow_runtime::signal::Shape;

use super::*;
use crate::devices::testing::{Bench, open, read};

const MS: i64 = 1_000_000;

fn pad(params: &str) -> MockPad {
    let bench = Bench::new(open::<MockPad>(params).unwrap());
    let Some(Shape::Image(shape)) = bench.description.shape("image") else { panic!("an image") };
    let params: Params = read(params);
    let image = bench.description.output("image").unwrap();
    MockPad::new(image, shape.clone(), period_of(params.rate_hz), params)
}

fn image(params: &str, ms: i64) -> (ImageShape, Vec<f32>) {
    let mut bench = Bench::new(open::<MockPad>(params).unwrap());
    bench.exchange(ms * MS);
    let Shape::Image(shape) = bench.description.shape("image").unwrap().clone() else { panic!("an image") };
    let cells = bench.image().cells().to_vec();
    (shape, cells)
}

/// Total, centre of gravity, and direction of the longer principal axis.
fn moments(shape: &ImageShape, cells: &[f32]) -> (f64, [f64; 2], f64) {
    let places = || {
        cells
            .iter()
            .enumerate()
            .map(|(k, cell)| (f64::from(*cell), shape.x((k % shape.cols) as f64), shape.y((k / shape.cols) as f64)))
    };
    let total: f64 = places().map(|(f, ..)| f).sum();
    let mean = |g: &dyn Fn(f64, f64) -> f64| places().map(|(f, x, y)| f * g(x, y)).sum::<f64>() / total;
    let (cx, cy) = (mean(&|x, _| x), mean(&|_, y| y));
    let xy = mean(&|x, y| (x - cx) * (y - cy));
    let difference = mean(&|x, y| (x - cx) * (x - cx) - (y - cy) * (y - cy));
    (total, [cx, cy], 0.5 * libm::atan2(2.0 * xy, difference))
}

proptest! {
    #[test]
    fn on_the_pad_the_force_is_exact_and_the_middle_is_at_its_place(
        x in -0.02..0.02f64, y in -0.02..0.02f64, force in 0.1..100.0f64, radius in 0.008..0.018f64,
    ) {
        let (shape, cells) = image(&format!("press = [{{ at = [{x}, {y}], force = {force}, radius = {radius} }}]"), 0);
        let (total, middle, _) = moments(&shape, &cells);
        prop_assert!((total - force).abs() < 1e-5 * force);
        prop_assert!((middle[0] - x).hypot(middle[1] - y) < 0.0005, "a tenth of a pitch: {:?}", middle);
        prop_assert!(cells.iter().all(|cell| *cell >= 0.0));
    }

    #[test]
    fn a_bar_lies_along_its_angle(angle in -1.5..1.5f64) {
        let (shape, cells) = image(&format!("press = [{{ length = 0.04, angle = {angle} }}]"), 0);
        let (total, _, direction) = moments(&shape, &cells);
        prop_assert!((total - 10.0).abs() < 1e-4);
        prop_assert!((direction - angle).abs() < 0.03, "{} for {}", direction, angle);
    }
}

#[test]
fn a_press_comes_moves_slides_off_and_goes() {
    let script = "press = [{ from_s = 0.1, to_s = 2, at = [0.01, 0], speed = [0.02, -0.01] }]";
    assert_eq!(moments(&image(script, 96).0, &image(script, 96).1).0, 0.0);
    let (shape, cells) = image(script, 600);
    let (total, middle, _) = moments(&shape, &cells);
    assert!((total - 10.0).abs() < 1e-4 && (middle[0] - 0.02).hypot(middle[1] + 0.005) < 0.0005, "{middle:?}");
    let (shape, cells) = image(script, 1600);
    let (total, ..) = moments(&shape, &cells);
    assert!(total > 0.5 && total < 9.5, "half of it is past the edge: {total}");
    assert_eq!(moments(&shape, &image(script, 1996).1).0, 0.0, "all of it");
    let back = "press = [{ to_s = 2 }]";
    assert!(moments(&shape, &image(back, 1996).1).0 > 9.9 && moments(&shape, &image(back, 2000).1).0 == 0.0);
}

#[test]
fn two_presses_add_up_and_a_pad_need_not_be_square() {
    let (shape, cells) = image(
        "rows = 4\ncols = 24\npitch = 0.01\nunit = 'kPa'\npress = [{ at = [-0.08, 0], radius = 0.01 }, { at = [0.08, 0], radius = 0.01 }]",
        0,
    );
    assert_eq!((shape.rows, shape.cols, shape.unit.to_string().as_str()), (4, 24, "kPa"));
    let (total, middle, _) = moments(&shape, &cells);
    assert!((total - 20.0).abs() < 1e-4 && middle[0].abs() < 1e-6);
}

#[test]
fn frames_come_at_their_rate_until_the_script_ends() {
    let mut pad = pad("for_s = 0.01");
    let due = |frame: i64| Some(Due { frame, stamp: frame * 4 * MS, sequence: frame as u64 + 1, is_nan: false });
    assert_eq!((Stepped::next(&pad), pad.due(0), Stepped::next(&pad)), (Some(0), due(0), Some(4 * MS)));
    assert_eq!((pad.due(0), pad.due(3 * MS)), (None, None), "a frame is served once");
    assert_eq!((pad.due(9 * MS), Stepped::next(&pad)), (due(2), None), "the newest wins, and 0.01 s has three frames");
    assert_eq!(pad.due(i64::MAX), None);
}

#[test]
fn glitches() {
    let script = |kind| format!("glitch = [{{ at_s = 0.008, for_s = 0.008, kind = '{kind}' }}]");
    // Frame by frame: what comes at 0, 4, … 20 ms as (stamp [ms], sequence, has a NaN).
    let cases = [
        (
            "repeat",
            [Some((0, 1, false)), Some((4, 2, false)), Some((4, 2, false)), Some((4, 2, false)), Some((16, 5, false))],
        ),
        (
            "freeze",
            [Some((0, 1, false)), Some((4, 2, false)), Some((8, 3, false)), Some((12, 4, false)), Some((16, 5, false))],
        ),
        ("silence", [Some((0, 1, false)), Some((4, 2, false)), None, None, Some((16, 5, false))]),
        (
            "nan",
            [Some((0, 1, false)), Some((4, 2, false)), Some((8, 3, true)), Some((12, 4, true)), Some((16, 5, false))],
        ),
        (
            "back",
            [Some((0, 1, false)), Some((4, 2, false)), Some((0, 3, false)), Some((-4, 4, false)), Some((16, 5, false))],
        ),
    ];
    for (kind, wanted) in cases {
        let mut pad = pad(&script(kind));
        let got = [0, 4, 8, 12, 16].map(|ms| pad.due(ms * MS).map(|due| (due.stamp / MS, due.sequence, due.is_nan)));
        assert_eq!(got, wanted, "{kind}");
    }
    let mut bench = Bench::new(open::<MockPad>(&script("nan")).unwrap());
    bench.exchange(8 * MS);
    assert!(!bench.image().is_finite());
}

#[test]
fn a_frozen_pad_shows_one_image_under_new_stamps() {
    let moving = "press = [{ speed = [0.5, 0] }]\nglitch = [{ at_s = 0.008, for_s = 0.008, kind = 'freeze' }]";
    let mut bench = Bench::new(open::<MockPad>(moving).unwrap());
    let cells = [0, 4, 8, 12, 16].map(|ms| {
        bench.exchange(ms * MS);
        // What was written stays until the next exchange.
        bench.image().cells().to_vec()
    });
    let same: Vec<bool> = cells.windows(2).map(|pair| pair[0] == pair[1]).collect();
    assert_eq!(same, [false, true, true, false]);
    let mut stuck = pad("glitch = [{ at_s = 0, for_s = 1, kind = 'freeze' }]");
    let due = [8, 12].map(|ms| stuck.due(ms * MS).map(|due| (due.frame, due.sequence)));
    assert_eq!(due, [Some((2, 3)), Some((2, 4))], "with its first frame");
}

#[test]
fn an_unplugged_pad_fails_and_stays_failed() {
    let mut bench = Bench::new(open::<MockPad>("glitch = [{ at_s = 0.008, for_s = 0.004, kind = 'unplug' }]").unwrap());
    let mut exchange = |ms: i64| bench.device.exchange(ms * MS, &bench.commands, &mut bench.samples);
    assert_eq!((exchange(0), exchange(4)), (Ok(()), Ok(())));
    for ms in [8, 12, 500] {
        assert_eq!(exchange(ms), Err(DeviceError("a `glitch` with `unplug` disconnected it".into())), "{ms}");
    }
}

#[test]
fn a_silence_has_no_next_frame() {
    let mut silent = pad(
        "glitch = [{ at_s = 0.004, for_s = 1, kind = 'silence' }, { at_s = 0.5, for_s = 1e30, kind = 'silence' }]\nfor_s = 7",
    );
    assert_eq!(silent.due(900 * MS).map(|due| due.frame), Some(0), "the newest before the silence");
    assert_eq!(Stepped::next(&silent), None, "and none after it");
    let mut late = pad("glitch = [{ at_s = 0, for_s = 0.01, kind = 'silence' }]");
    assert_eq!((Stepped::next(&late), late.due(8 * MS)), (Some(12 * MS), None));
    let mut odd = pad("glitch = [{ at_s = 0, for_s = 0.01, kind = 'repeat' }]");
    assert_eq!(odd.due(0), None, "there is no frame to repeat");
}

#[test]
fn bad_settings() {
    let cases = [
        ("unit = 'pound'", "`pound` is not a unit"),
        ("rows = 100000\ncols = 100000", "100000 by 100000 tactels are more than"),
        (
            "press = [{ radius = 0.001 }]",
            "a bump of radius 0.001 m can fit between two tactels: `radius` must be at least the pitch, 0.005 m",
        ),
        ("press = [{ radius = 9 }]", "a bump of 18 m is wider than 256 tactels"),
        ("rate_hz = 1e9", "expected a number from 0.001"),
        (
            "glitch = [{ at_s = 0, for_s = 1, kind = 'sulk' }]",
            "expected one of `repeat`, `freeze`, `silence`, `nan`, `back`, `unplug`, found",
        ),
        ("glitch = [{ at_s = -1, for_s = 1, kind = 'nan' }]", "expected a number, 0 or more"),
    ];
    for (params, message) in cases {
        let mistakes = open::<MockPad>(params).err().expect(params);
        assert!(mistakes.len() == 1 && mistakes[0].message.starts_with(message), "{params}: {mistakes:?}");
    }
    let several = open::<MockPad>("rows = 100000\ncols = 100000\npress = [{ radius = 9 }]").err().unwrap();
    assert_eq!(several.len(), 2);
}

#[test]
fn a_press_with_a_drag_makes_a_pad_with_three_axes() {
    let params = "press = [{ force = 4.0, drag = [0.6, -0.2] }, { at = [0.01, 0.0], force = 2.0 }]";
    let mut bench = Bench::new(open::<MockPad>(params).unwrap());
    assert_eq!(bench.description.roles().collect::<Vec<_>>(), ["three_axis_pad"]);
    bench.exchange(0);
    let output = bench.description.output::<VectorImage>("vectors").unwrap();
    let vectors = bench.samples.get(output).unwrap().cells().to_vec();
    let sums = vectors.iter().fold([0.0_f64; 3], |sums, cell| [0, 1, 2].map(|axis| sums[axis] + f64::from(cell[axis])));
    assert!(sums.iter().zip([0.6, -0.2, 6.0]).all(|(sum, wanted)| (sum - wanted).abs() < 1e-5), "{sums:?}");
    let normal: Vec<f32> = vectors.iter().map(|[.., z]| *z).collect();
    assert_eq!(bench.image().cells(), normal, "z is the image, to the last bit");
    let bench = Bench::new(open::<MockPad>("press = [{ force = 4.0 }]").unwrap());
    assert_eq!(bench.description.roles().collect::<Vec<_>>(), ["tactile_pad"]);
}
