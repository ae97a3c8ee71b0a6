//! Tests with a pad of known curves: logged, calibrated, written to a file, and read by the node.

use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::signal::{Image, ImageShape};

use super::log::Log;
use super::report::{CalibrationReport, Settings, TactelStatus, calibrate};
use super::samples::LoadKind;
use super::testing::{MAX_FORCE_N, Pad, max_force};
use super::*;
use crate::touch::calibrate::Calibrate;

const DEAD: [usize; 3] = [3, 17, 40];

fn settings(load: LoadKind, curve: Option<CurveKind>) -> Settings {
    Settings { load, curve, dead_below: None, bearing: None }
}

fn made(log: Log, load: LoadKind, curve: Option<CurveKind>) -> CalibrationReport {
    calibrate(&[log], &settings(load, curve)).unwrap()
}

/// Returns the node with a calibration file.
fn node(calibration: &Calibration, name: &str) -> NodeRig {
    let path = std::env::temp_dir().join(format!("tactflow-round-trip-{}-{name}.toml", std::process::id()));
    std::fs::write(&path, file::write(calibration, "a test")).unwrap();
    let Calibration { rows, cols, reading: unit, .. } = *calibration;
    let shape = ImageShape { rows, cols, pitch: [0.005; 2], unit };
    let rig = NodeRig::new::<Calibrate>(&format!("file = '{}'", path.display()), &[("image", shape.into())]);
    std::fs::remove_file(path).unwrap();
    rig.unwrap()
}

/// Returns the errors of the node's forces in a log of a uniform load [N]: overall, and of the worst tactel.
fn errors(pad: &Pad, log: &Log, rig: &mut NodeRig) -> (f64, f64) {
    let live = pad.truths.iter().filter(|truth| !truth.is_dead).count() as f64;
    let mut squares = vec![0.0; log.tactels()];
    for (frame, cells) in log.cells.chunks_exact(log.tactels()).enumerate() {
        rig.set("image", Image::from_cells(log.cols, cells));
        rig.step();
        for (i, cell) in rig.get::<Image>("image").unwrap().cells().iter().enumerate() {
            let truth = if pad.truths[i].is_dead { 0.0 } else { log.force[frame] / live };
            squares[i] += (f64::from(*cell) - truth).powi(2) / log.frames() as f64;
        }
    }
    let overall = (squares.iter().sum::<f64>() / live).sqrt();
    (overall, squares.iter().fold(0.0_f64, |worst, square| worst.max(square.sqrt())))
}

/// Returns the errors of the exact inverse of each tactel's middle curve: only hysteresis, noise and quantisation.
fn least(pad: &Pad, log: &Log) -> f64 {
    let live: Vec<usize> = (0..log.tactels()).filter(|i| !pad.truths[*i].is_dead).collect();
    let mut sum = 0.0;
    for frame in 0..log.frames() {
        for i in &live {
            let force = pad.truths[*i].force(f64::from(log.reading(frame, *i)));
            sum += (force - log.force[frame] / live.len() as f64).powi(2);
        }
    }
    (sum / (log.frames() * live.len()) as f64).sqrt()
}

#[test]
fn a_known_pad_is_recovered_through_file_and_node() {
    // Load, hysteresis of the pad, maximum error overall and of the worst tactel [N of 5 N].
    let cases = [
        (LoadKind::Uniform, 0.1, 0.26, 0.35, 2.0),
        (LoadKind::Probe, 0.1, 0.26, 0.35, 2.0),
        (LoadKind::Uniform, 0.0, 0.025, 0.1, 15.0),
        (LoadKind::Probe, 0.0, 0.025, 0.1, 15.0),
    ];
    for (load, hysteresis, overall, worst, better) in cases {
        let mut pad = Pad { hysteresis, ..Pad::new(8, 8, &DEAD, 7) };
        let log = if load == LoadKind::Uniform { pad.uniform(4, 250) } else { pad.probe(2, 100, 0.2) };
        let fresh = pad.uniform(3, 200);
        let least = least(&pad, &fresh);
        let figures = curve::KINDS.map(|kind| {
            let report = made(log.clone(), load, Some(kind));
            assert_eq!(report.kind(), kind);
            errors(&pad, &fresh, &mut node(&report.calibration, &format!("{load:?}-{hysteresis}-{kind}")))
        });
        let (linear, _) = figures[0];
        for (all, tactel) in &figures[1..] {
            assert!(*all < overall && *tactel < worst, "{load:?} {hysteresis}: {figures:?}");
            assert!(*all < 1.35 * least, "the exact inverse leaves {least}: {figures:?}");
            assert!(linear > better * all, "{figures:?}");
        }
    }
}

