//! `calibrate` against tables and against its own curves.

use std::sync::Arc;

use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::{At, Mistake};
use tactflow_runtime::signal::{Base, FlagShape, Freshness, Shape, Unit};

use super::*;
use crate::calibration::{Calibration, CurveKind, ForceCurve, Tactel, file};

fn rig(params: &str) -> Result<NodeRig, Mistakes> {
    let shape = ImageShape { rows: 2, cols: 3, pitch: [0.005, 0.004], unit: Unit::RAW };
    NodeRig::new::<Calibrate>(params, &[("image", shape.into())])
}

#[test]
fn a_line_per_tactel() {
    let cases = [
        ("", [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]),
        ("offset = 10", [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]),
        ("gain = 0.5", [5.0, 10.0, 15.0, 20.0, 25.0, 30.0]),
        ("offset = 20\ngain = -2.0", [20.0, 0.0, -20.0, -40.0, -60.0, -80.0]),
        ("offset = [[1, 2, 3], [4, 5, 6]]", [9.0, 18.0, 27.0, 36.0, 45.0, 54.0]),
        ("offset = 10\ngain = [[1, 2, 3], [4, 5, 6]]", [0.0, 20.0, 60.0, 120.0, 200.0, 300.0]),
        ("dead = [[0, 1], [1, 2]]", [10.0, 0.0, 30.0, 40.0, 50.0, 0.0]),
        ("device = { offset = 10, gain = 2 }", [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]),
        // The graph replaces all four parameters of the device, but not its dead tactels.
        (
            "device = { offset = 10, gain = 2, file = \"Cargo.toml\" }\ngain = 3",
            [30.0, 60.0, 90.0, 120.0, 150.0, 180.0],
        ),
        ("device = { dead = [[0, 0]] }\ndead = [[1, 2]]", [0.0, 20.0, 30.0, 40.0, 50.0, 0.0]),
        ("device = { dead = [[0, 0]] }\noffset = 10", [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]),
        ("offset = 100\ndead = [[1, 0]]", [-90.0, -80.0, -70.0, 0.0, -50.0, -40.0]),
    ];
    for (params, calibrated) in cases {
        let mut rig = rig(params).unwrap();
        rig.set("image", Image::from_cells(3, &[10.0, 20.0, 30.0, 40.0, 50.0, 60.0]));
        rig.step();
        assert_eq!(rig.get::<Image>("image"), Some(&Image::from_cells(3, &calibrated)), "{params}");
    }
}

#[test]
fn a_mistake_of_the_device_is_marked_at_device() {
    let cases = [
        ("device = { gain = [[1, 2, 3]] }", "device.gain", "`device.gain` has 1 rows, but the image has 2"),
        ("device = { dead = [[2, 0]] }", "device.dead", "tactel [2, 0] is outside the array of 2 rows by 3 columns"),
        ("device = { unit = \"pounds\" }", "device.unit", "`pounds`"),
    ];
    for (params, at, message) in cases {
        let mistakes = rig(params).err().unwrap();
        assert_eq!((mistakes.len(), &mistakes[0].at), (1, &At::Param(at.into())), "{params}: {mistakes:?}");
        assert!(mistakes[0].message.contains(message), "{params}: {mistakes:?}");
    }
    let mistakes = rig("device = { gain = 2, file = \"Cargo.toml\" }").err().unwrap();
    assert_eq!(mistakes[0].at, At::Key("device.gain".into()), "{mistakes:?}");
}

#[test]
fn the_unit_is_that_of_the_input_unless_it_is_set() {
    for (params, unit) in
        [("", Unit::RAW), ("unit = \"N\"\ngain = 0.01", Unit::NEWTON), ("unit = \"1\"\ngain = 2.0", Unit::ONE)]
    {
        let expected = ImageShape { rows: 2, cols: 3, pitch: [0.005, 0.004], unit };
        assert_eq!(rig(params).unwrap().shape("image"), &Shape::from(expected), "{params}");
    }
}

