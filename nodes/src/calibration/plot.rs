//! Draws the curves of all tactels, like Fig. 1 of the paper: the reference force over the reading.
//!
//! The colours have a medium brightness and there is no background, so the picture is readable on light and dark pages.

use tactflow_runtime::cli::svg::{PlotAxis, Svg};

use super::Tactel;
use super::fit::Points;
use super::report::{CalibrationReport, TactelFinding};

/// Size of the picture and of the frame in it.
const SIZE: [f64; 2] = [720.0, 480.0];
const FRAME: [[f64; 2]; 2] = [[64.0, 36.0], [704.0, 424.0]];

/// Maximum number of tactels that are drawn; of more, every second, third, …
const MAX_DRAWN: usize = 1024;

/// Number of points of the mean curve.
const POINTS: usize = 48;

/// Returns the picture of a calibration: each tactel's branches thin, the mean of the fitted curves thick.
#[must_use]
pub fn svg(report: &CalibrationReport) -> String {
    let calibration = &report.calibration;
    let count = report.calibrated().count();
    let drawn = report.calibrated().step_by(count.div_ceil(MAX_DRAWN).max(1));
    let branches: Vec<Vec<[f64; 2]>> =
        drawn.flat_map(|(_, finding, points, tactel)| lines(finding, points, tactel)).collect();
    let mean = mean(report);
    let readings = branches.iter().flatten().chain(&mean).map(|point| point[0]);
    let (min, max) = readings.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    // From zero, unless all curves would be on one side.
    let from = if min > 0.0 && min < 0.5 * max { 0.0 } else { min };
    let x = PlotAxis::linear(from, (from + 1.02 * (max - from)).max(from + 1e-9), [FRAME[0][0], FRAME[1][0]]);
    let y = PlotAxis::linear(0.0, 1.04 * report.most, [FRAME[1][1], FRAME[0][1]]);
    let title = format!(
        "Force over reading, {count} of {} x {} tactels, {} curves",
        calibration.rows,
        calibration.cols,
        report.kind()
    );
    let mut svg = Svg::new(SIZE, &title);
    let x_title = format!("reading [{}]", calibration.reading);
    svg.axes(x, y, [Some(&x_title), Some("reference force on a tactel [N]")]);
    let place = |[reading, force]: &[f64; 2]| [x.at(*reading), y.at(*force)];
    svg.group("fill=\"none\" stroke=\"#3d85c6\" stroke-opacity=\"0.5\" stroke-width=\"0.9\"", |svg| {
        branches.iter().for_each(|line| svg.polyline(line.iter().map(place)));
    });
    svg.group("fill=\"none\" stroke=\"#d9730d\" stroke-width=\"3\" stroke-linejoin=\"round\"", |svg| {
        svg.polyline(mean.iter().map(place));
    });
    let legend = format!("thin: {count} tactels, as measured; thick: mean of the fitted curves");
    svg.text([FRAME[0][0], FRAME[0][1] - 14.0], "start", &legend);
    svg.finish()
}

/// Returns the readings and forces of a tactel: the branch of rising force, then that of falling force.
fn lines(finding: &TactelFinding, points: &Points, tactel: &Tactel) -> [Vec<[f64; 2]>; 2] {
    let place = |[force, s]: [f64; 2]| [f64::from(tactel.offset) + f64::from(finding.sign) * s, force.max(0.0)];
    points.branches().map(|branch| branch.into_iter().map(place).collect())
}

/// Returns the mean reading of the fitted curves of all tactels, force by force.
fn mean(report: &CalibrationReport) -> Vec<[f64; 2]> {
    let mut mean = Vec::new();
    for k in 0..=POINTS {
        let force = report.most * k as f64 / POINTS as f64;
        let reading = |(_, finding, points, tactel): (usize, &TactelFinding, &Points, &Tactel)| {
            let s = tactel.curve.reading(force.min(points.most));
            // Beyond its end a curve has no reading.
            (force <= 1.01 * points.most).then(|| f64::from(tactel.offset) + f64::from(finding.sign) * s)
        };
        let (sum, count) =
            report.calibrated().filter_map(reading).fold((0.0, 0), |(sum, n), reading| (sum + reading, n + 1));
        if count > 0 && count * 10 >= report.calibrated().count() * 9 {
            mean.push([sum / count as f64, force]);
        }
    }
    mean
}
