//! The curves of a still picture.

use super::layout::{CHARACTER, CURVES, LINE, TOP};
use crate::cli::text::chart::AxisRange;
use crate::cli::text::number::is_flat;
use crate::cli::text::series::SeriesBin;
use crate::cli::text::svg::{PlotAxis, Svg, escaped};
use crate::cli::view::{ColumnCurve, RunView};
use crate::signal::Unit;

/// Height of the curves of one unit [px].
const PANEL_HEIGHT: f64 = 120.0;
/// Colours of curves: each has a contrast of at least 3 to white and to black.
const COLOURS: [&str; 7] = ["#3d85c6", "#d9730d", "#2a9d6f", "#c2558f", "#8a6fd1", "#9a8400", "#d14b4b"];

/// The curves of one unit in one pair of axes.
pub(crate) struct Panel<'v> {
    unit: Unit,
    /// The curves, each with its number among all curves.
    curves: Vec<(usize, &'v ColumnCurve)>,
    top: f64,
    pub(crate) bottom: f64,
}

/// Groups the curves by unit, one panel below the other.
pub(crate) fn panels(view: &RunView) -> Vec<Panel<'_>> {
    let mut panels: Vec<Panel<'_>> = Vec::new();
    for (i, curve) in view.curves.iter().enumerate() {
        match panels.iter_mut().find(|panel| panel.unit == curve.unit) {
            Some(panel) => panel.curves.push((i, curve)),
            None => panels.push(Panel { unit: curve.unit, curves: vec![(i, curve)], top: 0.0, bottom: 0.0 }),
        }
    }
    let mut bottom = TOP - LINE;
    for panel in &mut panels {
        let rows = panel.legend().last().map_or(0.0, |(_, [_, row])| row + 1.0);
        panel.top = bottom + LINE * (rows + 0.5);
        panel.bottom = panel.top + PANEL_HEIGHT;
        bottom = panel.bottom;
    }
    panels
}

impl Panel<'_> {
    /// Returns the curves with the places of their names: the left end [px] and the row.
    fn legend(&self) -> Vec<((usize, &ColumnCurve), [f64; 2])> {
        let mut at = [CURVES[0] + 6.0, 0.0];
        let place = |(_, curve): &(usize, &ColumnCurve)| {
            let width = 26.0 + CHARACTER * (curve.name.chars().count() + 2) as f64;
            if at[0] + width > CURVES[1] && at[0] > CURVES[0] + 6.0 {
                at = [CURVES[0] + 6.0, at[1] + 1.0];
            }
            let place = at;
            at[0] += width;
            place
        };
        self.curves.iter().copied().zip(self.curves.iter().map(place)).collect()
    }

    /// Draws the axes, the names and the curves.
    pub(crate) fn draw(&self, svg: &mut Svg, time: PlotAxis, times: &[SeriesBin], title: Option<&str>) {
        let bins = self.curves.iter().flat_map(|(_, curve)| curve.series.bins());
        let Some(AxisRange { low, high }) = AxisRange::of(bins) else {
            let names: Vec<&str> = self.curves.iter().map(|(_, curve)| curve.name.as_str()).collect();
            let text = format!("{}: absent", names.join(", "));
            svg.text([CURVES[0], self.bottom - 0.5 * PANEL_HEIGHT], "start", &text);
            return;
        };
        let margin = match is_flat(low, high) {
            true if high == 0.0 => 1.0,
            true => 0.5 * high.abs(),
            false => 0.05 * (high - low),
        };
        let y = PlotAxis::linear(low - margin, high + margin, [self.bottom, self.top]);
        svg.axes(time, y, [title, Some(&format!("[{}]", self.unit))]);
        for ((i, curve), [left, row]) in self.legend() {
            let colour = COLOURS[i % COLOURS.len()];
            let baseline = self.top - 8.0 - LINE * row;
            let column = escaped(&curve.column);
            let group = format!("class=\"curve\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"");
            svg.group(&format!("{group} data-column=\"{column}\" stroke-linecap=\"round\""), |svg| {
                svg.put(format_args!("<path stroke-width=\"3\" d=\"M{left:.1} {:.1}h18\"/>", baseline - 4.0));
                for segment in segments(curve.series.bins(), times, time) {
                    // A line from a point to itself is a dot.
                    let dot = segment.first().filter(|_| segment.len() == 1);
                    svg.polyline(segment.iter().chain(dot).map(|[x, value]| [*x, y.at(*value)]));
                }
            });
            svg.text([left + 24.0, baseline], "start", &curve.name);
        }
    }
}

