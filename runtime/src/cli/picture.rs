//! A tactile image in characters: x to the right, y up, two characters a cell.

use super::summary::number;
use crate::signal::{ImageShape, Unit};

/// As many rows a picture has.
pub(super) const ROWS: usize = 16;
/// From nothing to the greatest value, without colours; nothing is a dot, so that the pad's edge is seen.
const SHADES: [&str; 9] = [". ", "::", "--", "==", "++", "**", "##", "%%", "@@"];
/// The same in the 256 colours of a terminal: each is brighter than the one before, also to an eye that sees no colours.
const COLOURS: [u8; 11] = [17, 54, 90, 125, 161, 167, 203, 209, 215, 221, 228];
/// The centre of the contact.
const MARK: &str = "><";
/// What is no finite number.
const BAD: &str = "??";
const RESET: &str = "\x1b[0m";

/// One image at one time.
#[derive(Debug, Clone, Default)]
pub(super) struct Frame {
    /// When it was [ns].
    pub(super) time: i64,
    /// Row after row.
    pub(super) cells: Vec<f32>,
    /// Sum of all that is finite.
    pub(super) sum: f64,
    /// Where the contact was, if there was one [m].
    pub(super) mark: Option<[f64; 2]>,
}

/// From which to which value the shades go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    low: f64,
    high: f64,
}

/// How the images of one pad are drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Easel<'a> {
    pub(super) shape: &'a ImageShape,
    /// As many tactels along each side are one cell.
    pub(super) block: usize,
    pub(super) has_colour: bool,
}

impl<'a> Easel<'a> {
    /// One whose pictures are at most `width` characters wide.
    pub(super) fn new(shape: &'a ImageShape, width: usize, has_colour: bool) -> Self {
        let fits = |block: &usize| 2 * shape.cols.div_ceil(*block) <= width && shape.rows.div_ceil(*block) <= ROWS;
        let block = (1..=shape.rows.max(shape.cols)).find(fits).unwrap_or(shape.rows.max(shape.cols).max(1));
        Self { shape, block, has_colour }
    }

    fn rows(self) -> usize {
        self.shape.rows.div_ceil(self.block)
    }

    fn cols(self) -> usize {
        self.shape.cols.div_ceil(self.block)
    }

    /// Width of a picture [characters].
    pub(super) fn width(self) -> usize {
        2 * self.cols()
    }

    /// Mean of the finite tactels of a cell; none if there are none.
    fn cell(self, frame: &Frame, row: usize, col: usize) -> Option<f64> {
        let rows = row * self.block..((row + 1) * self.block).min(self.shape.rows);
        let (mut sum, mut count) = (0.0, 0_u32);
        for i in rows {
            let start = i * self.shape.cols;
            let cells = &frame.cells[start + col * self.block..start + ((col + 1) * self.block).min(self.shape.cols)];
            for value in cells.iter().filter(|value| value.is_finite()) {
                sum += f64::from(*value);
                count += 1;
            }
        }
        (count > 0).then(|| sum / f64::from(count))
    }

    /// The scale of some frames: zero is always in it.
    pub(super) fn scale(self, frames: &[&Frame]) -> Scale {
        let cells = frames.iter().flat_map(|frame| {
            (0..self.rows()).flat_map(move |i| (0..self.cols()).filter_map(move |j| self.cell(frame, i, j)))
        });
        let (low, high) = cells.fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        Scale { low, high }
    }

    /// The picture, from the greatest y down.
    pub(super) fn lines(self, frame: &Frame, scale: Scale) -> Vec<String> {
        let mark = frame.mark.and_then(|at| self.place(at));
        let line = |i: usize| {
            let cell = |j: usize| self.paint(self.cell(frame, i, j), scale, mark == Some((i, j)));
            let reset = if self.has_colour { RESET } else { "" };
            (0..self.cols()).map(cell).collect::<String>() + reset
        };
        (0..self.rows()).rev().map(line).collect()
    }

    /// The cell that a place is in; none outside of the pad.
    fn place(self, [x, y]: [f64; 2]) -> Option<(usize, usize)> {
        let along = |at: f64, pitch: f64, count: usize| {
            let index = (at / pitch + count as f64 / 2.0).floor();
            (index >= 0.0 && index < count as f64).then(|| index as usize / self.block)
        };
        let ImageShape { rows, cols, pitch, .. } = *self.shape;
        Some((along(y, pitch[1], rows)?, along(x, pitch[0], cols)?))
    }

    /// Two characters.
    fn paint(self, value: Option<f64>, scale: Scale, is_mark: bool) -> String {
        let Some(value) = value else { return format!("{}{BAD}", if self.has_colour { RESET } else { "" }) };
        let levels = if self.has_colour { COLOURS.len() } else { SHADES.len() };
        let level = scale.level(value, levels);
        if !self.has_colour {
            return if is_mark { MARK } else { SHADES[level] }.to_owned();
        }
        // Black on what is bright, white on what is dark.
        let ink = if 2 * level < levels { 231 } else { 16 };
        format!("\x1b[48;5;{};38;5;{ink}m{}", COLOURS[level], if is_mark { MARK } else { "  " })
    }

    /// What the shades mean.
    pub(super) fn legend(self, scale: Scale, unit: Unit) -> String {
        let steps = if self.has_colour { COLOURS.len() } else { SHADES.len() };
        let step = |i: usize| {
            let value = scale.low + (scale.high - scale.low) * i as f64 / (steps - 1) as f64;
            self.paint(Some(value), scale, false)
        };
        let reset = if self.has_colour { RESET } else { "" };
        let ramp: String = (0..steps).map(step).collect();
        format!("{} {ramp}{reset} {} {unit}", number(scale.low), number(scale.high))
    }

