//! The picture of `features`: the way of the centre of pressure, and the force over time.

use std::path::Path;

use tactflow_runtime::cli::figure::{LINE, curve, legend, range};
use tactflow_runtime::cli::svg::{PlotAxis, STYLES, Svg};
use tactflow_runtime::record::{RunColumn, RunRows};

/// Width of the picture [px].
const WIDTH: f64 = 760.0;
/// Left and right end of both panels [px].
const ACROSS: [f64; 2] = [84.0, 740.0];
/// Maximum height of the way, and height of the force [px].
const HEIGHTS: [f64; 2] = [420.0, 200.0];
/// Space below a panel, for its numbers and the name of its axis [px].
const GAP: f64 = 60.0;

/// What is drawn: the node, and how the legend names it.
const SOURCES: [(&str, &str); 2] = [("whole", "the whole pad"), ("touch.moments", "the largest region")];

/// Draws the rows of a table.
pub(super) fn draw(title: &str, table: &Path) -> Result<String, String> {
    let rows = RunRows::read(table)?;
    let column = |node: &str, port: &str| {
        let name = format!("{node}.{port}");
        rows.column(&name).ok_or_else(|| format!("the table has no column `{name}`"))
    };
    let mut ways = Vec::new();
    let mut forces = Vec::new();
    for (node, _) in SOURCES {
        let millimetres = |column: &RunColumn| column.values.iter().map(|value| value * 1e3).collect::<Vec<f64>>();
        let [x, y] = [millimetres(column(node, "x")?), millimetres(column(node, "y")?)];
        ways.push(x.into_iter().zip(y).map(<[f64; 2]>::from).collect::<Vec<[f64; 2]>>());
        forces.push(column(node, "force")?);
    }
    // Without a contact, noise moves the centre of the whole pad.
    let [whole, contact] = &mut ways[..] else { return Err("two ways are drawn".into()) };
    let untouched = whole.iter_mut().zip(&*contact).filter(|(_, contact)| contact[0].is_nan());
    untouched.for_each(|(point, _)| *point = [f64::NAN; 2]);
    let flat: Vec<[f64; 2]> = ways.iter().flatten().copied().collect();
    let names: Vec<(usize, &str)> = SOURCES.iter().enumerate().map(|(i, (_, name))| (i, *name)).collect();
    let Some([x, y]) = axes(&flat) else {
        let mut svg = Svg::new([WIDTH, 3.0 * LINE], title);
        svg.text([0.5 * WIDTH, 2.0 * LINE], "middle", "there is no contact in this recording");
        return Ok(svg.finish());
    };
    let top = 8.0 + 2.0 * LINE;
    let scale = ((ACROSS[1] - ACROSS[0]) / (x[1] - x[0])).min(HEIGHTS[0] / (y[1] - y[0]));
    let [right, bottom] = [ACROSS[0] + scale * (x[1] - x[0]), top + scale * (y[1] - y[0])];
    let (x_axis, y_axis) = ([ACROSS[0], right], [bottom, top]);
    let last = bottom + GAP + LINE + HEIGHTS[1];
    let mut svg = Svg::new([WIDTH, last + GAP], title);
    legend(&mut svg, &names, ACROSS, 4.0);
    svg.text(
        [ACROSS[0], 4.0 + LINE + 12.5],
        "start",
        "centre of pressure while there is a contact; circle: first, square: last",
    );
    let (x, y) = (PlotAxis::linear(x[0], x[1], x_axis), PlotAxis::linear(y[0], y[1], y_axis));
    svg.axes(x, y, [Some("x [mm]"), Some("y [mm]")]);
    for (i, way) in ways.iter().enumerate() {
        curve_of_way(&mut svg, i, way, [x, y]);
    }
    let from = rows.times.first().copied().unwrap_or(0.0);
    let to = rows.times.last().copied().filter(|to| *to > from).unwrap_or(from + 1.0);
    let time = PlotAxis::linear(from, to, ACROSS);
    let [low, high] = range(forces.iter().flat_map(|force| force.values.iter().copied())).unwrap_or([0.0, 1.0]);
    let force = PlotAxis::linear(low.min(0.0), high, [last, last - HEIGHTS[1]]);
    let title = format!("force [{}]", forces[0].unit);
    svg.axes(time, force, [Some("time [s]"), Some(&title)]);
    for (i, column) in forces.iter().enumerate() {
        let points: Vec<[f64; 2]> =
            rows.times.iter().copied().zip(column.values.iter().copied()).map(<[f64; 2]>::from).collect();
        curve(&mut svg, i, &points, [time, force]);
    }
    Ok(svg.finish())
}

/// Returns the ranges of both axes [mm], or `None` without any point. A way that hardly moves fills at least 2 mm.
fn axes(points: &[[f64; 2]]) -> Option<[[f64; 2]; 2]> {
    let of = |axis: usize| {
        let finite = points.iter().map(|point| point[axis]).filter(|value| value.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        let (middle, half) = (0.5 * (low + high), (0.55 * (high - low)).max(1.0));
        (low <= high).then_some([middle - half, middle + half])
    };
    let [x, y] = [of(0)?, of(1)?];
    // A long and narrow way needs room for its numbers too.
    let least = 0.25 * (x[1] - x[0]).max(y[1] - y[0]);
    let widened = |[low, high]: [f64; 2]| {
        let more = (0.5 * (least - (high - low))).max(0.0);
        [low - more, high + more]
    };
    Some([widened(x), widened(y)])
}

/// Draws a way with its first and its last point. A point is left out where it hardly differs from the one before.
fn curve_of_way(svg: &mut Svg, number: usize, way: &[[f64; 2]], [x, y]: [PlotAxis; 2]) {
    let place = |[a, b]: [f64; 2]| [x.at(a), y.at(b)];
    svg.group(&tactflow_runtime::cli::figure::style(number), |svg| {
        for part in way.split(|point| !point.iter().all(|value| value.is_finite())).filter(|part| !part.is_empty()) {
            let mut kept: Vec<[f64; 2]> = Vec::new();
            for point in part.iter().map(|point| place(*point)) {
                let is_far = |last: &[f64; 2]| (point[0] - last[0]).abs().max((point[1] - last[1]).abs()) >= 0.5;
                if kept.last().is_none_or(is_far) {
                    kept.push(point);
                }
            }
            svg.polyline(kept);
        }
    });
    let mut present = way.iter().filter(|point| point.iter().all(|value| value.is_finite()));
    let colour = STYLES[number].0;
    if let Some([x, y]) = present.next().map(|point| place(*point)) {
        svg.put(format_args!(
            "<circle class=\"first\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>"
        ));
    }
    if let Some([x, y]) = present.next_back().map(|point| place(*point)) {
        svg.put(format_args!(
            "<rect class=\"last\" x=\"{:.1}\" y=\"{:.1}\" width=\"8\" height=\"8\" fill=\"{colour}\"/>",
            x - 4.0,
            y - 4.0
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_axes_have_one_scale_and_room() {
        let [x, y] = axes(&[[0.0, 1.0], [100.0, 1.0], [f64::NAN, 5.0]]).unwrap();
        assert!((x[0] + 5.0).abs() < 1e-9 && (x[1] - 105.0).abs() < 1e-9, "{x:?}");
        assert!((y[1] - y[0] - 27.5).abs() < 1e-9, "{y:?}");
        assert_eq!(axes(&[[f64::NAN; 2]]), None);
    }
}
