//! Tactile images in characters: x points right, y points up, and a cell is two characters wide.

use super::number::number;
use crate::signal::{ImageShape, Unit};

/// Maximum height of a picture [rows].
pub(crate) const MAX_ROWS: usize = 16;
/// Shades from the minimum to the maximum, without colours. The first is a dot, so that the edge of the pad is visible.
const SHADES: [&str; 9] = [". ", "::", "--", "==", "++", "**", "##", "%%", "@@"];
/// The same in the 256 colours of a terminal. The luminance rises from one to the next.
const COLOURS: [u8; 11] = [17, 54, 90, 125, 161, 167, 203, 209, 215, 221, 228];
/// Levels of a component of the 6x6x6 colours of a terminal.
const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];
/// Marks the centre of the contact.
const MARK: &str = "><";
/// Stands for a cell without any finite value.
const NOT_FINITE: &str = "??";
/// The directions of the drag of an object, from x toward y.
const ARROWS: [char; 8] = ['→', '↗', '↑', '↖', '←', '↙', '↓', '↘'];
/// Smallest drag that is drawn, as a fraction of the largest value [1].
const MIN_DRAG: f64 = 0.05;
const RESET: &str = "\x1b[0m";

/// An image at one time.
#[derive(Debug, Clone, Default)]
pub(crate) struct Snapshot {
    /// Time of the tick [ns].
    pub(crate) time: i64,
    /// Values of the tactels, row by row; of a vector image its z.
    pub(crate) cells: Vec<f32>,
    /// x and y of the tactels of a vector image; empty for an image.
    pub(crate) drag: Vec<[f32; 2]>,
    /// Sum of the finite values.
    pub(crate) sum: f64,
    /// Position of the contact [m], if there was one.
    pub(crate) mark: Option<[f64; 2]>,
}

/// The values at both ends of the shades.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ColourScale {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// Divides the images of one pad into the cells of a picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Raster<'a> {
    pub(crate) shape: &'a ImageShape,
    /// Number of tactels along each side of a cell.
    pub(crate) block: usize,
    pub(crate) has_colour: bool,
}

impl<'a> Raster<'a> {
    /// Creates a raster whose pictures are at most `width` characters wide.
    pub(crate) fn new(shape: &'a ImageShape, width: usize, has_colour: bool) -> Self {
        let fits = |block: &usize| 2 * shape.cols.div_ceil(*block) <= width && shape.rows.div_ceil(*block) <= MAX_ROWS;
        let block = (1..=shape.rows.max(shape.cols)).find(fits).unwrap_or(shape.rows.max(shape.cols).max(1));
        Self { shape, block, has_colour }
    }

    /// Creates a raster of at most `max_cells` cells along each side, with the colours of a terminal.
    pub(crate) fn with_cells(shape: &'a ImageShape, max_cells: usize) -> Self {
        Self { shape, block: shape.rows.max(shape.cols).div_ceil(max_cells).max(1), has_colour: true }
    }

    /// Returns the number of rows of cells.
    pub(crate) fn rows(self) -> usize {
        self.shape.rows.div_ceil(self.block)
    }

    /// Returns the number of columns of cells.
    pub(crate) fn cols(self) -> usize {
        self.shape.cols.div_ceil(self.block)
    }

    /// Returns the width of a picture [characters].
    pub(crate) fn width(self) -> usize {
        2 * self.cols()
    }

    /// Returns the indices of the tactels of a cell.
    fn tactels(self, row: usize, col: usize) -> impl Iterator<Item = usize> {
        let ImageShape { rows, cols, .. } = *self.shape;
        let within = |index: usize, count: usize| index * self.block..((index + 1) * self.block).min(count);
        let columns = within(col, cols);
        within(row, rows).flat_map(move |i| columns.clone().map(move |j| i * cols + j))
    }

    /// Returns the mean of the finite tactels of a cell, or `None` without any.
    pub(crate) fn cell(self, snapshot: &Snapshot, row: usize, col: usize) -> Option<f64> {
        mean(self.tactels(row, col).map(|tactel| snapshot.cells[tactel]))
    }