    /// What is to be known of the pad and of the way it is drawn.
    pub(super) fn about(self) -> String {
        let ImageShape { rows, cols, pitch: [x, y], .. } = *self.shape;
        let mm =
            |metres: f64| number((metres * 1e6).round() * 1e-3).trim_end_matches('0').trim_end_matches('.').to_owned();
        let pitch = if (x - y).abs() < 1e-9 { mm(x) } else { format!("{} and {}", mm(x), mm(y)) };
        let mean = match self.block {
            1 => String::new(),
            block => format!("; a cell is the mean of {block}x{block}"),
        };
        format!("{rows}x{cols} tactels, {pitch} mm apart{mean}; x right, y up")
    }
}

impl Scale {
    fn level(self, value: f64, levels: usize) -> usize {
        let span = self.high - self.low;
        let share = if span > 0.0 { (value - self.low) / span } else { 0.0 };
        ((share * (levels - 1) as f64).round().max(0.0) as usize).min(levels - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(rows: usize, cols: usize) -> ImageShape {
        ImageShape { rows, cols, pitch: [0.005, 0.005], unit: Unit::NEWTON }
    }

    fn frame(cells: impl Into<Vec<f32>>) -> Frame {
        Frame { cells: cells.into(), ..Frame::default() }
    }

    #[test]
    fn x_goes_right_and_y_goes_up() {
        let shape = shape(3, 4);
        let mut image = frame([0.0; 12]);
        // Row 2 is that of the greatest y, column 0 that of the least x.
        image.cells[2 * 4] = 8.0;
        image.cells[1] = 4.0;
        let easel = Easel::new(&shape, 100, false);
        let scale = easel.scale(&[&image]);
        assert_eq!(easel.lines(&image, scale), ["@@. . . ", ". . . . ", ". ++. . "]);
        image.mark = Some([shape.x(3.0), shape.y(1.0)]);
        assert_eq!(easel.lines(&image, scale)[1], ". . . ><");
        for outside in [[0.02, 0.0], [0.0, -0.01], [f64::NAN, 0.0]] {
            image.mark = Some(outside);
            assert!(!easel.lines(&image, scale).concat().contains(MARK), "{outside:?}");
        }
        assert_eq!(easel.legend(scale, Unit::NEWTON), "0 . ::--==++**##%%@@ 8.000 N");
    }

    #[test]
    fn what_is_not_finite_and_what_is_empty_is_drawn_too() {
        let shape = shape(1, 4);
        let easel = Easel::new(&shape, 100, false);
        let image = frame([f32::NAN, f32::INFINITY, 0.0, 2.0]);
        assert_eq!(easel.lines(&image, easel.scale(&[&image])), ["????. @@"]);
        let empty = frame([0.0; 4]);
        assert_eq!(easel.lines(&empty, easel.scale(&[&empty])), [". . . . "]);
        assert_eq!(easel.scale(&[]), Scale { low: 0.0, high: 0.0 });
        let below = frame([-2.0, -1.0, 0.0, 0.0]);
        assert_eq!(easel.lines(&below, easel.scale(&[&below])), [". ++@@@@"]);
    }

    #[test]
    fn a_large_image_is_scaled_down_and_keeps_its_mean() {
        let shape = shape(56, 128);
        for (width, block) in [(40, 7), (80, 4), (100, 4), (200, 4)] {
            let easel = Easel::new(&shape, width, false);
            assert_eq!(easel.block, block, "{width}");
            assert!(easel.width() <= width && easel.rows() <= ROWS, "{width}");
            assert!(easel.about().contains(&format!("a cell is the mean of {block}x{block}")), "{}", easel.about());
            let image = frame([3.0; 56 * 128]);
            let lines = easel.lines(&image, easel.scale(&[&image]));
            assert!(lines.iter().all(|line| *line == "@@".repeat(easel.cols())), "{lines:?}");
        }
        let one = Easel::new(&shape, 100, false);
        let mut image = frame([0.0; 56 * 128]);
        image.cells[55 * 128 + 127] = 16.0;
        assert_eq!(one.scale(&[&image]).high, 1.0, "a sixteenth of its cell");
        assert!(one.lines(&image, one.scale(&[&image]))[0].ends_with("@@"));
    }

    /// Luminance of a colour of the 6x6x6 cube of a terminal, for a screen whose gamma is 2.
    fn luminance(colour: u8) -> f64 {
        let index = usize::from(colour) - 16;
        let linear = |level: usize| {
            let value: f64 = [0.0, 95.0, 135.0, 175.0, 215.0, 255.0][level] / 255.0;
            value * value
        };
        0.2126 * linear(index / 36) + 0.7152 * linear(index / 6 % 6) + 0.0722 * linear(index % 6)
    }

    #[test]
    fn each_colour_is_brighter_than_the_last_and_the_text_is_the_same_width() {
        assert!(COLOURS.windows(2).all(|pair| luminance(pair[0]) < luminance(pair[1])));
        let shape = shape(1, 3);
        let mut image = frame([0.0, 1.0, f32::NAN]);
        image.mark = Some([0.0, 0.0]);
        let easel = Easel::new(&shape, 100, true);
        let line = easel.lines(&image, easel.scale(&[&image])).concat();
        assert_eq!(line, "\x1b[48;5;17;38;5;231m  \x1b[48;5;228;38;5;16m><\x1b[0m??\x1b[0m");
    }
}