#[test]
fn hysteresis_and_dead_tactels_are_found() {
    for (load, hysteresis, seed) in [
        (LoadKind::Uniform, 0.05, 1),
        (LoadKind::Uniform, 0.2, 2),
        (LoadKind::Probe, 0.1, 3),
        (LoadKind::Probe, 0.15, 4),
    ] {
        let mut pad = Pad { hysteresis, ..Pad::new(8, 8, &DEAD, seed) };
        // One is stuck at the maximum reading, one at zero.
        (pad.truths[17].offset, pad.truths[40].offset) = (4095.0, 0.0);
        let log = if load == LoadKind::Uniform { pad.uniform(3, 200) } else { pad.probe(3, 80, 0.25) };
        let report = made(log, load, None);
        let dead: Vec<usize> = report.with_status(TactelStatus::Dead).iter().map(|[i, j]| i * 8 + j).collect();
        assert_eq!(dead, DEAD, "{load:?}");
        assert!(report.with_status(TactelStatus::Few).is_empty() && report.with_status(TactelStatus::Unfit).is_empty());
        for (i, finding) in report.findings.iter().enumerate().filter(|(i, _)| !DEAD.contains(i)) {
            let found = finding.hysteresis.unwrap();
            let tolerance = if finding.is_saturated { 0.05 } else { 0.02 };
            assert!((found - hysteresis).abs() < tolerance, "{load:?}, tactel {i}: {found} for {hysteresis}");
        }
    }
}

#[test]
fn a_tactel_below_the_minimum_response_is_dead() {
    let mut pad = Pad::new(2, 4, &[], 5);
    pad.truths[6].a *= 0.1;
    let log = pad.uniform(2, 100);
    let dead = |dead_below| {
        let settings = Settings { dead_below, ..settings(LoadKind::Uniform, None) };
        calibrate(std::slice::from_ref(&log), &settings).unwrap().with_status(TactelStatus::Dead)
    };
    assert_eq!(dead(None), Vec::<[usize; 2]>::new());
    assert_eq!(dead(Some(500.0)), [[1, 2]]);
    // A cell that the recording marks as absent is dead, whatever its reading.
    let absent = Log { absent: vec![0], ..log.clone() };
    assert_eq!(made(absent, LoadKind::Uniform, None).with_status(TactelStatus::Dead), [[0, 0]]);
}

#[test]
fn dead_tactels_can_share_the_load() {
    let mut pad = Pad { hysteresis: 0.0, ..Pad::new(4, 4, &[0, 1, 2, 3], 6) };
    let log = pad.uniform(2, 100);
    let settings = Settings { bearing: Some(16), ..settings(LoadKind::Uniform, None) };
    let report = calibrate(std::slice::from_ref(&log), &settings).unwrap();
    assert!((report.most - MAX_FORCE_N * 12.0 / 16.0).abs() < 0.01, "{}", report.most);
    assert!((made(log, LoadKind::Uniform, None).most - MAX_FORCE_N).abs() < 0.01);
}

#[test]
fn a_sensor_with_falling_readings_is_calibrated() {
    let mut pad = Pad { hysteresis: 0.0, is_falling: true, ..Pad::new(4, 4, &[5], 8) };
    let log = pad.uniform(3, 150);
    let fresh = pad.uniform(1, 100);
    for kind in curve::KINDS {
        let report = made(log.clone(), LoadKind::Uniform, Some(kind));
        assert_eq!(report.with_status(TactelStatus::Dead), [[1, 1]]);
        let (overall, _) = errors(&pad, &fresh, &mut node(&report.calibration, &format!("falling-{kind}")));
        assert!(overall < if kind == CurveKind::Linear { 0.6 } else { 0.03 }, "{kind}: {overall} N");
    }
}

#[test]
fn a_saturated_tactel_is_calibrated_below_saturation() {
    let mut pad = Pad { hysteresis: 0.0, ..Pad::new(2, 3, &[], 9) };
    // It saturates at 4095 counts, at about 2.2 N.
    (pad.truths[4].a, pad.truths[4].b, pad.truths[4].offset) = (9000.0, 3.0, 300.0);
    let report = made(pad.uniform(2, 250), LoadKind::Uniform, Some(CurveKind::Rational));
    let saturated: Vec<bool> = report.findings.iter().map(|finding| finding.is_saturated).collect();
    assert_eq!(saturated, [false, false, false, false, true, false]);
    let Some(Tactel { curve, offset }) = &report.calibration.tactels[4] else { panic!("it has a curve") };
    let end = 3.0 * 3795.0 / (9000.0 - 3795.0);
    assert!((f64::from(max_force(curve)) - end).abs() < 0.05, "{curve:?}");
    let force = curve.force(pad.truths[4].middle(1.0) as f32 - offset);
    assert!((force - 1.0).abs() < 0.02, "{force} N for 1 N");
}

