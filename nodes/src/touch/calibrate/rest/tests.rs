//! The self-test on pads whose readings alternate by a known amount about a known zero.

use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{Flag, Image, ImageShape, Scalar, Unit};

use super::super::Calibrate;

const ROWS: usize = 5;
const COLS: usize = 6;
const FRAMES: usize = 40;
/// Calibrated zero of all tactels.
const ZERO: f32 = 100.0;

/// The reading of a tactel, by the number of the frame and the one of the tactel.
type Reading<'a> = &'a dyn Fn(usize, usize) -> f32;

/// A tactel whose readings have the mean `mean` and the standard deviation `noise` in each half.
fn steady(frame: usize, mean: f32, noise: f32) -> f32 {
    mean + if frame.is_multiple_of(2) { noise } else { -noise }
}

fn sound(frame: usize, _: usize) -> f32 {
    steady(frame, ZERO, 1.0)
}

fn rig(params: &str) -> NodeRig {
    let shape = ImageShape { rows: ROWS, cols: COLS, pitch: [0.005; 2], unit: Unit::RAW };
    let params = format!("offset = {ZERO}\nrest_frames = {FRAMES}\n{params}");
    NodeRig::new::<Calibrate>(&params, &[("image", shape.into())]).unwrap()
}

fn show(rig: &mut NodeRig, cells: impl Fn(usize) -> f32) {
    let cells: Vec<f32> = (0..ROWS * COLS).map(cells).collect();
    rig.set("image", Image::from_cells(COLS, &cells));
    rig.step_ms(4.0);
}

/// Shows frames from number `from` on.
fn rest(rig: &mut NodeRig, frames: std::ops::Range<usize>, reading: Reading<'_>) {
    for frame in frames {
        show(rig, |tactel| reading(frame, tactel));
    }
}

fn image(rig: &NodeRig, port: &str) -> Option<Vec<f32>> {
    rig.get::<Image>(port).map(|image| image.cells().to_vec())
}

fn number(rig: &NodeRig, port: &str) -> f64 {
    *rig.get::<Scalar>(port).expect("the test is over")
}

/// The tactel in that row and column.
const fn at(row: usize, col: usize) -> usize {
    row * COLS + col
}

/// Runs both tests, and returns what they have found.
fn found(params: &str, reading: Reading<'_>) -> (Option<bool>, String) {
    let mut rig = rig(params);
    rest(&mut rig, 0..2 * FRAMES, reading);
    (rig.get::<Flag>("failed").copied(), rig.found().expect("a test has a finding"))
}

#[test]
fn the_image_is_absent_until_the_test_has_passed_and_then_has_the_zero_at_rest() {
    let mut rig = rig("tare_bound = 5.0\ngain = 2.0");
    let reading = |frame, tactel| steady(frame, ZERO + 0.1 * tactel as f32, 1.0);
    rest(&mut rig, 0..FRAMES - 1, &reading);
    assert_eq!((image(&rig, "image"), image(&rig, "repaired")), (None, None));
    assert_eq!(rig.found().unwrap(), "self-test: 39 of 40 frames so far");
    rest(&mut rig, FRAMES - 1..FRAMES, &reading);
    // The last of 40 frames is one below its mean.
    for cell in image(&rig, "image").expect("the test has passed") {
        assert!((cell - -2.0).abs() < 1e-3, "{cell}");
    }
    assert_eq!(image(&rig, "image"), image(&rig, "repaired"));
    assert_eq!(rig.get::<Flag>("failed"), Some(&false));
    assert_eq!(number(&rig, "bad"), 0.0);
    assert!((number(&rig, "noise") - 1.0).abs() < 1e-4, "{}", number(&rig, "noise"));
    assert!((number(&rig, "shift") - 2.9).abs() < 1e-4, "that of the last tactel: {}", number(&rig, "shift"));
    assert_eq!(rig.found().unwrap(), "self-test: noise 1.0000 raw, zeros off by at most 2.9000 raw, no bad tactel");
}

#[test]
fn without_a_bound_the_zeros_stay() {
    let mut rig = rig("");
    rest(&mut rig, 0..FRAMES, &|frame, _| steady(frame, 300.0, 1.0));
    assert_eq!(image(&rig, "image"), Some(vec![199.0; ROWS * COLS]));
}

