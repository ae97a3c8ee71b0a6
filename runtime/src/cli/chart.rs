//! A curve over time in dots: two beside each other and four one above the other in a character.

use std::fmt::Write;

use super::course::Point;
use super::summary::number;

/// As wide as the numbers at the axis get.
pub(super) const LABELS: usize = 10;
/// Rows of dots in a line.
const DOTS: usize = 4;
/// The bits of a character's dots in Unicode: row by row, left and right.
const BITS: [[u32; 2]; DOTS] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
const BLANK: u32 = 0x2800;

/// What an axis spans.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    /// From the least to the greatest; zero is in it where it is near. None if there is no value.
    fn of(points: &[Point]) -> Option<Self> {
        let there = points.iter().filter(|point| point.is_there());
        let (low, high) = there
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), point| (low.min(point.low), high.max(point.high)));
        if low > high {
            return None;
        }
        let is_near = |least: f64, greatest: f64| least > 0.0 && least <= 0.5 * greatest;
        let low = if is_near(low, high) { 0.0 } else { low };
        let high = if is_near(-high, -low) { 0.0 } else { high };
        Some(Self { low, high })
    }

    /// Whether what differs, differs by rounding alone.
    fn is_flat(self) -> bool {
        // Halves, so that no difference is infinite.
        0.5 * self.high - 0.5 * self.low <= 1e-12 + 1e-9 * self.high.abs().max(self.low.abs())
    }

    /// Row of dots of a value, counted from above.
    fn row(self, value: f64, rows: usize) -> usize {
        let last = (rows * DOTS - 1) as f64;
        if self.is_flat() {
            return (last / 2.0) as usize;
        }
        let depth = (0.5 * self.high - 0.5 * value) / (0.5 * self.high - 0.5 * self.low);
        (depth * last).round().clamp(0.0, last) as usize
    }

    /// The values that are written at the axis, with the lines they stand on.
    fn labels(self, rows: usize) -> Vec<(usize, f64)> {
        let line = |value: f64| self.row(value, rows) / DOTS;
        if self.is_flat() {
            return vec![(line(self.high), self.high)];
        }
        let mut labels = vec![(0, self.high), (rows - 1, self.low)];
        let has_zero = self.low < 0.0 && self.high > 0.0;
        if has_zero && labels.iter().all(|(taken, _)| *taken != line(0.0)) {
            labels.push((line(0.0), 0.0));
        }
        labels
    }
}

/// The lines of a curve with its axis on the left, `width` characters wide in all. Each column shows everything from the
/// least to the greatest value of its time; a gap is where there was none. A dotted line is at zero.
pub(super) fn chart(points: &[Point], width: usize, rows: usize) -> Vec<String> {
    let cols = width.saturating_sub(LABELS + 2).max(1);
    let Some(range) = Range::of(points) else {
        let mut lines = vec![format!("{:LABELS$} │", ""); rows];
        lines[rows / 2].push_str("absent");
        return lines;
    };
    let mut bits = vec![0_u32; cols * rows];
    let mut dot = |x: usize, y: usize| bits[y / DOTS * cols + x / 2] |= BITS[y % DOTS][x % 2];
    if range.low < 0.0 && range.high > 0.0 && !range.is_flat() {
        (0..2 * cols).step_by(4).for_each(|x| dot(x, range.row(0.0, rows)));
    }
    let mut last: Option<(usize, usize)> = None;
    for x in 0..2 * cols {
        let part = column(points, x, 2 * cols);
        let span = part.map(|(low, high)| (range.row(high, rows), range.row(low, rows)));
        if let Some((mut top, mut bottom)) = span {
            // Joined to the column before.
            if let Some((above, below)) = last {
                top = top.min(below);
                bottom = bottom.max(above);
            }
            (top..=bottom).for_each(|y| dot(x, y));
        }
        last = span;
    }
    let labels = range.labels(rows);
    let line = |(row, bits): (usize, &[u32])| {
        let label = labels.iter().find(|(line, _)| *line == row).map(|(_, value)| number(*value));
        let tick = if label.is_some() { '┤' } else { '│' };
        let dots: String = bits
            .iter()
            .map(|bits| if *bits == 0 { ' ' } else { char::from_u32(BLANK + bits).unwrap_or(' ') })
            .collect();
        format!("{:>LABELS$} {tick}{}", label.unwrap_or_default(), dots.trim_end())
    };
    bits.chunks(cols).enumerate().map(line).collect()
}

/// The least and the greatest of the points in column `x` of `count`.
fn column(points: &[Point], x: usize, count: usize) -> Option<(f64, f64)> {
    let first = x * points.len() / count;
    let end = ((x + 1) * points.len() / count).max(first + 1);
    let there = points[first..end].iter().filter(|point| point.is_there());
    there.map(|point| (point.low, point.high)).reduce(|(low, high), (l, h)| (low.min(l), high.max(h)))
}

/// The axis of time below charts of that width, from one time to another [s].
pub(super) fn time_axis(width: usize, from: f64, to: f64) -> String {
    let cols = width.saturating_sub(LABELS + 2).max(1);
    let label = |time: f64| format!("{time:.3} s");
    let (start, middle, end) = (label(from), label(0.5 * (from + to)), label(to));
    let mut text = format!("{:LABELS$} └{}\n{:LABELS$}  {start}", "", "─".repeat(cols), "");
    let lengths = [&start, &middle, &end].map(|text| text.chars().count());
    let rest = cols.saturating_sub(lengths.iter().sum());
    // Writing to a string cannot fail.
    let _ = if rest >= 4 {
        write!(text, "{}{middle}{}{end}", " ".repeat(rest / 2), " ".repeat(rest - rest / 2))
    } else {
        write!(text, "{}{end}", " ".repeat(cols.saturating_sub(lengths[0] + lengths[2]).max(1)))
    };
    text
}