#[test]
fn every_mistake_is_marked_at_its_parameter() {
    let cases = [
        ("offset = [[1, 2, 3]]", "offset", "`offset` has 1 rows, but the image has 2"),
        ("gain = [[1, 2, 3], [4, 5]]", "gain", "row 1 of `gain` has 2 numbers, but the image has 3 columns"),
        ("gain = 1e39", "gain", "1e39 is too large: a tactel is a 32-bit float"),
        ("offset = [[0, 0, 0], [0, -1e300, 0]]", "offset", "-1e300 is too large"),
        ("unit = \"Nm\"", "unit", "`Nm` is not a unit"),
        ("unit = \"N\"", "unit", "nothing converts the image from `raw` to `N`"),
        ("dead = [[2, 0]]", "dead", "tactel [2, 0] is outside the array of 2 rows by 3 columns"),
        ("dead = [[0, 3]]", "dead", "tactel [0, 3] is outside the array of 2 rows by 3 columns"),
    ];
    for (params, at, message) in cases {
        let mistakes = rig(params).err().unwrap();
        assert_eq!(mistakes.len(), 1, "{params}: {mistakes:?}");
        assert_eq!(mistakes[0].at, At::Param(at.into()), "{params}");
        assert!(mistakes[0].message.starts_with(message), "{params}: {}", mistakes[0].message);
    }
    let all = rig("offset = [[1]]\ngain = 1e39\nunit = \"x\"\ndead = [[9, 9]]").err().unwrap();
    assert_eq!(all.len(), 4, "{all:?}");
    let wrongs = [
        ("gain = \"1\"", "bad-value: `\"1\"`"),
        ("gain = [1]", "bad-value: `1`"),
        ("gain = { from = 1 }", "bad-value: `{ from = 1 }`"),
        ("gain = inf", "bad-value: `inf`"),
        ("dead = [[1]]", "bad-value: `[1]`"),
        ("dead = [[-1, 0]]", "bad-value: `-1`"),
    ];
    for (wrong, place) in wrongs {
        assert_eq!(places(wrong, &rig(wrong)), [place], "{wrong}");
    }
}

#[test]
fn an_image_that_is_always_zero_is_a_mistake() {
    for params in ["gain = 0.0", "gain = [[0, 0, 0], [0, 0, 0]]", "dead = [[0,0],[0,1],[0,2],[1,0],[1,1],[1,2]]"] {
        let mistakes = rig(params).err().unwrap();
        assert!(mistakes[0].message.ends_with("the calibrated image is always zero"), "{params}: {mistakes:?}");
    }
    assert!(rig("gain = [[0, 0, 0], [0, 0.1, 0]]").is_ok());
}

#[test]
fn pressures_become_forces_with_the_area_of_a_tactel() {
    let shape = ImageShape { rows: 1, cols: 2, pitch: [0.005, 0.004], unit: Unit::of(Base::Kilopascal) };
    let mut rig = NodeRig::new::<Calibrate>("unit = 'N'", &[("image", shape.into())]).unwrap();
    rig.set("image", Image::from_cells(2, &[50.0, -50.0]));
    rig.step();
    // 50 kPa on 5 mm by 4 mm is 1 N.
    assert_eq!(rig.get::<Image>("image").unwrap().cells(), [1.0, -1.0]);
}

/// A rig with a calibration file of that text.
fn with_file(name: &str, text: &str, params: &str) -> Result<NodeRig, Mistakes> {
    let path = std::env::temp_dir().join(format!("tactflow-calibrate-{}-{name}.toml", std::process::id()));
    std::fs::write(&path, text).unwrap();
    let rig = rig(&format!("file = '{}'\n{params}", path.display()));
    std::fs::remove_file(path).unwrap();
    rig
}

