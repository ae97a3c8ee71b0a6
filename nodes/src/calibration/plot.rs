//! Draws the curves of all tactels, like Fig. 1 of the paper: the reference force over the reading.
//!
//! The SVG is written directly: a few lines and words need no library (docs/decisions/018). The colours have a medium
//! brightness and there is no background, so the picture is readable on light and on dark pages.

use std::fmt::Write;

use super::report::{Report, State};

/// Size of the picture, and corners of the frame in it [px].
const SIZE: [f64; 2] = [720.0, 480.0];
const FRAME: [[f64; 2]; 2] = [[64.0, 36.0], [704.0, 424.0]];

/// Maximum number of tactels that are drawn; of more, every second, third, …
const MAX_DRAWN: usize = 1024;

/// Number of points of the mean curve.
const POINTS: usize = 48;

/// A linear scale along one axis: the values at the ends of the frame.
#[derive(Debug, Clone, Copy)]
struct Scale {
    from: f64,
    to: f64,
    pixels: [f64; 2],
}

impl Scale {
    fn at(&self, value: f64) -> f64 {
        let [low, high] = self.pixels;
        low + (value - self.from) / (self.to - self.from) * (high - low)
    }

    /// Returns four to nine round numbers.
    fn ticks(&self) -> Vec<f64> {
        let raw = (self.to - self.from) / 5.0;
        let power = (-12..12).map(|k| libm::pow(10.0, f64::from(k))).take_while(|power| *power <= raw).last();
        let power = power.unwrap_or(raw);
        let step = [5.0, 2.0, 1.0].into_iter().map(|by| by * power).find(|step| *step <= raw).unwrap_or(power);
        let first = (self.from / step).ceil() as i64;
        (first..).map(|k| k as f64 * step).take_while(|tick| *tick <= self.to + 1e-9 * step).collect()
    }
}

/// Returns the picture of a calibration: each tactel's branches thin, the mean of the fitted curves thick.
#[must_use]
pub fn svg(report: &Report) -> String {
    let calibration = &report.calibration;
    let good: Vec<usize> = (0..report.findings.len()).filter(|i| report.findings[*i].state == State::Good).collect();
    let branches: Vec<Vec<[f64; 2]>> =
        good.iter().step_by(good.len().div_ceil(MAX_DRAWN).max(1)).flat_map(|i| lines(report, *i)).collect();
    let mean = mean(report, &good);
    let readings = branches.iter().flatten().chain(&mean).map(|point| point[0]);
    let (min, max) = readings.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    // From zero, unless all curves would be on one side.
    let from = if min > 0.0 && min < 0.5 * max { 0.0 } else { min };
    let x = Scale { from, to: (from + 1.02 * (max - from)).max(from + 1e-9), pixels: [FRAME[0][0], FRAME[1][0]] };
    let y = Scale { from: 0.0, to: 1.04 * report.most, pixels: [FRAME[1][1], FRAME[0][1]] };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <title>Force over reading, {} of {} x {} tactels, {} curves</title>\n",
        SIZE[0],
        SIZE[1],
        good.len(),
        calibration.rows,
        calibration.cols,
        report.kind()
    );
    axes(&mut svg, x, y, &format!("reading [{}]", calibration.reading), "reference force on a tactel [N]");
    svg.push_str("<g fill=\"none\" stroke=\"#3d85c6\" stroke-opacity=\"0.5\" stroke-width=\"0.9\">\n");
    branches.iter().for_each(|line| polyline(&mut svg, line, x, y));
    svg.push_str("</g>\n<g fill=\"none\" stroke=\"#d9730d\" stroke-width=\"3\" stroke-linejoin=\"round\">\n");
    polyline(&mut svg, &mean, x, y);
    svg.push_str("</g>\n");
    let legend = format!("thin: {} tactels, as measured; thick: mean of the fitted curves", good.len());
    text(&mut svg, [FRAME[0][0], FRAME[0][1] - 14.0], "start", &legend);
    svg.push_str("</svg>\n");
    svg
}

/// Returns the branches of a tactel: force rising, then falling.
fn lines(report: &Report, i: usize) -> Vec<Vec<[f64; 2]>> {
    let (finding, tactel) = (&report.findings[i], &report.calibration.tactels[i]);
    let (Some(points), Some(tactel)) = (&finding.points, tactel) else { return Vec::new() };
    let sign = f64::from(finding.sign);
    let place = |[force, s]: [f64; 2]| [f64::from(tactel.offset) + sign * s, force.max(0.0)];
    points.branches().map(|branch| branch.into_iter().map(place).collect()).into()
}