#[test]
fn a_falling_sensor_saturates_at_its_lowest_reading_and_a_dwell_is_no_saturation() {
    let mut falling = Pad { hysteresis: 0.0, is_falling: true, ..Pad::new(2, 3, &[], 9) };
    (falling.truths[4].a, falling.truths[4].b, falling.truths[4].offset) = (9000.0, 3.0, 300.0);
    let report = made(falling.uniform(2, 250), LoadKind::Uniform, None);
    assert_eq!(report.findings.iter().position(|finding| finding.is_saturated), Some(4));
    assert_eq!(report.findings.iter().filter(|finding| finding.is_saturated).count(), 1);

    // Without noise, a constant force repeats the maximum reading.
    let mut pad = Pad { hysteresis: 0.0, noise: 0.0, ..Pad::new(1, 2, &[], 9) };
    let mut log = pad.uniform(1, 100);
    let (top, tactels) = (50 + 99, log.tactels());
    for _ in 0..20 {
        log.force.push(log.force[top]);
        let held = log.cells[top * tactels..(top + 1) * tactels].to_vec();
        log.cells.extend(held);
    }
    let report = made(log, LoadKind::Uniform, None);
    assert!(report.findings.iter().all(|finding| !finding.is_saturated), "nothing is past its end");
}

#[test]
fn tactels_that_were_not_pressed_are_left_out() {
    let mut pad = Pad::new(4, 4, &[], 10);
    let whole = pad.probe(1, 60, 0.2);
    // Each tactel has 10 unloaded frames and 120 of its press: the log covers the first six tactels.
    let frames = 6 * 130 + 40;
    let log =
        Log { force: whole.force[..frames].to_vec(), cells: whole.cells[..frames * 16].to_vec(), ..whole.clone() };
    let report = made(log, LoadKind::Probe, None);
    let good: Vec<usize> = (0..16).filter(|i| report.calibration.tactels[*i].is_some()).collect();
    assert!(good.starts_with(&[0, 1, 2, 3, 4, 5]) && good.len() <= 7, "{good:?}");
    // Two logs together are equivalent to one.
    let rest =
        Log { force: whole.force[6 * 130..].to_vec(), cells: whole.cells[6 * 130 * 16..].to_vec(), ..whole.clone() };
    let first = Log { force: whole.force[..6 * 130].to_vec(), cells: whole.cells[..6 * 130 * 16].to_vec(), ..whole };
    let report = calibrate(&[first, rest], &settings(LoadKind::Probe, None)).unwrap();
    assert!(report.calibration.tactels.iter().all(Option::is_some));
}

#[test]
fn a_uniform_load_is_not_accepted_as_a_probe() {
    for (rows, cols, dead) in [(4, 4, &[][..]), (1, 2, &[]), (3, 5, &[0, 7])] {
        let log = Pad::new(rows, cols, dead, 5).uniform(3, 60);
        let message = calibrate(std::slice::from_ref(&log), &settings(LoadKind::Probe, None)).unwrap_err();
        assert!(message.starts_with("most tactels respond equally to most presses"), "{message}");
    }
    // A probe on one tactel, with foam that transmits a part of the force to its neighbours.
    let mut pad = Pad::new(3, 3, &[], 6);
    let mut log = pad.probe(1, 60, 0.15);
    let (frames, tactels) = (130 * 5, log.tactels());
    log.force[..frames - 130].fill(0.0);
    let rest = log.cells[..10 * tactels].repeat((frames - 130) / 10);
    log.cells[..rest.len()].copy_from_slice(&rest);
    log.force.truncate(frames);
    log.cells.truncate(frames * tactels);
    let report = made(log, LoadKind::Probe, None);
    assert_eq!(report.with_status(TactelStatus::Good), [[1, 1]], "only the one in the middle was pressed");
}

#[test]
fn a_log_without_a_live_tactel_is_refused_with_help() {
    let mut pad = Pad::new(2, 2, &[0, 1, 2, 3], 11);
    let log = pad.uniform(1, 50);
    let log = Log { force: log.force.iter().enumerate().map(|(i, _)| if i < 50 { 0.0 } else { 3.0 }).collect(), ..log };
    for (load, way_out) in [
        (LoadKind::Probe, "if the load was uniform, add `--load uniform`"),
        (LoadKind::Uniform, "if a probe loaded one tactel at a time, remove `--load uniform`"),
    ] {
        let message = calibrate(std::slice::from_ref(&log), &settings(load, None)).unwrap_err();
        assert!(message.contains("4 tactels do not respond") && message.contains(way_out), "{message}");
    }
    assert_eq!(calibrate(&[], &settings(LoadKind::Probe, None)).unwrap_err(), "there is no log");
}