/// Returns the points of a curve, with a new segment after each gap: x [px], value.
///
/// The bins of a column of pixels are merged, so that each column has one point, or the minimum and the maximum of its
/// values.
fn segments(bins: &[SeriesBin], times: &[SeriesBin], time: PlotAxis) -> Vec<Vec<[f64; 2]>> {
    let mut segments: Vec<Vec<[f64; 2]>> = vec![Vec::new()];
    let column = |(_, tick): &(&SeriesBin, &SeriesBin)| time.at(tick.mean).floor();
    let bins: Vec<(&SeriesBin, &SeriesBin)> = bins.iter().zip(times).collect();
    for group in bins.chunk_by(|a, b| column(a) == column(b) && a.0.is_present() == b.0.is_present()) {
        let merged = SeriesBin::merged(group.iter().map(|(bin, _)| *bin));
        let tick = SeriesBin::merged(group.iter().map(|(_, tick)| *tick));
        let segment = segments.last_mut().expect("`segments` starts with one segment");
        if !merged.is_present() {
            if !segment.is_empty() {
                segments.push(Vec::new());
            }
            continue;
        }
        let x = time.at(tick.mean);
        // The end that is nearer to the last point comes first.
        let is_falling = segment.last().is_some_and(|[_, last]| last - merged.low > merged.high - last);
        let ends = if is_falling { [merged.high, merged.low] } else { [merged.low, merged.high] };
        segment.push([x, ends[0]]);
        if ends[0] != ends[1] {
            segment.push([x, ends[1]]);
        }
    }
    segments.retain(|segment| !segment.is_empty());
    segments
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::text::series::Series;

    fn points(values: &[f64], width: f64) -> Vec<Vec<[f64; 2]>> {
        let (mut series, mut times) = (Series::with_capacity(64), Series::with_capacity(64));
        for (i, value) in values.iter().enumerate() {
            series.add(*value);
            times.add(i as f64);
        }
        let time = PlotAxis::linear(0.0, values.len() as f64, [0.0, width]);
        segments(series.bins(), times.bins(), time)
    }

    #[test]
    fn each_tick_is_a_point_if_there_is_room() {
        assert_eq!(points(&[1.0, 3.0, 2.0], 30.0), [[[0.0, 1.0], [10.0, 3.0], [20.0, 2.0]]]);
        assert_eq!(points(&[f64::NAN; 3], 30.0), [[[0.0; 2]; 0]; 0]);
    }

    #[test]
    fn a_gap_divides_a_curve() {
        assert_eq!(points(&[f64::NAN, 1.0, f64::NAN, f64::NAN, 2.0], 50.0), [[[10.0, 1.0]], [[40.0, 2.0]]]);
    }

    #[test]
    fn a_column_of_pixels_has_the_minimum_and_the_maximum() {
        let found = points(&[5.0, 1.0, 9.0, 4.0, 8.0, 2.0], 2.0);
        assert_eq!(found.len(), 1);
        let values: Vec<f64> = found[0].iter().map(|[_, value]| *value).collect();
        assert_eq!(values, [1.0, 9.0, 8.0, 2.0], "the end near 9 comes first");
        assert!(found[0][0][0] == found[0][1][0] && found[0][2][0] == found[0][3][0]);
    }

    /// Luminance of an sRGB colour, with a gamma of 2.2 approximated by 2.
    fn luminance(colour: &str) -> f64 {
        let channel = |i: usize| f64::from(u8::from_str_radix(&colour[i..i + 2], 16).unwrap()) / 255.0;
        [(1, 0.2126), (3, 0.7152), (5, 0.0722)].iter().map(|(i, weight)| weight * channel(*i) * channel(*i)).sum()
    }

    #[test]
    fn every_colour_is_visible_on_white_and_on_black() {
        for colour in COLOURS {
            let luminance = luminance(colour);
            assert!(1.05 / (luminance + 0.05) >= 3.0 && (luminance + 0.05) / 0.05 >= 3.0, "{colour}: {luminance}");
        }
    }
}