#[cfg(test)]
mod tests {
    use super::super::course::Course;
    use super::*;

    fn drawn(values: &[f64], cols: usize, rows: usize) -> Vec<String> {
        let mut course = Course::with_room(256);
        values.iter().for_each(|value| course.add(*value));
        chart(course.points(), cols + LABELS + 2, rows)
    }

    /// The dots of a chart: in each column the rows that are set, counted from above.
    fn dots(lines: &[String], cols: usize) -> Vec<Vec<usize>> {
        let of = |x: usize| {
            let rows = 0..lines.len() * DOTS;
            let is_set = |y: &usize| {
                let char = lines[y / DOTS].chars().nth(LABELS + 2 + x / 2).unwrap_or(' ');
                (char as u32).wrapping_sub(BLANK) & BITS[y % DOTS][x % 2] != 0 && char != ' '
            };
            rows.filter(is_set).collect()
        };
        (0..2 * cols).map(of).collect()
    }

    #[test]
    fn a_ramp_goes_from_one_corner_to_the_other() {
        let lines = drawn(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0], 6, 3);
        assert_eq!(lines, ["    12.000 ┤    ⣠⠞", "           │ ⢀⡤⠞⠁", "         0 ┤⠴⠋"]);
    }

    #[test]
    fn each_column_is_where_its_values_are() {
        // One value a column: the row of each dot follows from the axis, 0 at the bottom and 7 at the top.
        let values = [7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.0];
        let expected: Vec<Vec<usize>> =
            vec![vec![0], vec![0, 1], vec![1, 2], vec![2, 3], vec![3, 4], vec![4, 5], vec![5, 6], vec![6, 7]];
        assert_eq!(dots(&drawn(&values, 4, 2), 4), expected);
    }

    #[test]
    fn a_spike_of_one_tick_in_very_many_is_seen() {
        let mut values = vec![0.0; 10_000];
        values[6_000] = 1.0;
        let columns = dots(&drawn(&values, 10, 2), 10);
        let spikes: Vec<usize> = (0..20).filter(|x| columns[*x].contains(&0)).collect();
        assert!(matches!(spikes[..], [11 | 12]), "{columns:?}");
        assert!(columns.iter().enumerate().all(|(x, rows)| spikes == [x] || rows == &[7]), "{columns:?}");
    }

    #[test]
    fn what_is_flat_absent_or_not_finite_has_a_chart_too() {
        let flat = drawn(&[3.0; 8], 4, 3);
        assert_eq!(flat, ["           │", "     3.000 ┤⠒⠒⠒⠒", "           │"]);
        assert_eq!(drawn(&[0.0; 8], 2, 1), ["         0 ┤⠒⠒"]);
        for nothing in [&[][..], &[f64::NAN; 5], &[f64::INFINITY, f64::NEG_INFINITY]] {
            assert_eq!(drawn(nothing, 8, 2), ["           │", "           │absent"]);
        }
        let columns = dots(&drawn(&[1.0, 2.0, f64::NAN, f64::INFINITY, 1.0, 2.0, 1.0, 2.0], 4, 2), 4);
        assert_eq!(
            columns.iter().map(Vec::is_empty).collect::<Vec<_>>(),
            [false, false, true, true, false, false, false, false]
        );
    }

    #[test]
    fn the_greatest_numbers_there_are_fit_as_well() {
        let lines = drawn(&[f64::MIN, f64::MAX, 0.0, f64::MAX], 2, 3);
        // The least value is at the bottom, and the line at zero in the middle.
        assert_eq!(dots(&lines, 2)[0], [6, 11]);
        assert!(lines[0].contains("1.80e308 ┤") && lines[2].contains("-1.80e308 ┤"), "{lines:?}");
    }

    #[test]
    fn zero_is_in_the_axis_where_it_is_near_and_has_a_line_where_it_is_crossed() {
        let range = |low: f64, high: f64| {
            Range::of(&{
                let mut course = Course::new();
                [low, high].into_iter().for_each(|value| course.add(value));
                course.points().to_vec()
            })
            .map(|range| (range.low, range.high))
        };
        for (low, high, expected) in [
            (1.0, 2.0, (0.0, 2.0)),
            (1.1, 2.0, (1.1, 2.0)),
            (-2.0, -1.0, (-2.0, 0.0)),
            (-2.0, -1.1, (-2.0, -1.1)),
            (-1.0, 3.0, (-1.0, 3.0)),
            (5.0, 5.0, (5.0, 5.0)),
        ] {
            assert_eq!(range(low, high), Some(expected), "{low} {high}");
        }
        let lines = drawn(&[-1.0, -1.0, -1.0, -1.0, -1.0, -1.0, -1.0, 1.0], 4, 5);
        assert!(lines[2].starts_with("         0 ┤"), "{lines:?}");
        assert!(dots(&lines, 4)[0].len() == 2, "the curve and the line: {lines:?}");
    }

    #[test]
    fn the_axis_of_time_is_as_wide_as_the_chart() {
        for width in [30, 40, 62, 100] {
            let text = time_axis(width, 0.0, 3.996);
            let widths: Vec<usize> = text.lines().map(|line| line.chars().count()).collect();
            assert_eq!(widths, [width, width], "{text}");
            assert!(text.contains(" 0.000 s") && text.ends_with(" 3.996 s"));
        }
    }
}
