//! `csv`: plain text, as any script writes it.
//!
//! There are two layouts. **A frame a row**: the tactels row by row, separated by `,`, `;`, tabs or blanks, under an
//! optional first row of names. Names with two numbers, as `t0_3` or `r0c3`, give each tactel's row and column;
//! otherwise the bench gives `size`. Of a pad with three axes the names end with the axis, as `t0_3_x`, `t0_3_y` and
//! `t0_3_z`: x and y drag the tactel, and z presses it. There may also be the columns `time` (seconds, or as in `time_ms`), `force` (a
//! force that another sensor measured [N]) and `frame`. **A frame a block**: a line for each row of tactels, and a
//! blank line between two frames; with the bench's `size` the blank lines may be missing.
//!
//! Lines that begin with `#` are comments. Where `;`, tabs or blanks separate numbers, a comma is a decimal comma. A
//! tactel that is `nan` or an empty cell in the first frame does not exist, and must be so in every frame. The bench
//! gives unit and pitch, and the rate where there is no time.

mod columns;

#[cfg(test)]
mod tests;

use self::columns::{CsvColumns, Role, names_of, unquoted};
use crate::recordings::common::reel::{Properties, Reel, bounded};
use crate::recordings::common::text::{Lines, Notation, Piece};
use crate::recordings::common::{FileFormat, FileHead, Hints, Recording, Refusal, TextError, Window};

pub(super) const FORMAT: FileFormat =
    FileFormat::text("csv", "plain CSV, a frame a row or a frame a block", recognises, parse);

/// Maximum time between the first two frames where the times have no unit [s].
const MAX_UNLABELLED_STEP_S: f64 = 2.0;
/// Maximum time where it has no unit: beyond it, the time since 1970 in seconds would be in the year 5138.
const MAX_UNLABELLED_S: f64 = 1e11;

/// Minimum number of tactels.
const MIN_TACTELS: usize = 3;

/// Recognises rows of at least two numbers, under an optional row of as many names.
fn recognises(head: &FileHead<'_>) -> bool {
    let is_cut = head.bytes.len() == super::HEAD_BYTES;
    let mut lines = Lines::new(&head.text);
    let mut next = || {
        let line = lines.by_ref().find(|line| is_content(line))?;
        Some((line, !is_cut || !lines.is_at_end()))
    };
    let width = |notation: Notation, line| notation.fields(line).count();
    match (next(), next()) {
        (Some((first, true)), Some((second, true))) => {
            let (above, below) = (names_of(first), Notation::of(second.text));
            let is_alike = above.separator == below.separator && width(above, first) == width(below, second);
            let is_named = is_alike && is_mostly_numbers(second);
            width(below, second) > 1 && (is_named || is_row_of_numbers(first.text) && is_row_of_numbers(second.text))
        }
        (Some((first, true)), None) => is_row_of_numbers(first.text) && width(Notation::of(first.text), first) > 1,
        // The first or the second row is longer than the head.
        (Some((first, is_whole)), _) => {
            let is_table = ["csv", "tsv", "txt"].contains(&&*head.ending) && width(names_of(first), first) > 1;
            let end = if is_whole { Some(first.text.len()) } else { first.text.rfind([',', ';', '\t', ' ']) };
            is_table || end.is_some_and(|end| is_row_of_numbers(&first.text[..end]))
        }
        (None, _) => false,
    }
}

/// Whether a line has more than a comment.
fn is_content(line: &Piece<'_>) -> bool {
    let text = line.text.trim_start();
    !text.is_empty() && !text.starts_with('#')
}

fn is_row_of_numbers(line: &str) -> bool {
    let (line, notation) = (Piece { text: line, start: 0 }, Notation::of(line));
    let mut cells = notation.fields(line).peekable();
    cells.peek().is_some() && cells.all(|cell| number(notation, cell, "").is_ok())
}

/// Whether more than half of a row are numbers: the reader then complains about the others at their place.
fn is_mostly_numbers(line: Piece<'_>) -> bool {
    let notation = Notation::of(line.text);
    let are_numbers = || notation.fields(line).map(|cell| number(notation, cell, "").is_ok());
    2 * are_numbers().filter(|is_number| *is_number).count() > are_numbers().count()
}