    /// Returns the mean drag of the tactels of a cell, or `None` if it is small against the scale, or unknown.
    pub(crate) fn drag(self, snapshot: &Snapshot, row: usize, col: usize, scale: ColourScale) -> Option<[f64; 2]> {
        let along = |axis: usize| {
            mean(self.tactels(row, col).filter_map(|tactel| snapshot.drag.get(tactel)).map(|drag| drag[axis]))
        };
        let [x, y] = [along(0)?, along(1)?];
        let smallest = MIN_DRAG * scale.high.max(-scale.low);
        (libm::hypot(x, y) > smallest).then_some([x, y])
    }

    /// Returns the range of all cells of the snapshots, including zero.
    pub(crate) fn scale(self, snapshots: &[&Snapshot]) -> ColourScale {
        let cells = snapshots.iter().flat_map(|snapshot| {
            (0..self.rows()).flat_map(move |i| (0..self.cols()).filter_map(move |j| self.cell(snapshot, i, j)))
        });
        let (low, high) = cells.fold((0.0_f64, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
        ColourScale { low, high }
    }

    /// Draws a picture, one string for each row, from the top down.
    pub(crate) fn lines(self, snapshot: &Snapshot, scale: ColourScale) -> Vec<String> {
        let mark = snapshot.mark.and_then(|at| self.cell_at(at));
        let line = |i: usize| {
            let cell = |j: usize| {
                let over = match mark == Some((i, j)) {
                    true => Over::Mark,
                    false => self.drag(snapshot, i, j, scale).map_or(Over::Nothing, Over::Drag),
                };
                self.cell_text(self.cell(snapshot, i, j), scale, over)
            };
            let reset = if self.has_colour { RESET } else { "" };
            (0..self.cols()).map(cell).collect::<String>() + reset
        };
        (0..self.rows()).rev().map(line).collect()
    }

    /// Returns the row and the column of the cell at a position [m], or `None` outside the pad.
    fn cell_at(self, [x, y]: [f64; 2]) -> Option<(usize, usize)> {
        let along = |at: f64, pitch: f64, count: usize| {
            let index = (at / pitch + count as f64 / 2.0).floor();
            (index >= 0.0 && index < count as f64).then(|| index as usize / self.block)
        };
        let ImageShape { rows, cols, pitch, .. } = *self.shape;
        Some((along(y, pitch[1], rows)?, along(x, pitch[0], cols)?))
    }

    /// Draws one cell in two characters.
    fn cell_text(self, value: Option<f64>, scale: ColourScale, over: Over) -> String {
        let Some(value) = value else { return format!("{}{NOT_FINITE}", if self.has_colour { RESET } else { "" }) };
        let levels = if self.has_colour { COLOURS.len() } else { SHADES.len() };
        let level = scale.level(value, levels);
        let shade = if self.has_colour { "  " } else { SHADES[level] };
        let text = match over {
            Over::Nothing => shade.to_owned(),
            Over::Mark => MARK.to_owned(),
            Over::Drag(drag) => format!("{}{}", &shade[..1], arrow(drag)),
        };
        if !self.has_colour {
            return text;
        }
        // Black on bright cells, white on dark cells.
        let ink = if 2 * level < levels { 231 } else { 16 };
        format!("\x1b[48;5;{};38;5;{ink}m{text}", COLOURS[level])
    }

    /// Draws all shades between the values they stand for.
    pub(crate) fn legend(self, scale: ColourScale, unit: Unit) -> String {
        let steps = if self.has_colour { COLOURS.len() } else { SHADES.len() };
        let step = |i: usize| {
            let value = scale.low + (scale.high - scale.low) * i as f64 / (steps - 1) as f64;
            self.cell_text(Some(value), scale, Over::Nothing)
        };
        let reset = if self.has_colour { RESET } else { "" };
        let ramp: String = (0..steps).map(step).collect();
        format!("{} {ramp}{reset} {} {unit}", number(scale.low), number(scale.high))
    }

    /// Describes the pad and the size of a cell.
    pub(crate) fn describe(self) -> String {
        let ImageShape { rows, cols, pitch: [x, y], .. } = *self.shape;
        let mm =
            |metres: f64| number((metres * 1e6).round() * 1e-3).trim_end_matches('0').trim_end_matches('.').to_owned();
        let pitch = if (x - y).abs() < 1e-9 { mm(x) } else { format!("{} and {}", mm(x), mm(y)) };
        let mean = match self.block {
            1 => String::new(),
            block => format!("; a cell is the mean of {block}x{block} tactels"),
        };
        format!("{rows}x{cols} tactels, {pitch} mm apart{mean}; x right, y up")
    }
}

/// What is drawn over the shade of a cell.
#[derive(Debug, Clone, Copy)]
enum Over {
    Nothing,
    /// The centre of the contact.
    Mark,
    /// The drag of the object along x and y.
    Drag([f64; 2]),
}

/// Returns the arrow that is nearest to a direction.
fn arrow([x, y]: [f64; 2]) -> char {
    let eighths = libm::atan2(y, x) / std::f64::consts::FRAC_PI_4;
    ARROWS[(eighths.round() as i64).rem_euclid(8) as usize]
}

/// Returns the mean of the values that are finite, or `None` without any.
fn mean(values: impl Iterator<Item = f32>) -> Option<f64> {
    let finite = values.filter(|value| value.is_finite());
    let (sum, count) = finite.fold((0.0, 0_u32), |(sum, count), value| (sum + f64::from(value), count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

impl ColourScale {
    /// Returns the colour of a value as SVG and HTML write it.
    pub(crate) fn hex(self, value: f64) -> String {
        hex(COLOURS[self.level(value, COLOURS.len())])
    }

    /// Returns all colours, from the lowest to the highest.
    pub(crate) fn all_hex() -> impl Iterator<Item = String> {
        COLOURS.into_iter().map(hex)
    }

    /// Returns the shade of a value, out of `levels`.
    fn level(self, value: f64, levels: usize) -> usize {
        let span = self.high - self.low;
        let share = if span > 0.0 { (value - self.low) / span } else { 0.0 };
        ((share * (levels - 1) as f64).round().max(0.0) as usize).min(levels - 1)
    }
}

/// Returns red, green and blue of a colour in the 6x6x6 colours of a terminal.
fn rgb(colour: u8) -> [u8; 3] {
    let index = usize::from(colour.saturating_sub(16));
    [index / 36 % 6, index / 6 % 6, index % 6].map(|level| LEVELS[level])
}

fn hex(colour: u8) -> String {
    let [red, green, blue] = rgb(colour);
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(rows: usize, cols: usize) -> ImageShape {
        ImageShape { rows, cols, pitch: [0.005, 0.005], unit: Unit::NEWTON }
    }

    fn snapshot(cells: impl Into<Vec<f32>>) -> Snapshot {
        Snapshot { cells: cells.into(), ..Snapshot::default() }
    }

    #[test]
    fn x_goes_right_and_y_goes_up() {
        let shape = shape(3, 4);
        let mut image = snapshot([0.0; 12]);
        // Row 2 has the largest y, column 0 the smallest x.
        image.cells[2 * 4] = 8.0;
        image.cells[1] = 4.0;
        let raster = Raster::new(&shape, 100, false);
        let scale = raster.scale(&[&image]);
        assert_eq!(raster.lines(&image, scale), ["@@. . . ", ". . . . ", ". ++. . "]);
        image.mark = Some([shape.x(3.0), shape.y(1.0)]);
        assert_eq!(raster.lines(&image, scale)[1], ". . . ><");
        for outside in [[0.02, 0.0], [0.0, -0.01], [f64::NAN, 0.0]] {
            image.mark = Some(outside);
            assert!(!raster.lines(&image, scale).concat().contains(MARK), "{outside:?}");
        }
        assert_eq!(raster.legend(scale, Unit::NEWTON), "0 . ::--==++**##%%@@ 8.000 N");
    }

    #[test]
    fn arrows_show_where_the_object_drags() {
        let shape = shape(1, 5);
        let mut image = snapshot([8.0, 8.0, 0.0, 8.0, 8.0]);
        image.drag = vec![[1.0, 0.1], [-0.5, -0.6], [0.0, 0.0], [0.2, 0.3], [f32::NAN, 1.0]];
        let raster = Raster::new(&shape, 100, false);
        assert_eq!(raster.lines(&image, raster.scale(&[&image])), ["@→@↙. @@@@"]);
        let up = (0..8).map(|i| f64::from(i) * std::f64::consts::FRAC_PI_4);
        let seen: Vec<char> = up.map(|angle| arrow([libm::cos(angle), libm::sin(angle)])).collect();
        assert_eq!(seen, ARROWS);
    }

    #[test]
    fn images_that_are_empty_or_not_finite_are_drawn() {
        let shape = shape(1, 4);
        let raster = Raster::new(&shape, 100, false);
        let image = snapshot([f32::NAN, f32::INFINITY, 0.0, 2.0]);
        assert_eq!(raster.lines(&image, raster.scale(&[&image])), ["????. @@"]);
        let empty = snapshot([0.0; 4]);
        assert_eq!(raster.lines(&empty, raster.scale(&[&empty])), [". . . . "]);
        assert_eq!(raster.scale(&[]), ColourScale { low: 0.0, high: 0.0 });
        let below = snapshot([-2.0, -1.0, 0.0, 0.0]);
        assert_eq!(raster.lines(&below, raster.scale(&[&below])), [". ++@@@@"]);
    }

    #[test]
    fn a_large_image_is_scaled_down_by_means() {
        let shape = shape(56, 128);
        for (width, block) in [(40, 7), (80, 4), (100, 4), (200, 4)] {
            let raster = Raster::new(&shape, width, false);
            assert_eq!(raster.block, block, "{width}");
            assert!(raster.width() <= width && raster.rows() <= MAX_ROWS, "{width}");
            assert!(
                raster.describe().contains(&format!("a cell is the mean of {block}x{block}")),
                "{}",
                raster.describe()
            );
            let image = snapshot([3.0; 56 * 128]);
            let lines = raster.lines(&image, raster.scale(&[&image]));
            assert!(lines.iter().all(|line| *line == "@@".repeat(raster.cols())), "{lines:?}");
        }
        let one = Raster::new(&shape, 100, false);
        let mut image = snapshot([0.0; 56 * 128]);
        image.cells[55 * 128 + 127] = 16.0;
        assert_eq!(one.scale(&[&image]).high, 1.0, "a sixteenth of its cell");
        assert!(one.lines(&image, one.scale(&[&image]))[0].ends_with("@@"));
    }

    /// Luminance of a colour of the 6x6x6 cube of a terminal, for a screen whose gamma is 2.
    fn luminance(colour: u8) -> f64 {
        let [red, green, blue] = rgb(colour).map(|value| (f64::from(value) / 255.0).powi(2));
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }

    #[test]
    fn luminance_rises_with_the_level_and_colours_keep_the_width() {
        assert_eq!([17, 208, 231].map(hex), ["#00005f", "#ff8700", "#ffffff"], "as a terminal shows them");
        assert!(COLOURS.windows(2).all(|pair| luminance(pair[0]) < luminance(pair[1])));
        let shape = shape(1, 3);
        let mut image = snapshot([0.0, 1.0, f32::NAN]);
        image.mark = Some([0.0, 0.0]);
        let raster = Raster::new(&shape, 100, true);
        let line = raster.lines(&image, raster.scale(&[&image])).concat();
        assert_eq!(line, "\x1b[48;5;17;38;5;231m  \x1b[48;5;228;38;5;16m><\x1b[0m??\x1b[0m");
    }
}
