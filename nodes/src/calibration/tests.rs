//! A pad whose curves are known is logged, calibrated, written to a file, and read by the node.

use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::signal::{Image, ImageShape};

use super::log::Log;
use super::report::{Report, Settings, State, calibrate};
use super::samples::Load;
use super::testing::{HYSTERESIS, MOST, Pad};
use super::*;
use crate::touch::calibrate::Calibrate;

const DEAD: [usize; 3] = [3, 17, 40];

fn settings(load: Load, curve: Option<Kind>) -> Settings {
    Settings { load, curve, dead_below: None, bearing: None }
}

fn made(log: Log, load: Load, curve: Option<Kind>) -> Report {
    calibrate(&[log], &settings(load, curve)).unwrap()
}

/// The node with a calibration as a file.
fn node(calibration: &Calibration, name: &str) -> NodeRig {
    let path = std::env::temp_dir().join(format!("tactflow-round-trip-{}-{name}.toml", std::process::id()));
    std::fs::write(&path, file::write(calibration, "a test")).unwrap();
    let Calibration { rows, cols, reading: unit, .. } = *calibration;
    let shape = ImageShape { rows, cols, pitch: [0.005; 2], unit };
    let rig = NodeRig::new::<Calibrate>(&format!("file = '{}'", path.display()), &[("image", shape.into())]);
    std::fs::remove_file(path).unwrap();
    rig.unwrap()
}

/// Errors of the node's forces against the truth in a log of a uniform load [N]: overall, and of the worst tactel.
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

/// The same of the exact inverse of each tactel's middle curve: hysteresis, noise and steps alone.
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
fn a_known_pad_comes_back_through_file_and_node() {
    for (load, name) in [(Load::Uniform, "uniform"), (Load::Probe, "probe")] {
        let mut pad = Pad::new(8, 8, &DEAD, 7);
        let log = if load == Load::Uniform { pad.uniform(4, 250) } else { pad.probe(2, 100, 0.2) };
        let fresh = pad.uniform(3, 200);
        let least = least(&pad, &fresh);
        let mut figures = Vec::new();
        for kind in curve::KINDS {
            let report = made(log.clone(), load, Some(kind));
            let mut rig = node(&report.calibration, &format!("{name}-{kind}"));
            println!("{}", report.text(false));
            figures.push(errors(&pad, &fresh, &mut rig));
        }
        println!("{name}: least {least:.4} N, {figures:.4?}");
    }
}