/// Parses a number, optionally in quotes; `nan` and an empty cell are NaN.
fn number(notation: Notation, cell: Piece<'_>, what: &str) -> Result<f64, TextError> {
    let cell = unquoted(cell);
    let is_missing = cell.text.is_empty() || cell.text.eq_ignore_ascii_case("nan");
    if is_missing { Ok(f64::NAN) } else { notation.number(cell, what) }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let lines = Lines::new(text);
    let first = lines.clone().find(is_content).ok_or_else(|| lines.end().error("the file has no frame"))?;
    let names = (!is_row_of_numbers(first.text)).then_some(first);
    let layout = match names {
        Some(names) => FrameLayout::Row(CsvColumns::named(names, hints)?),
        None => layout(first, lines.clone(), hints)?,
    };
    let size @ [rows, cols] = match &layout {
        FrameLayout::Row(columns) => columns.size,
        FrameLayout::Block { size, .. } => *size,
    };
    bounded(rows, cols).map_err(|message| first.error(message))?;
    first.check(rows * cols >= MIN_TACTELS, format_args!("an image needs at least {MIN_TACTELS} tactels"))?;
    let mut reader = CsvReader { reel: Reel::default(), size, start: None, unlabelled: None, force: vec![] };
    if let FrameLayout::Row(columns) = &layout {
        // A calibration does not depend on times.
        reader.unlabelled = columns.unlabelled.clone().filter(|_| hints.assumed.is_none());
    }
    reader.reserve(lines.clone());
    match layout {
        FrameLayout::Row(columns) => reader.rows(lines.clone(), names, &columns)?,
        FrameLayout::Block { are_separated, .. } => reader.blocks(lines.clone(), are_separated)?,
    }
    let CsvReader { reel, force, .. } = reader;
    lines.end().check(!reel.frames.is_empty(), "the file has names, but no frame")?;
    let force = Some(force).filter(|force| !force.is_empty());
    reel.finish(FORMAT.name, Properties { size: Some(size), force, ..Properties::default() }, hints)
}

/// The layout of the frames in the file.
enum FrameLayout {
    /// A frame a row.
    Row(CsvColumns),
    /// A frame a block of rows.
    Block { size: [usize; 2], are_separated: bool },
}

/// Returns the layout of a file without names, from the bench's size or from the blank lines.
fn layout(first: Piece<'_>, lines: Lines<'_>, hints: &Hints) -> Result<FrameLayout, Refusal> {
    let width = Notation::of(first.text).fields(first).count();
    if let Some(size @ [rows, cols]) = hints.size {
        let is_row = rows.checked_mul(cols) == Some(width);
        let message = format_args!(
            "the first row has {width} numbers: this is neither a frame of {rows} by {cols} tactels nor a row of one"
        );
        first.check(is_row || cols == width, message)?;
        bounded(rows, cols).map_err(|message| first.error(message))?;
        let block = FrameLayout::Block { size, are_separated: false };
        return Ok(if is_row { FrameLayout::Row(CsvColumns::plain(rows, cols)) } else { block });
    }
    let is_comment = |line: &Piece<'_>| line.text.trim_start().starts_with('#');
    let is_blank = |line: &Piece<'_>| line.text.trim().is_empty();
    let mut lines = lines.filter(|line| !is_comment(line)).skip_while(is_blank);
    let rows = lines.by_ref().take_while(|line| !is_blank(line)).count();
    if rows > 1 && lines.any(|line| !is_blank(&line)) {
        return Ok(FrameLayout::Block { size: [rows, width], are_separated: true });
    }
    Err(match hints.size(None).expect_err("the bench gives no size") {
        Refusal::Silent { message, help } => Refusal::Silent {
            message,
            help: format!("{help}, or add a first row with names of rows and columns, as `t0_0,t0_1`"),
        },
        other => other,
    })
}

struct CsvReader {
    reel: Reel,
    /// Number of rows and of columns.
    size: [usize; 2],
    /// Time of the first frame [s].
    start: Option<f64>,
    /// Name of the column with the time, if nothing gives its unit.
    unlabelled: Option<String>,
    /// Forces of another sensor [N]; empty if the file has none.
    force: Vec<f64>,
}

impl CsvReader {
    /// Reserves memory for the frames that the file can hold at most.
    fn reserve(&mut self, lines: Lines<'_>) {
        let tactels = self.size[0] * self.size[1];
        let sizes = lines.filter(is_content).map(|line| line.text.len() + 1);
        let (count, bytes) = sizes.fold((0, 0), |(count, bytes), size| (count + 1, bytes + size));
        // A number takes at least one character and one separator.
        let frames = (bytes / (2 * tactels) + 1).min(count);
        self.reel.frames.reserve_exact(frames);
        self.reel.cells.reserve_exact(frames * tactels);
    }

    /// Ends a frame.
    fn frame(&mut self, time: Option<i64>) {
        let [rows, cols] = self.size;
        self.reel.frame(self.reel.frames.len() as u64, time, Window::whole(rows, cols));
    }