#[test]
fn the_simplest_curve_that_is_good_enough_is_chosen() {
    let mut pad = Pad { hysteresis: 0.0, ..Pad::new(2, 3, &[], 12) };
    assert_eq!(made(pad.uniform(2, 200), LoadKind::Uniform, None).kind(), CurveKind::Rational);
    // Saturation below the noise: a line is good enough.
    for truth in &mut pad.truths {
        (truth.a, truth.b) = (2000.0 * 4000.0 / MAX_FORCE_N, 4000.0);
    }
    assert_eq!(made(pad.uniform(2, 200), LoadKind::Uniform, None).kind(), CurveKind::Linear);
    // A knee that no rational curve fits.
    let knee = |force: f64| if force < 2.0 { 200.0 * force } else { 400.0 + 800.0 * (force - 2.0) };
    let mut log = pad.uniform(2, 200);
    for (i, cells) in log.cells.chunks_exact_mut(6).enumerate() {
        let force = log.force[i] / 6.0;
        cells.iter_mut().for_each(|cell| *cell = 300.0 + knee(force.max(0.0)).round() as f32);
    }
    let report = made(log, LoadKind::Uniform, None);
    assert_eq!(report.kind(), CurveKind::Piecewise);
    assert!(report.rms[2] < 0.05 && report.rms[1] > 0.2, "{:?}", report.rms);
}

#[test]
fn the_report_has_results_with_units() {
    let mut pad = Pad::new(4, 4, &[7], 13);
    let report = made(pad.uniform(2, 100), LoadKind::Uniform, None);
    let text = report.text(false);
    for part in [
        "15 of 4 x 4 tactels calibrated, readings in raw, forces up to 5.0",
        "* rational ",
        " N  ",
        "hysteresis   median 1",
        " % of the range of the reading",
        " raw, unloaded",
        "dead         1 do not respond: [1, 3]",
        "saturated    ",
        "the worst tactels, rational curve",
        "force [N]     range [raw]   RMS [N]   RMS [%]   hysteresis [%]",
    ] {
        assert!(text.contains(part), "no {part:?} in\n{text}");
    }
    assert_eq!(report.text(true).lines().count() - text.lines().count(), 10, "all of 15 instead of 5");
    let only_up = {
        let log = pad.uniform(1, 100);
        let upto = 150;
        Log { force: log.force[..upto].to_vec(), cells: log.cells[..upto * 16].to_vec(), ..log }
    };
    let text = made(only_up, LoadKind::Uniform, None).text(true);
    assert!(text.contains("hysteresis   not measured") && text.lines().last().unwrap().ends_with(" -"), "{text}");
}

#[cfg(feature = "cli")]
#[test]
fn the_picture_shows_residuals_by_branch_and_a_map() {
    let mut pad = Pad::new(3, 4, &[7], 14);
    let report = made(pad.uniform(2, 100), LoadKind::Uniform, None);
    let svg = plot::svg(&report);
    let of = |class: &str| svg.matches(&format!("class=\"{class}\"")).count();
    assert_eq!((of("dead"), of("worst"), of("left-out")), (1, 3, 0));
    let map = svg.split("class=\"map\"").nth(1).unwrap().split("</g>").next().unwrap();
    assert_eq!(map.matches("<rect").count(), 12, "a square for each tactel");
    let lines: Vec<&str> = svg.lines().filter(|line| line.starts_with("<polyline")).collect();
    // Two bands and the median of each branch, the line of zero, four quantiles, three curves, and the lines beside the names.
    assert_eq!(lines.len(), 2 * 3 + 1 + 4 + 3 + (2 + 4 + 3));
    for line in lines {
        let points = line.split('"').nth(1).unwrap();
        let inside = |point: &str| {
            let (x, y) = point.split_once(',').unwrap();
            let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
            (83.0..=961.0).contains(&x) && (40.0..=887.0).contains(&y)
        };
        assert!(points.split(' ').all(inside), "{line}");
    }
    let (worst, part) = report.parts().into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    let name = format!("worst [{}, {}], {:.1} %<", worst / 4, worst % 4, 100.0 * part);
    assert!(svg.contains(&name) && svg.contains(&format!("the worst: [{}, {}]", worst / 4, worst % 4)), "{name}");
    assert!(svg.contains(">reading [raw]<") && svg.contains(">relative error [%]<"));
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
}