/// A calibration of two by three tactels, of which the fifth is dead.
fn calibration(kind: CurveKind) -> Calibration {
    let tactel = |i: usize| {
        let by = 1.0 + 0.1 * i as f32;
        let curve = match kind {
            CurveKind::Linear => ForceCurve::Linear { gain: 0.01 * by },
            CurveKind::Rational => ForceCurve::Rational { gain: 0.01 * by, squash: 0.002 * by, most: 3.0 * by },
            CurveKind::Piecewise => {
                let knots = [[40.0, 0.3], [100.0, 1.1], [130.0, 2.0 * by]];
                ForceCurve::Piecewise { knots: knots[..=i % 3].to_vec() }
            }
        };
        (i != 4).then_some(Tactel { offset: 7.5 * by, curve })
    };
    Calibration {
        kind,
        rows: 2,
        cols: 3,
        reading: Unit::RAW,
        unit: Unit::NEWTON,
        tactels: (0..6).map(tactel).collect(),
    }
}

#[test]
fn the_forces_have_the_bits_of_the_curves_in_the_file() {
    for kind in [CurveKind::Linear, CurveKind::Rational, CurveKind::Piecewise] {
        let calibration = calibration(kind);
        let text = file::write(&calibration, "a test");
        let mut rig = with_file(&kind.to_string(), &text, "dead = [[0, 1]]").unwrap();
        let Shape::Image(shape) = rig.shape("image") else { panic!("an image") };
        assert_eq!((shape.rows, shape.cols, shape.unit), (2, 3, Unit::NEWTON));
        for reading in [-1e30, -50.0, 0.0, 7.5, 8.0, 20.0, 60.0, 111.1, 150.0, 1e4, 1e30f32] {
            rig.set("image", Image::from_cells(3, &[reading; 6]));
            rig.step();
            let tactels = calibration.tactels.iter().enumerate();
            let forces = tactels.map(|(i, tactel)| match tactel {
                Some(tactel) if i != 1 => tactel.curve.force(reading - tactel.offset),
                _ => 0.0,
            });
            let forces: Vec<u32> = forces.map(|force| (force + 0.0).to_bits()).collect();
            let cells = rig.get::<Image>("image").unwrap().cells();
            assert_eq!(cells.iter().map(|cell| (cell + 0.0).to_bits()).collect::<Vec<_>>(), forces, "{kind} {reading}");
        }
    }
}

#[test]
fn a_mistake_in_the_file_is_marked_in_the_file_and_a_wrong_file_in_the_graph() {
    let good = file::write(&calibration(CurveKind::Rational), "a test");
    let data = |name: &str, from: &str, to: &str, marked: &str| {
        assert!(good.contains(from), "{from}");
        let damaged = good.replacen(from, to, 1);
        let mistakes = with_file(name, &damaged, "").err().unwrap();
        let [Mistake { at: At::Data { text, span, .. }, .. }] = &mistakes[..] else { panic!("{mistakes:?}") };
        assert_eq!((&text[span.clone()], text), (marked, &Arc::from(damaged.as_str())));
    };
    data("gain", "gain = 0.01,", "gain = 0,", "0");
    data("kind", "kind = \"calibration\"", "kind = \"bench\"", "\"bench\"");
    let cases = [
        (good.clone(), "offset = 0", At::Key("offset".into()), "`offset` and `file` exclude each other"),
        (good.clone(), "gain = 1", At::Key("gain".into()), "`gain` and `file` exclude each other"),
        (good.clone(), "unit = 'N'", At::Key("unit".into()), "`unit` and `file` exclude each other"),
        (
            good.replace("\"raw\"", "\"kPa\""),
            "",
            At::Param("file".into()),
            "calibrates readings in `kPa`, but the image is in `raw`",
        ),
        (
            file::write(&Calibration { rows: 3, cols: 2, ..calibration(CurveKind::Linear) }, ""),
            "",
            At::Param("file".into()),
            "calibrates 3 by 2 tactels, but the image has 2 by 3",
        ),
    ];
    for (text, params, at, message) in cases {
        let mistakes = with_file("about", &text, params).err().unwrap();
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        assert!(mistakes[0].at == at && mistakes[0].message.ends_with(message), "{mistakes:?}");
    }
    let missing = rig("file = 'nowhere.toml'").err().unwrap();
    assert!(missing[0].message.starts_with("cannot read `nowhere.toml`"), "{missing:?}");
}

