//! The map of a calibration: a square for each tactel.

use tactflow_runtime::cli::figure::LINE;
use tactflow_runtime::cli::svg::{INK, Svg};

use super::heading;
use crate::calibration::report::{CalibrationReport, TactelStatus};

/// Colour of tactels; the more residual, the more of it.
const FILL: &str = "#3d85c6";
/// Colour of marks.
const MARK: &str = "#d9730d";
/// Number of tactels that are marked as the worst.
const WORST: usize = 3;
/// Steps of the legend.
const STEPS: usize = 5;

/// Draws the residual of each tactel, and marks the worst, dead, saturated and left out ones.
pub(super) fn draw(svg: &mut Svg, report: &CalibrationReport, [left, right]: [f64; 2], [top, bottom]: [f64; 2]) {
    heading(svg, 1, 0, "Residual (RMS) of each tactel, row 0 at the top");
    let (rows, cols) = (report.calibration.rows, report.calibration.cols);
    let size = ((right - left) / cols as f64).min((bottom - top) / rows as f64).min(60.0);
    let parts = report.parts();
    let sizes = || parts.iter().map(|(_, part)| *part);
    let [lowest, highest] = [sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max)];
    let share = |part: f64| (part - lowest) / (highest - lowest).max(1e-9);
    let corner = |i: usize| [left + (i % cols) as f64 * size, top + (i / cols) as f64 * size];
    let square = |[x, y]: [f64; 2], style: &str| {
        format!("<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{size:.1}\" height=\"{size:.1}\" {style}/>")
    };
    svg.group(&format!("class=\"map\" stroke=\"{INK}\" stroke-width=\"0.5\""), |svg| {
        for (i, finding) in report.findings.iter().enumerate() {
            let part = parts.iter().find(|(tactel, _)| *tactel == i).map_or(0.0, |(_, part)| share(*part));
            let [x, y] = corner(i);
            svg.put(square([x, y], &format!("fill=\"{FILL}\" fill-opacity=\"{:.2}\"", shade(part))));
            let [right, bottom] = [x + size, y + size];
            match finding.status {
                TactelStatus::Good => {}
                TactelStatus::Dead => svg.put(format_args!(
                    "<path class=\"dead\" stroke-width=\"1.5\" d=\"M{x:.1} {y:.1}L{right:.1} {bottom:.1}M{right:.1} {y:.1}L{x:.1} \
                     {bottom:.1}\"/>"
                )),
                TactelStatus::Few | TactelStatus::Unfit => svg.put(format_args!(
                    "<path class=\"left-out\" stroke-width=\"1.5\" d=\"M{x:.1} {bottom:.1}L{right:.1} {y:.1}\"/>"
                )),
            }
            if finding.is_saturated {
                let [x, y] = [x + 0.5 * size, y + 0.5 * size];
                svg.put(format_args!(
                    "<circle class=\"saturated\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"none\" stroke-width=\"1.5\"/>",
                    0.25 * size
                ));
            }
        }
    });
    let mut worst = parts;
    worst.sort_by(|a, b| b.1.total_cmp(&a.1));
    worst.truncate(WORST);
    for (i, _) in &worst {
        svg.put(square(corner(*i), &format!("class=\"worst\" fill=\"none\" stroke=\"{MARK}\" stroke-width=\"2.5\"")));
    }
    let below = top + rows as f64 * size;
    legend(svg, [left, below + 8.0], [lowest, highest]);
    let list: Vec<String> =
        worst.iter().map(|(i, part)| format!("[{}, {}] {:.1} %", i / cols, i % cols, 100.0 * part)).collect();
    svg.text([left, below + 8.0 + 2.4 * LINE], "start", &format!("thick frame, the worst: {}", list.join(", ")));
    svg.text([left, below + 8.0 + 3.4 * LINE], "start", "cross: dead; stroke: left out; circle: saturated");
}

/// Returns the opacity for a residual from 0 to 1.
fn shade(part: f64) -> f64 {
    0.05 + 0.95 * part
}

/// Draws the shades with the residuals they stand for.
fn legend(svg: &mut Svg, [left, top]: [f64; 2], ends: [f64; 2]) {
    let [low, high] = ends.map(|part| format!("{:.2} %", 100.0 * part));
    svg.text([left, top + 12.0], "start", &low);
    for step in 0..STEPS {
        let (x, part) = (left + 54.0 + 24.0 * step as f64, step as f64 / (STEPS - 1) as f64);
        svg.put(format_args!(
            "<rect x=\"{x:.1}\" y=\"{top:.1}\" width=\"24\" height=\"14\" fill=\"{FILL}\" fill-opacity=\"{:.2}\"/>",
            shade(part)
        ));
    }
    let text = format!("{high} of its maximum force");
    svg.text([left + 60.0 + 24.0 * STEPS as f64, top + 12.0], "start", &text);
}