#[test]
fn what_is_wrong_with_a_tactel_is_named() {
    // 6 standard deviations of the difference of two means of 20 frames are 6 sqrt(4 / 40) = 1.897.
    let half = |frame: usize| f32::from(u8::from(frame % FRAMES >= FRAMES / 2));
    let drift = move |frame: usize, by: f32| steady(frame, ZERO + by * half(frame), 1.0);
    let cases: [(Reading<'_>, &str); 8] = [
        (&|_, _| 0.0, "1 bad: [2, 3] is dead"),
        (&|_, _| 4095.0, "1 bad: [2, 3] is stuck at 4095 raw"),
        (&|_, _| ZERO, "1 bad: [2, 3] is stuck at 100 raw"),
        (&|frame, _| steady(frame, ZERO, 8.1), "1 bad: [2, 3] has a noise of 8.1000 raw"),
        (&|frame, _| steady(frame, ZERO, 7.9), "no bad tactel"),
        (&move |frame, _| drift(frame, 1.91), "1 bad: [2, 3] drifts by 1.9100 raw in 20 frames"),
        (&move |frame, _| drift(frame, -1.91), "1 bad: [2, 3] drifts by -1.9100 raw in 20 frames"),
        (&move |frame, _| drift(frame, 1.88), "no bad tactel"),
    ];
    for (bad, expected) in cases {
        let reading = |frame, tactel| if tactel == at(2, 3) { bad(frame, tactel) } else { sound(frame, tactel) };
        let (failed, text) = found("tare_bound = 20.0", &reading);
        assert_eq!(failed, Some(false), "{text}");
        assert!(text.ends_with(expected), "{text}: {expected}");
    }
}

#[test]
fn one_frame_of_garbage_changes_nothing_wherever_it_is() {
    for garbage in 0..FRAMES {
        let mut rig = rig("tare_bound = 5.0");
        let reading = |frame: usize, tactel: usize| {
            if frame == garbage { (tactel * 137 % 4096) as f32 } else { sound(frame, tactel) }
        };
        rest(&mut rig, 0..FRAMES, &reading);
        let zeros = image(&rig, "image").unwrap_or_else(|| panic!("frame {garbage}: {:?}", rig.found()));
        show(&mut rig, |_| ZERO);
        let read = image(&rig, "image").unwrap();
        // Without the highest and the lowest of 20 readings, two of 18 are left over: 2 / 18, in one half of two.
        assert!(read.iter().all(|cell| cell.abs() < 0.056), "frame {garbage}: {read:?} after {zeros:?}");
        assert_eq!(number(&rig, "bad"), 0.0);
    }
}

#[test]
fn a_pad_that_must_not_be_used_is_a_fault_with_its_cause() {
    let off = |by: f32, is_off: fn(usize) -> bool| {
        move |frame: usize, tactel: usize| steady(frame, if is_off(tactel) { ZERO + by } else { ZERO }, 1.0)
    };
    let stuck = |is_bad: fn(usize) -> bool| {
        move |frame: usize, tactel: usize| if is_bad(tactel) { 9.0 } else { sound(frame, tactel) }
    };
    let cases: [(Reading<'_>, &str); 6] = [
        (
            &off(5.1, |tactel| tactel == at(4, 1)),
            "something touches the pad: before any motion, 1 tactel is more than 5 raw above the zero, the \
             farthest is [4, 1] by 5.1000 raw; free the pad and start again, or calibrate it again if nothing touches it",
        ),
        (
            &off(-5.1, |tactel| tactel == at(4, 1)),
            "the calibration does not fit the pad: at rest, 1 tactel is more than 5 raw off the zero, the farthest \
             is [4, 1] by -5.1000 raw; name the calibration of this pad, or calibrate it again",
        ),
        (
            &off(60.0, |tactel| tactel < 16),
            "the calibration does not fit the pad: at rest, 16 tactels are more than 5 raw off the zero, the farthest \
             is [0, 0] by 60.0000 raw; name the calibration of this pad, or calibrate it again",
        ),
        (
            &off(60.0, |tactel| tactel < 15),
            "something touches the pad: before any motion, 15 tactels are more than 5 raw above the zero, the \
             farthest is [0, 0] by 60.0000 raw; free the pad and start again, or calibrate it again if nothing touches it",
        ),
        (
            &stuck(|tactel| [at(0, 0), at(2, 2), at(4, 4)].contains(&tactel)),
            "3 tactels are bad, but at most 2 may be: [0, 0] is stuck at 9 raw, [2, 2] is stuck at 9 raw, [4, 4] is \
             stuck at 9 raw; free the pad if something touches it, or repair it",
        ),
        (
            &stuck(|tactel| [at(2, 2), at(3, 2)].contains(&tactel)),
            "the bad tactels [2, 2] and [3, 2] are side by side, so a contact there is not felt; repair the pad",
        ),
    ];
    for (reading, expected) in cases {
        assert_eq!(found("tare_bound = 5.0\nmax_bad = 2", reading), (Some(true), expected.to_owned()));
    }
    let corner = stuck(|tactel| [at(2, 2), at(3, 3)].contains(&tactel));
    assert_eq!(found("max_bad = 2", &corner).0, Some(false), "a corner is no side");
    assert_eq!(found("", &corner).0, Some(true), "one in fifty of 30 is 1");
}

#[test]
fn a_pad_that_failed_stays_without_an_image_and_a_disturbance_is_forgiven() {
    let touched = |frame: usize, _| steady(frame, ZERO + 50.0, 1.0);
    let mut rig = rig("tare_bound = 5.0");
    rest(&mut rig, 0..FRAMES, &touched);
    assert_eq!((rig.get::<Flag>("failed"), image(&rig, "image")), (None, None), "it is tested again");
    rest(&mut rig, FRAMES..2 * FRAMES, &sound);
    assert_eq!((rig.get::<Flag>("failed"), image(&rig, "image").is_some()), (Some(&false), true));
    let mut rig = self::rig("tare_bound = 5.0");
    rest(&mut rig, 0..2 * FRAMES, &touched);
    rest(&mut rig, 0..4 * FRAMES, &sound);
    assert_eq!((rig.get::<Flag>("failed"), image(&rig, "image")), (Some(&true), None));
}

#[test]
fn a_dead_tactel_of_the_calibration_is_not_tested() {
    let reading = |frame, tactel| if tactel < 2 { 0.0 } else { sound(frame, tactel) };
    assert_eq!(found("tare_bound = 5.0\nmax_bad = 0\ndead = [[0, 0], [0, 1]]", &reading).0, Some(false));
    assert_eq!(found("tare_bound = 5.0\nmax_bad = 0\ndead = [[0, 0]]", &reading).0, Some(true));
}

#[test]
fn a_pad_that_repeats_its_readings_has_no_bad_tactels_but_is_touched() {
    let reading = |_, tactel| if tactel == at(1, 1) { ZERO + 4.0 } else { ZERO };
    assert_eq!(found("tare_bound = 5.0\nmax_bad = 0", &reading).0, Some(false));
    let (failed, text) = found("tare_bound = 3.0\nmax_bad = 0", &reading);
    assert!(failed == Some(true) && text.starts_with("something touches the pad"), "{text}");
}

#[test]
fn features_see_the_mean_of_the_sides_and_limits_see_no_force_of_a_stuck_tactel() {
    let bad = [at(0, 0), at(2, 2)];
    let mut rig = rig("tare_bound = 5.0\nmax_bad = 2");
    rest(&mut rig, 0..FRAMES, &|frame, tactel| if bad.contains(&tactel) { 4095.0 } else { sound(frame, tactel) });
    // A plane: the mean of four sides is the value between them, and that of the two sides of the corner is known.
    let force = |tactel: usize| (10 * (tactel / COLS) + tactel % COLS) as f32;
    let press = |tactel: usize| if bad.contains(&tactel) { 4095.0 } else { ZERO + force(tactel) };
    show(&mut rig, press);
    let (raw, repaired) = (image(&rig, "image").unwrap(), image(&rig, "repaired").unwrap());
    for tactel in 0..ROWS * COLS {
        let expected = match tactel {
            0 => [0.0, 5.5],
            _ if tactel == at(2, 2) => [0.0, 22.0],
            _ => [force(tactel); 2],
        };
        assert_eq!([raw[tactel], repaired[tactel]], expected, "{tactel}");
    }
    // What is stuck later is a pin, for all that the pad knows.
    for _ in 0..10 * FRAMES {
        show(&mut rig, |tactel| if tactel == at(3, 4) { 4095.0 } else { press(tactel) });
    }
    assert_eq!(image(&rig, "image").unwrap()[at(3, 4)], 4095.0 - ZERO);
    assert_eq!(image(&rig, "repaired").unwrap()[at(3, 4)], 4095.0 - ZERO);
}

#[test]
fn a_pad_that_was_gone_goes_on_with_its_zeros_even_in_contact() {
    let mut rig = rig("tare_bound = 5.0");
    rest(&mut rig, 0..FRAMES, &|frame, _| steady(frame, ZERO + 3.0, 1.0));
    rig.lose("image");
    rig.step_ms(500.0);
    assert_eq!(image(&rig, "image"), None);
    show(&mut rig, |_| 503.0);
    assert_eq!(image(&rig, "image"), Some(vec![400.0; ROWS * COLS]));
}

#[test]
fn a_test_of_a_few_frames_is_refused() {
    let shape = ImageShape { rows: ROWS, cols: COLS, pitch: [0.005; 2], unit: Unit::RAW };
    let refused = NodeRig::new::<Calibrate>("rest_frames = 7", &[("image", shape.into())]);
    assert_eq!(places("rest_frames = 7", &refused), ["bad-value: `rest_frames`"]);
}