/// A pad of one tactel row with wires for tare and contact.
fn tared(params: &str, wires: &[&str]) -> Result<NodeRig, Mistakes> {
    let image = ImageShape { rows: 1, cols: 3, pitch: [0.005; 2], unit: Unit::RAW };
    let mut shapes = vec![("image", Shape::from(image))];
    shapes.extend(wires.iter().map(|wire| (*wire, Shape::from(FlagShape))));
    NodeRig::new::<Calibrate>(params, &shapes)
}

/// Shows a frame with three different readings from `value` on, and returns the calibrated first tactel.
fn frame(rig: &mut NodeRig, value: f32) -> f32 {
    rig.set("image", Image::from_cells(3, &[value, value + 1.0, value + 2.0]));
    rig.step();
    rig.get::<Image>("image").unwrap().cells()[0]
}

const WINDOW: &str = "offset = 10\ngain = 2\ndead = [[0, 2]]\ntare_window = 4";

#[test]
fn the_mean_of_the_window_becomes_the_zero_of_each_tactel() {
    let mut rig = tared(WINDOW, &["tare", "present"]).unwrap();
    rig.set("tare", false);
    rig.set("present", false);
    assert_eq!(frame(&mut rig, 12.0), 4.0);
    rig.set("tare", true);
    for value in [12.0, 13.0, 15.0, 16.0] {
        assert_eq!(frame(&mut rig, value), 2.0 * (value - 10.0), "the old zero holds through the window");
    }
    assert_eq!(frame(&mut rig, 15.0), 2.0, "the mean is 14");
    assert_eq!(rig.get::<Image>("image").unwrap().cells(), [2.0, 2.0, 0.0], "each its own; the dead stay dead");
    for _ in 0..9 {
        assert_eq!(frame(&mut rig, 20.0), 12.0, "a command that stays set is one command");
    }
    rig.set("tare", false);
    frame(&mut rig, 20.0);
    rig.set("tare", true);
    (0..4).for_each(|_| assert_eq!(frame(&mut rig, 20.0), 12.0));
    assert_eq!(frame(&mut rig, 20.0), 0.0, "and the next is another");
    rig.lose("image");
    rig.step_ms(30.0);
    rig.step();
    rig.set("tare", false);
    assert_eq!(frame(&mut rig, 20.0), 20.0, "a long absence restores the calibrated zero");
}

#[test]
fn a_contact_at_any_time_of_the_window_cancels_the_tare() {
    // Frames are numbered from that of the command, which is 1; `present` after a frame is what the next step sees.
    for touched in 0..8 {
        let mut rig = tared(WINDOW, &["tare", "present"]).unwrap();
        let mut last = 0.0;
        for i in 0..10 {
            rig.set("present", i - 1 == touched);
            rig.set("tare", i == 1);
            last = frame(&mut rig, 14.0);
        }
        let is_tared = !(0..=4).contains(&touched);
        assert_eq!(last, if is_tared { 0.0 } else { 8.0 }, "a contact in frame {touched}");
    }
}

#[test]
fn a_tare_waits_until_the_pad_is_known_to_be_unloaded() {
    let mut rig = tared(WINDOW, &["tare", "present"]).unwrap();
    rig.set("tare", true);
    (0..9).for_each(|_| assert_eq!(frame(&mut rig, 14.0), 8.0, "it is unknown whether something touches the pad"));
    rig.set("present", false);
    (0..4).for_each(|_| assert_eq!(frame(&mut rig, 14.0), 8.0, "the command has waited"));
    assert_eq!(frame(&mut rig, 14.0), 0.0);
    rig.set("tare", false);
    frame(&mut rig, 15.0);
    rig.set("tare", true);
    frame(&mut rig, 15.0);
    rig.lose("present");
    (0..9).for_each(|_| assert_eq!(frame(&mut rig, 15.0), 2.0, "lost in the window"));
}

