//! Figures for papers: axes with units, curves that differ in colour and in dashes, and bands for modes.

use super::number::is_flat;
use super::svg::{INK, PlotAxis, STYLES, Svg};

/// Height of a line of text [px].
pub const LINE: f64 = 18.0;
/// Estimated width of a character [px].
const CHARACTER: f64 = 7.5;
/// Length of the line beside a name in a legend [px].
const SAMPLE: f64 = 30.0;

/// A span of time with a name, such as that of a mode.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureBand {
    /// Begin and end.
    pub span: [f64; 2],
    /// Its name.
    pub name: String,
}

/// Returns the minimum and the maximum of some values with a margin, or `None` if none is finite.
#[must_use]
pub fn range(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    let finite = values.into_iter().filter(|value| value.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    if low > high {
        return None;
    }
    let margin = match is_flat(low, high) {
        true if high == 0.0 => 1.0,
        true => 0.5 * high.abs(),
        false => 0.05 * (high - low),
    };
    Some([low - margin, high + margin])
}

/// Returns the attributes of a curve: its colour and its dashes.
#[must_use]
pub fn style(curve: usize) -> String {
    let (colour, dashes) = STYLES[curve % STYLES.len()];
    format!(
        "class=\"curve\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\" stroke-dasharray=\"{dashes}\" \
         stroke-linejoin=\"round\""
    )
}

/// Draws a curve through points, with a gap where one is not finite. In each column of pixels it has at most the first,
/// the minimum, the maximum and the last of its values, so a peak is visible and the file stays small.
pub fn curve(svg: &mut Svg, number: usize, points: &[[f64; 2]], [x, y]: [PlotAxis; 2]) {
    svg.group(&style(number), |svg| {
        for part in points.split(|point| !point.iter().all(|value| value.is_finite())) {
            let column = |point: &[f64; 2]| x.at(point[0]).floor();
            let mut kept: Vec<[f64; 2]> = Vec::new();
            for group in part.chunk_by(|a, b| column(a) == column(b)) {
                let by_value = |a: &(usize, &[f64; 2]), b: &(usize, &[f64; 2])| a.1[1].total_cmp(&b.1[1]);
                let least = group.iter().enumerate().min_by(by_value).map_or(0, |(i, _)| i);
                let most = group.iter().enumerate().max_by(by_value).map_or(0, |(i, _)| i);
                let mut chosen = [0, least, most, group.len() - 1];
                chosen.sort_unstable();
                let mut last = usize::MAX;
                for i in chosen {
                    if i != last {
                        kept.push(group[i]);
                    }
                    last = i;
                }
            }
            // A line from a point to itself is a dot, with round ends.
            let dot = kept.first().copied().filter(|_| kept.len() == 1);
            if !kept.is_empty() {
                svg.polyline(kept.into_iter().chain(dot).map(|[a, b]| [x.at(a), y.at(b)]));
            }
        }
    });
}

/// Draws names of curves from the left, each behind a line in its style, and begins a new row where one does not fit.
/// Returns the number of rows.
pub fn legend(svg: &mut Svg, names: &[(usize, &str)], [left, right]: [f64; 2], top: f64) -> usize {
    let places = legend_places(names, [left, right]);
    for ((number, name), [x, row]) in names.iter().zip(&places) {
        let y = top + LINE * row;
        svg.group(&style(*number), |svg| svg.polyline([[*x, y + 8.0], [x + SAMPLE, y + 8.0]]));
        svg.text([x + SAMPLE + 6.0, y + 12.5], "start", name);
    }
    places.last().map_or(0, |[_, row]| *row as usize + 1)
}

/// Returns the number of rows of a legend.
#[must_use]
pub fn legend_rows(names: &[(usize, &str)], across: [f64; 2]) -> usize {
    legend_places(names, across).last().map_or(0, |[_, row]| *row as usize + 1)
}

/// Returns the left end [px] and the row of each name.
fn legend_places(names: &[(usize, &str)], [left, right]: [f64; 2]) -> Vec<[f64; 2]> {
    let mut at = [left, 0.0];
    let place = |(_, name): &(usize, &str)| {
        let width = SAMPLE + 20.0 + CHARACTER * name.chars().count() as f64;
        if at[0] + width > right && at[0] > left {
            at = [left, at[1] + 1.0];
        }
        let place = at;
        at[0] += width;
        place
    };
    names.iter().map(place).collect()
}

/// Draws bands: every second one is shaded, each begins with a line, and its name is above, where it fits.
pub fn bands(svg: &mut Svg, bands: &[FigureBand], x: PlotAxis, [top, bottom]: [f64; 2]) {
    let mut end = f64::NEG_INFINITY;
    for (i, band) in bands.iter().enumerate() {
        let [left, right] = band.span.map(|value| x.at(value));
        let width = (right - left).max(0.0);
        if i % 2 == 1 {
            svg.put(format_args!(
                "<rect class=\"band\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{:.1}\" fill=\"{INK}\" \
                 fill-opacity=\"0.15\"/>",
                bottom - top
            ));
        }
        if i > 0 {
            let line =
                format!("<path d=\"M{left:.1} {top:.1}V{bottom:.1}\" stroke=\"{INK}\" stroke-dasharray=\"2 3\"/>");
            svg.put(line);
        }
        let from = end.max(left + 3.0);
        let to = from + CHARACTER * band.name.chars().count() as f64;
        if to <= right || from == left + 3.0 {
            svg.text([from, top - 5.0], "start", &band.name);
            end = to + CHARACTER;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: [PlotAxis; 2] =
        [PlotAxis::linear(0.0, 10.0, [0.0, 100.0]), PlotAxis::linear(0.0, 1000.0, [1000.0, 0.0])];

    fn lines(points: &[[f64; 2]]) -> Vec<String> {
        let mut svg = Svg::new([1.0; 2], "");
        curve(&mut svg, 0, points, AXES);
        let text = svg.finish();
        let lines = text.lines().filter_map(|line| line.strip_prefix("<polyline points=\""));
        lines.map(|line| line.trim_end_matches("\"/>").to_owned()).collect()
    }

    #[test]
    fn a_curve_has_gaps_and_a_point_alone_is_a_dot() {
        let points = [[0.0, 0.0], [1.0, 10.0], [2.0, f64::NAN], [3.0, 5.0]];
        assert_eq!(lines(&points), ["0.0,1000.0 10.0,990.0", "30.0,995.0 30.0,995.0"]);
    }

    #[test]
    fn a_peak_of_one_point_stays_visible() {
        let mut points: Vec<[f64; 2]> = (0..100_000).map(|i| [f64::from(i) * 1e-4, 0.0]).collect();
        points[34_567][1] = 700.0;
        let lines = lines(&points);
        assert!(lines[0].contains(",300.0 ") && lines[0].len() < 5000, "{}", lines[0].len());
    }

    #[test]
    fn every_style_is_visible_on_white_and_on_black_and_has_its_own_dashes() {
        let channel = |colour: &str, i: usize| f64::from(u8::from_str_radix(&colour[i..i + 2], 16).unwrap()) / 255.0;
        for (i, (colour, dashes)) in STYLES.iter().enumerate() {
            let weights = [(1, 0.2126), (3, 0.7152), (5, 0.0722)];
            let luminance: f64 = weights.iter().map(|(at, weight)| weight * libm::pow(channel(colour, *at), 2.0)).sum();
            assert!(1.05 / (luminance + 0.05) >= 3.0 && (luminance + 0.05) / 0.05 >= 3.0, "{colour}: {luminance}");
            assert!(STYLES[..i].iter().all(|(_, other)| other != dashes), "{dashes}");
        }
    }

    #[test]
    fn a_range_has_a_margin_and_is_never_empty() {
        assert_eq!(range([0.0, 10.0, f64::NAN]), Some([-0.5, 10.5]));
        assert_eq!(range([4.0, 4.0]), Some([2.0, 6.0]));
        assert_eq!(range([0.0]), Some([-1.0, 1.0]));
        assert_eq!(range([f64::NAN]), None);
    }
}