    /// Reads a frame a row.
    fn rows(&mut self, lines: Lines<'_>, names: Option<Piece<'_>>, columns: &CsvColumns) -> Result<(), TextError> {
        let is_names = |line: &Piece<'_>| names.is_some_and(|names| names.start == line.start);
        let mut frame = vec![0.0; self.size[0] * self.size[1]];
        let mut drag = vec![[0.0_f64; 2]; if columns.has_axes() { frame.len() } else { 0 }];
        for line in lines.filter(|line| is_content(line) && !is_names(line)) {
            let notation = Notation::of(line.text);
            let (mut found, mut time) = (0, None);
            for cell in notation.fields(line) {
                let value = number(notation, cell, "this cell")?;
                match columns.roles.get(found) {
                    Some(Role::Tactel(index)) => frame[*index] = value,
                    Some(Role::Drag(index, axis)) => {
                        drag[*index][usize::from(*axis)] = value;
                    }
                    Some(Role::Time) => time = Some(self.since_start(value * columns.second, cell)?),
                    Some(Role::Force) => {
                        cell.check(value.is_finite(), "a force must be a number")?;
                        self.force.push(value);
                    }
                    Some(Role::Passed) | None => {}
                }
                found += 1;
            }
            let (number, count) = (self.reel.frames.len() + 1, columns.roles.len());
            line.check(found == count, format_args!("frame {number} has {found} columns, not {count}"))?;
            for (index, value) in frame.iter().enumerate() {
                let is_here =
                    |(column, _): &(usize, Piece<'_>)| columns.roles.get(*column) == Some(&Role::Tactel(index));
                let place = || notation.fields(line).enumerate().find(is_here).map_or(line, |(_, at)| at);
                self.reel.cell(*value).map_err(|message| place().error(message))?;
            }
            for (drag, z) in drag.iter().zip(&frame) {
                // A tactel that does not exist has no drag.
                let drag = if z.is_nan() { [0.0; 2] } else { drag.map(|value| value as f32) };
                line.check(drag.iter().all(|value| value.is_finite()), "an x or a y is not a number")?;
                self.reel.drag.push(drag);
            }
            self.frame(time);
        }
        Ok(())
    }

    /// Returns a time since the first [ns].
    fn since_start(&mut self, seconds: f64, at: Piece<'_>) -> Result<i64, TextError> {
        let since = seconds - *self.start.get_or_insert(seconds);
        if let Some(name) = &self.unlabelled
            && self.reel.frames.len() <= 1
            && (since > MAX_UNLABELLED_STEP_S || seconds.abs() > MAX_UNLABELLED_S)
        {
            let what = match since > 0.0 {
                true => format!("{since} from one frame to the next"),
                false => format!("{seconds} in the first frame"),
            };
            return Err(at.error(format!(
                "`{name}` has no unit, and can hardly be in seconds: {what}; name the column `{name}_ms` if these are \
                 milliseconds, or give the unit: `time_unit = \"ms\"` for the device in the bench, `--time-unit ms` for \
                 `tactflow features` (s, ms, us, ns)"
            )));
        }
        at.check(since >= 0.0 || since.is_nan(), "the time goes back")?;
        at.check(since < 1e9, "a time must be a number, at most 1e9 s after the first frame")?;
        self.reel.time(since * 1e9, at)
    }

    /// Reads a frame a block.
    fn blocks(&mut self, mut lines: Lines<'_>, are_separated: bool) -> Result<(), TextError> {
        let [rows, _] = self.size;
        let mut row = 0;
        let mut was_blank = true;
        for line in lines.by_ref() {
            let number = self.reel.frames.len() + 1;
            if line.text.trim().is_empty() {
                was_blank = true;
                line.check(row == 0, format_args!("frame {number} ends after {row} of its {rows} rows"))?;
            }
            if !is_content(&line) {
                continue;
            }
            let is_extra = are_separated && row == 0 && !was_blank;
            line.check(!is_extra, format_args!("frame {} has more than {rows} rows", number - 1))?;
            was_blank = false;
            self.row(line, row)?;
            row = (row + 1) % rows;
            if row == 0 {
                self.frame(None);
            }
        }
        let number = self.reel.frames.len() + 1;
        let message = format_args!("frame {number} ends after {row} of its {rows} rows: the file is cut off");
        lines.end().check(row == 0, message)
    }

    fn row(&mut self, line: Piece<'_>, row: usize) -> Result<(), TextError> {
        let notation = Notation::of(line.text);
        let (found, [_, cols]) = (notation.fields(line).count(), self.size);
        let (row, frame) = (row + 1, self.reel.frames.len() + 1);
        line.check(found == cols, format_args!("row {row} of frame {frame} has {found} cells, not {cols}"))?;
        self.reel.row(notation.fields(line), |cell| number(notation, cell, "this cell"))
    }
}