#[test]
fn a_held_frame_counts_once() {
    let mut rig = tared(WINDOW, &["tare", "present"]).unwrap();
    rig.set("present", false);
    rig.set("tare", true);
    for value in [10.0, 10.0, 10.0, 18.0] {
        frame(&mut rig, value);
        rig.step();
        // The loss of an optional wire wakes the node, with the frame it has seen.
        rig.lose("tare");
        rig.step();
        rig.step();
    }
    assert_eq!(frame(&mut rig, 12.0), 0.0, "the mean of four frames is 12");
}

#[test]
fn one_tactel_beyond_the_bound_keeps_all_zeros() {
    for (bound, force) in [("4.9", 8.0), ("5.1", 0.0)] {
        // The second tactel reads 15: five more than calibrated. The third, which reads 16, is dead.
        let mut rig = tared(&format!("{WINDOW}\ntare_bound = {bound}"), &["tare"]).unwrap();
        rig.set("tare", true);
        let last = (0..6).map(|_| frame(&mut rig, 14.0)).last();
        assert_eq!(last, Some(force), "{bound}");
    }
}

#[test]
fn the_first_frames_are_the_zero_if_nothing_touches_the_pad() {
    for (touched, force) in [(None, 0.0), (Some(0), 8.0), (Some(3), 8.0), (Some(4), 0.0)] {
        let mut rig = tared(&format!("{WINDOW}\ntare_at_start = true"), &["present"]).unwrap();
        let mut last = 0.0;
        for i in 0..6 {
            if i > 0 {
                rig.set("present", touched == Some(i - 1));
            }
            last = frame(&mut rig, 14.0);
        }
        assert_eq!(last, force, "{touched:?}");
    }
}

#[test]
fn a_tare_without_a_check_is_refused() {
    let cases = [
        ("", vec!["tare"], At::Input("tare".into())),
        ("tare_at_start = true", vec![], At::Param("tare_at_start".into())),
    ];
    for (params, wires, at) in cases {
        let mistakes = tared(params, &wires).err().unwrap();
        assert_eq!((mistakes.len(), &mistakes[0].at), (1, &at), "{mistakes:?}");
        assert!(tared(&format!("{params}\ntare_bound = 5.0"), &wires).is_ok());
        let watched: Vec<&str> = wires.iter().copied().chain(["present"]).collect();
        assert!(tared(params, &watched).is_ok());
    }
    assert!(tared("", &["present"]).is_ok(), "without a tare `in.present` has no effect");
    for (wrong, place) in [
        ("tare_window = 0", "bad-value: `0`"),
        ("tare_bound = 0", "bad-value: `0`"),
        ("tare_at_start = 1", "bad-value: `1`"),
    ] {
        assert_eq!(places(wrong, &tared(wrong, &["present"])), [place], "{wrong}");
    }
}

#[test]
fn a_command_that_returns_between_two_frames_is_a_new_one() {
    let mut rig = tared(WINDOW, &["tare", "present"]).unwrap();
    rig.set("present", false);
    rig.set("tare", true);
    for value in [16.0, 16.0, 16.0] {
        frame(&mut rig, value);
    }
    rig.lose("tare");
    rig.step();
    rig.set("tare", true);
    (0..4).for_each(|_| assert_eq!(frame(&mut rig, 14.0), 8.0, "the window starts again"));
    assert_eq!(frame(&mut rig, 14.0), 0.0, "without the frames before");
}

#[test]
fn the_loss_of_the_command_makes_no_new_image() {
    let mut rig = tared(WINDOW, &["tare", "present"]).unwrap();
    rig.set("tare", false);
    assert_eq!(frame(&mut rig, 12.0), 4.0);
    rig.lose("tare");
    rig.step();
    assert_eq!(rig.freshness("image"), Freshness::Held, "there was no frame");
    assert_eq!(frame(&mut rig, 13.0), 6.0);
    assert_eq!(rig.freshness("image"), Freshness::New);
}
