//! Charts in Braille characters, each of which has two columns of four dots.

use std::fmt::Write;

use super::number::{is_flat, number};
use super::series::SeriesBin;

/// Width of the numbers at the axis [characters].
pub(crate) const LABEL_WIDTH: usize = 10;
/// Rows of dots in a line of text.
const DOTS_PER_LINE: usize = 4;
/// Bits of the dots of a Braille character: row by row, left and right.
const BITS: [[u32; 2]; DOTS_PER_LINE] = [[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]];
/// The Braille character without dots.
const BLANK: u32 = 0x2800;

/// The range of values along an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AxisRange {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl AxisRange {
    /// Returns the range of the values in the bins, extended to zero if zero is near, or `None` without a value.
    pub(crate) fn of<'b>(bins: impl IntoIterator<Item = &'b SeriesBin>) -> Option<Self> {
        let SeriesBin { low, high, .. } = Some(SeriesBin::merged(bins)).filter(SeriesBin::is_present)?;
        let is_near = |least: f64, greatest: f64| least > 0.0 && least <= 0.5 * greatest;
        let low = if is_near(low, high) { 0.0 } else { low };
        let high = if is_near(-high, -low) { 0.0 } else { high };
        Some(Self { low, high })
    }

    fn is_flat(self) -> bool {
        is_flat(self.low, self.high)
    }

    /// Returns the row of dots of a value, counted from the top.
    fn row(self, value: f64, rows: usize) -> usize {
        let last = (rows * DOTS_PER_LINE - 1) as f64;
        if self.is_flat() {
            return (last / 2.0) as usize;
        }
        let depth = (0.5 * self.high - 0.5 * value) / (0.5 * self.high - 0.5 * self.low);
        (depth * last).round().clamp(0.0, last) as usize
    }

    /// Returns the values that are printed at the axis, each with its line of text.
    fn labels(self, rows: usize) -> Vec<(usize, f64)> {
        let line = |value: f64| self.row(value, rows) / DOTS_PER_LINE;
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

/// Draws a curve with its axis on the left, `width` characters wide in total.
///
/// Each column of dots spans the minimum and the maximum of its time, and is empty where the value was absent. A dotted
/// line marks zero.
pub(crate) fn chart(bins: &[SeriesBin], width: usize, rows: usize) -> Vec<String> {
    let cols = width.saturating_sub(LABEL_WIDTH + 2).max(1);
    let Some(range) = AxisRange::of(bins) else {
        let mut lines = vec![format!("{:LABEL_WIDTH$} │", ""); rows];
        lines[rows / 2].push_str("absent");
        return lines;
    };
    let mut bits = vec![0_u32; cols * rows];
    let mut dot = |x: usize, y: usize| bits[y / DOTS_PER_LINE * cols + x / 2] |= BITS[y % DOTS_PER_LINE][x % 2];
    if range.low < 0.0 && range.high > 0.0 && !range.is_flat() {
        (0..2 * cols).step_by(4).for_each(|x| dot(x, range.row(0.0, rows)));
    }
    let mut last: Option<(usize, usize)> = None;
    for x in 0..2 * cols {
        let part = column(bins, x, 2 * cols);
        let span = part.is_present().then(|| (range.row(part.high, rows), range.row(part.low, rows)));
        if let Some((mut top, mut bottom)) = span {
            // Connect to the previous column.
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
        format!("{:>LABEL_WIDTH$} {tick}{}", label.unwrap_or_default(), dots.trim_end())
    };
    bits.chunks(cols).enumerate().map(line).collect()
}

/// Merges the bins in column `x` of `count`.
fn column(bins: &[SeriesBin], x: usize, count: usize) -> SeriesBin {
    let first = x * bins.len() / count;
    let end = ((x + 1) * bins.len() / count).max(first + 1);
    SeriesBin::merged(&bins[first..end])
}

/// Draws the time axis below charts of that width, between two times [s].
pub(crate) fn time_axis(width: usize, from: f64, to: f64) -> String {
    let cols = width.saturating_sub(LABEL_WIDTH + 2).max(1);
    let label = |time: f64| format!("{time:.3} s");
    let (start, middle, end) = (label(from), label(0.5 * (from + to)), label(to));
    let mut text = format!("{:LABEL_WIDTH$} └{}\n{:LABEL_WIDTH$}  {start}", "", "─".repeat(cols), "");
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
    use super::super::series::Series;
    use super::*;

    fn drawn(values: &[f64], cols: usize, rows: usize) -> Vec<String> {
        let mut series = Series::with_capacity(256);
        values.iter().for_each(|value| series.add(*value));
        chart(series.bins(), cols + LABEL_WIDTH + 2, rows)
    }

    /// Returns the rows of dots that are set in each column, counted from the top.
    fn dots(lines: &[String], cols: usize) -> Vec<Vec<usize>> {
        let of = |x: usize| {
            let rows = 0..lines.len() * DOTS_PER_LINE;
            let is_set = |y: &usize| {
                let char = lines[y / DOTS_PER_LINE].chars().nth(LABEL_WIDTH + 2 + x / 2).unwrap_or(' ');
                (char as u32).wrapping_sub(BLANK) & BITS[y % DOTS_PER_LINE][x % 2] != 0 && char != ' '
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
    fn flat_absent_and_infinite_values_are_drawn() {
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
    fn the_largest_numbers_fit() {
        let lines = drawn(&[f64::MIN, f64::MAX, 0.0, f64::MAX], 2, 3);
        // The minimum is at the bottom, and the line at zero in the middle.
        assert_eq!(dots(&lines, 2)[0], [6, 11]);
        assert!(lines[0].contains("1.80e308 ┤") && lines[2].contains("-1.80e308 ┤"), "{lines:?}");
    }

    #[test]
    fn the_axis_extends_to_zero_if_it_is_near_and_marks_it_if_it_is_crossed() {
        let range = |low: f64, high: f64| {
            AxisRange::of(&{
                let mut series = Series::new();
                [low, high].into_iter().for_each(|value| series.add(value));
                series.bins().to_vec()
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
    fn the_time_axis_is_as_wide_as_the_chart() {
        for width in [30, 40, 62, 100] {
            let text = time_axis(width, 0.0, 3.996);
            let widths: Vec<usize> = text.lines().map(|line| line.chars().count()).collect();
            assert_eq!(widths, [width, width], "{text}");
            assert!(text.contains(" 0.000 s") && text.ends_with(" 3.996 s"));
        }
    }
}
