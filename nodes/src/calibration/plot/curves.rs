//! The curves of the best, the median and the worst tactel, with the points that they were fitted to.

use tactflow_runtime::cli::figure::{LINE, curve, legend};
use tactflow_runtime::cli::svg::{PlotAxis, STYLES, Svg};

use super::heading;
use crate::calibration::report::CalibrationReport;

/// Number of points of a curve.
const POINTS: usize = 64;

/// Draws three tactels.
pub(super) fn draw(svg: &mut Svg, report: &CalibrationReport, across: [f64; 2], [top, bottom]: [f64; 2]) {
    heading(svg, 1, 1, "Three tactels; open circles: rising force, full: falling");
    let mut order = report.parts();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (Some(best), Some(worst)) = (order.first(), order.last()) else { return };
    let mut chosen = vec![("best", *best), ("median", order[order.len() / 2]), ("worst", *worst)];
    chosen.dedup_by_key(|(_, (i, _))| *i);
    let cols = report.calibration.cols;
    let tactel = |i: usize| report.calibrated().find(|(own, ..)| *own == i).expect("it has a residual");
    let mut names = Vec::new();
    let mut lines = Vec::new();
    for (name, (i, part)) in &chosen {
        let (_, finding, points, tactel) = tactel(*i);
        let at = |[force, s]: [f64; 2]| [force, f64::from(tactel.offset) + f64::from(finding.sign) * s];
        let fitted = (0..=POINTS).map(|k| points.most * k as f64 / POINTS as f64);
        let fitted: Vec<[f64; 2]> = fitted.map(|force| at([force, tactel.curve.reading(force)])).collect();
        let measured = points.branches().map(|branch| branch.into_iter().map(at).collect::<Vec<_>>());
        names.push(format!("{name} [{}, {}], {:.1} %", i / cols, i % cols, 100.0 * part));
        lines.push((fitted, measured));
    }
    let readings = lines.iter().flat_map(|(fitted, measured)| fitted.iter().chain(measured.iter().flatten()));
    let (low, high) =
        readings.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), point| (a.min(point[1]), b.max(point[1])));
    let x = PlotAxis::linear(0.0, 1.02 * report.most, across);
    let y = PlotAxis::linear(low, low + 1.04 * (high - low).max(1e-9), [bottom, top]);
    let y_title = format!("reading [{}]", report.calibration.reading);
    svg.axes(x, y, [Some("reference force on a tactel [N]"), Some(&y_title)]);
    for (number, (fitted, measured)) in lines.iter().enumerate() {
        curve(svg, number, fitted, [x, y]);
        let colour = STYLES[number % STYLES.len()].0;
        for (branch, fill) in measured.iter().zip(["none", colour]) {
            for [force, reading] in branch {
                svg.put(format_args!(
                    "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.6\" fill=\"{fill}\" stroke=\"{colour}\"/>",
                    x.at(*force),
                    y.at(*reading)
                ));
            }
        }
    }
    let names: Vec<(usize, &str)> = names.iter().map(String::as_str).enumerate().collect();
    legend(svg, &names, across, top - 2.0 * LINE - 4.0);
}