/// Returns the mean over all tactels of the readings on the fitted curves, force by force.
fn mean(report: &Report, good: &[usize]) -> Vec<[f64; 2]> {
    let mut mean = Vec::new();
    for k in 0..=POINTS {
        let force = report.most * k as f64 / POINTS as f64;
        let (mut sum, mut count) = (0.0, 0);
        for i in good {
            let (finding, tactel) = (&report.findings[*i], &report.calibration.tactels[*i]);
            let (Some(points), Some(tactel)) = (&finding.points, tactel) else { continue };
            // A mean over a few tactels would jump where one of the curves ends.
            if force <= 1.01 * points.most {
                sum +=
                    f64::from(tactel.offset) + f64::from(finding.sign) * tactel.curve.reading(force.min(points.most));
                count += 1;
            }
        }
        if count > 0 && count * 10 >= good.len() * 9 {
            mean.push([sum / f64::from(u32::try_from(count).unwrap_or(u32::MAX)), force]);
        }
    }
    mean
}

fn polyline(svg: &mut String, line: &[[f64; 2]], x: Scale, y: Scale) {
    let points: Vec<String> = line.iter().map(|[a, b]| format!("{:.1},{:.1}", x.at(*a), y.at(*b))).collect();
    put(svg, format_args!("<polyline points=\"{}\"/>", points.join(" ")));
}

fn axes(svg: &mut String, x: Scale, y: Scale, along: &str, up: &str) {
    let [[left, top], [right, bottom]] = FRAME;
    svg.push_str("<g stroke=\"#888888\" stroke-width=\"1\" fill=\"none\">\n");
    put(svg, format_args!("<path d=\"M{left} {top}V{bottom}H{right}\"/>"));
    x.ticks().iter().for_each(|tick| put(svg, format_args!("<path d=\"M{:.1} {bottom}v5\"/>", x.at(*tick))));
    for tick in y.ticks() {
        let at = y.at(tick);
        put(
            svg,
            format_args!(
                "<path d=\"M{left} {at:.1}h-5\"/><path stroke-opacity=\"0.25\" d=\"M{left} {at:.1}H{right}\"/>"
            ),
        );
    }
    svg.push_str("</g>\n");
    x.ticks().iter().for_each(|tick| text(svg, [x.at(*tick), bottom + 19.0], "middle", &number(*tick)));
    y.ticks().iter().for_each(|tick| text(svg, [left - 9.0, y.at(*tick) + 4.5], "end", &number(*tick)));
    text(svg, [0.5 * (left + right), bottom + 42.0], "middle", along);
    let middle = 0.5 * (top + bottom);
    let turn = format!("text-anchor=\"middle\" transform=\"translate(18 {middle:.1}) rotate(-90)\"");
    put(svg, format_args!("<text {turn} fill=\"#888888\">{up}</text>"));
}

/// Formats a number without the rounding errors of binary fractions.
fn number(value: f64) -> String {
    format!("{}", (value * 1e6).round() / 1e6 + 0.0)
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, words: &str) {
    put(svg, format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"#888888\">{words}</text>"));
}

fn put(svg: &mut String, line: std::fmt::Arguments<'_>) {
    writeln!(svg, "{line}").expect("writing to a string cannot fail");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_not_too_many() {
        for (from, to, first, step) in [
            (0.0, 5.2, 0.0, 1.0),
            (0.0, 4095.0, 0.0, 500.0),
            (-3.0, 0.9, -3.0, 0.5),
            (310.0, 340.0, 310.0, 5.0),
            (0.0, 1e-5, 0.0, 2e-6),
        ] {
            let ticks = Scale { from, to, pixels: [0.0, 1.0] }.ticks();
            assert!((4..=11).contains(&ticks.len()), "{from}..{to}: {ticks:?}");
            assert!((ticks[0] - first).abs() < 1e-9 && (ticks[1] - ticks[0] - step).abs() < 1e-9 * step, "{ticks:?}");
        }
    }

    #[test]
    fn a_scale_meets_the_ends_of_the_frame() {
        let scale = Scale { from: 10.0, to: 30.0, pixels: [424.0, 24.0] };
        assert_eq!([scale.at(10.0), scale.at(20.0), scale.at(30.0)], [424.0, 224.0, 24.0]);
    }
}
