//! Draws what a calibration is judged by: the residuals of rising and of falling force, a map of all tactels, the relative
//! error at low force, and the curves of single tactels.
//!
//! The colours have a medium brightness and there is no background, so the picture is readable on light and dark pages.
//! Rising and falling force, and the tactels, differ in their dashes too.

mod curves;
mod map;

use tactflow_runtime::cli::figure::{LINE, curve, legend, range};
use tactflow_runtime::cli::svg::{INK, PlotAxis, STYLES, Svg};

use super::report::CalibrationReport;

/// Size of the picture [px].
const SIZE: [f64; 2] = [980.0, 950.0];
/// Left and right ends of the two columns of panels [px].
const COLUMNS: [[f64; 2]; 2] = [[84.0, 480.0], [564.0, 960.0]];
/// Tops and bottoms of the two rows of panels [px].
const ROWS: [[f64; 2]; 2] = [[84.0, 400.0], [570.0, 886.0]];

/// Number of bins of force for the medians.
const BINS: usize = 24;
/// Smallest force of the relative error, as a fraction of the maximum force.
const LOWEST: f64 = 0.01;

/// The branches: their names, and their numbers among the styles of curves.
const BRANCHES: [&str; 2] = ["rising force", "falling force"];

/// The residuals of a tactel, by branch: force [N], and error of the force [N].
type Residuals = [Vec<[f64; 2]>; 2];

/// Returns the picture of a calibration.
#[must_use]
pub fn svg(report: &CalibrationReport) -> String {
    let calibration = &report.calibration;
    let [rows, cols, count] = [calibration.rows, calibration.cols, report.calibrated().count()];
    let title = format!("Calibration: {count} of {rows} x {cols} tactels, {} curves", report.kind());
    let mut svg = Svg::new(SIZE, &title);
    svg.text([COLUMNS[0][0], 18.0], "start", &title);
    let residuals = residuals(report);
    draw_residuals(&mut svg, report, &residuals);
    map::draw(&mut svg, report, COLUMNS[1], ROWS[0]);
    draw_relative(&mut svg, report, &residuals);
    curves::draw(&mut svg, report, COLUMNS[1], ROWS[1]);
    svg.finish()
}

/// Returns the residuals of each calibrated tactel: what its curve gives for the reading of a point, minus the force.
fn residuals(report: &CalibrationReport) -> Vec<Residuals> {
    let tactels = report.calibrated().map(|(_, finding, points, tactel)| {
        let error = |[force, s]: [f64; 2]| f64::from(tactel.curve.force(s as f32 * finding.sign)) - force;
        points.branches().map(|branch| branch.into_iter().map(|point| [point[0], error(point)]).collect())
    });
    tactels.collect()
}

/// Returns the part `share` of the values in each bin of force, for one branch: its middle and the value. Bins are narrow at
/// low forces.
fn quantile(
    residuals: &[Residuals],
    branch: usize,
    (low, most): (f64, f64),
    share: f64,
    value: impl Fn(&[f64; 2]) -> f64,
) -> Vec<[f64; 2]> {
    let mut bins: Vec<(f64, Vec<f64>)> = vec![(0.0, Vec::new()); BINS];
    for point in residuals.iter().flat_map(|tactel| &tactel[branch]).filter(|point| point[0] > low) {
        let place = (libm::sqrt((point[0] / most).min(1.0)) * BINS as f64) as usize;
        let (sum, values) = &mut bins[place.min(BINS - 1)];
        *sum += point[0];
        values.push(value(point));
    }
    let bins = bins.into_iter().filter(|(_, values)| !values.is_empty());
    bins.map(|(sum, mut values)| {
        values.sort_unstable_by(f64::total_cmp);
        let at = (share * (values.len() - 1) as f64).round() as usize;
        [sum / values.len() as f64, values[at]]
    })
    .collect()
}

/// Draws the residuals of both branches: those of all tactels as a band, those of 80 % of them as a darker one, and the
/// median as a line.
fn draw_residuals(svg: &mut Svg, report: &CalibrationReport, residuals: &[Residuals]) {
    let [top, bottom] = ROWS[0];
    heading(svg, 0, 0, "Residual of the force: all tactels, 80 % of them (darker), median");
    let errors = residuals.iter().flatten().flatten().map(|point| point[1]);
    let [low, high] = range(errors).unwrap_or([-1.0, 1.0]);
    let x = PlotAxis::linear(0.0, 1.02 * report.most, COLUMNS[0]);
    let y = PlotAxis::linear(low.min(0.0), high.max(0.0), [bottom, top]);
    svg.axes(x, y, [Some("reference force on a tactel [N]"), Some("residual [N]")]);
    let zero = [0.0, 1.02 * report.most].map(|force| [x.at(force), y.at(0.0)]);
    svg.group(&format!("stroke=\"{INK}\" fill=\"none\""), |svg| svg.polyline(zero));
    let mut names = Vec::new();
    for (branch, name) in BRANCHES.into_iter().enumerate() {
        let line = |share: f64| quantile(residuals, branch, (0.0, report.most), share, |point| point[1]);
        let median = line(0.5);
        if median.is_empty() {
            continue;
        }
        names.push((branch, name));
        for (ends, opacity) in [([0.0, 1.0], 0.15), ([0.1, 0.9], 0.3)] {
            let [below, above] = ends.map(line);
            let around = below.iter().chain(above.iter().rev()).map(|point| [x.at(point[0]), y.at(point[1])]);
            let band = format!("class=\"band\" fill=\"{}\" fill-opacity=\"{opacity}\"", STYLES[branch].0);
            svg.group(&band, |svg| svg.polyline(around));
        }
        curve(svg, branch, &median, [x, y]);
    }
    legend(svg, &names, COLUMNS[0], top - LINE - 6.0);
}

/// Draws the relative error over the force, from 1 % of the maximum force on.
fn draw_relative(svg: &mut Svg, report: &CalibrationReport, residuals: &[Residuals]) {
    let [top, bottom] = ROWS[1];
    heading(svg, 0, 1, "Relative error: 50 % and 90 % of the tactels have less");
    let low = LOWEST * report.most;
    let percent = |point: &[f64; 2]| 100.0 * (point[1] / point[0]).abs();
    let mut lines = Vec::new();
    for (branch, name) in BRANCHES.into_iter().enumerate() {
        for (share, of) in [(0.5, "50 %"), (0.9, "90 %")] {
            let line = quantile(residuals, branch, (low, report.most), share, percent);
            lines.push((format!("{name}, {of}"), line));
        }
    }
    let highest = lines.iter().flat_map(|(_, line)| line).map(|point| point[1]).fold(1.0, f64::max);
    let x = PlotAxis::log(low, report.most, COLUMNS[0]);
    let y = PlotAxis::linear(0.0, 1.05 * highest, [bottom, top]);
    svg.axes(x, y, [Some("reference force on a tactel [N]"), Some("relative error [%]")]);
    let mut names = Vec::new();
    for (i, (name, line)) in lines.iter().enumerate().filter(|(_, (_, line))| !line.is_empty()) {
        names.push((i, name.as_str()));
        curve(svg, i, line, [x, y]);
    }
    legend(svg, &names, COLUMNS[0], top - 2.0 * LINE - 6.0);
}

/// Draws the heading of a panel.
fn heading(svg: &mut Svg, column: usize, row: usize, text: &str) {
    svg.text([COLUMNS[column][0], ROWS[row][0] - 2.0 * LINE - 8.0], "start", text);
}
