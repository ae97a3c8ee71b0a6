//! `csv`: plain text, as any script writes it.
//!
//! There are two layouts. **A frame a row**: the tactels row by row, separated by `,`, `;`, tabs or blanks, under an
//! optional first row of names. Names with two numbers, as `t0_3` or `r0c3`, give each tactel's row and column; otherwise
//! the bench gives `size`. There may also be the columns `time` (seconds, or as in `time_ms`), `force` (a force that
//! another sensor measured [N]) and `frame`. **A frame a block**: a line for each row of tactels, and a blank line
//! between two frames; with the bench's `size` the blank lines may be missing.
//!
//! Lines that begin with `#` are comments. Where `;`, tabs or blanks separate numbers, a comma is a decimal comma. A
//! tactel that is `nan` or an empty cell in the first frame does not exist, and must be so in every frame. The bench gives
//! unit and pitch, and the rate where there is no time.

mod columns;

#[cfg(test)]
mod tests;

use tactflow_runtime::signal::ImageShape;

use self::columns::{Columns, Role, names_of, unquoted};
use crate::recordings::common::reel::{Reel, bounded};
use crate::recordings::common::text::{self, Lines, Notation, Piece, Wrong, flaw};
use crate::recordings::common::{Flaw, Format, Head, Hints, Recording, Refusal};

pub(super) const FORMAT: Format = Format {
    name: "csv",
    title: "plain CSV, a frame a row or a frame a block",
    recognises,
    read: |bytes, hints| text::read(bytes, hints, parse),
};

/// Minimum number of tactels.
const MIN_TACTELS: usize = 3;

/// Recognises rows of at least two numbers, under an optional row of as many names.
fn recognises(head: &Head<'_>) -> bool {
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
fn number(notation: Notation, cell: Piece<'_>, what: &str) -> Result<f64, Flaw> {
    let cell = unquoted(cell);
    let is_missing = cell.text.is_empty() || cell.text.eq_ignore_ascii_case("nan");
    if is_missing { Ok(f64::NAN) } else { notation.number(cell, what) }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let lines = Lines::new(text);
    let Some(first) = lines.clone().find(is_content) else {
        return flaw(&lines.end(), "the file has no frame").map_err(Wrong::from);
    };
    let names = (!is_row_of_numbers(first.text)).then_some(first);
    let layout = match names {
        Some(names) => Layout::Rows(Columns::named(names, hints)?),
        None => layout(first, lines.clone(), hints)?,
    };
    let (rows, cols) = layout.size();
    bounded(rows, cols).or_else(|message| flaw(&first, message))?;
    if rows * cols < MIN_TACTELS {
        return flaw(&first, format!("an image needs at least {MIN_TACTELS} tactels")).map_err(Wrong::from);
    }
    let mut reader = Reader { reel: Reel::default(), time: vec![], force: vec![] };
    reader.reserve(lines.clone(), rows * cols);
    match &layout {
        Layout::Rows(columns) => reader.rows(lines, names, columns)?,
        Layout::Blocks { rows, cols, are_separated } => reader.blocks(lines, *rows, *cols, *are_separated)?,
    }
    let Reader { mut reel, time, force } = reader;
    if reel.frames.is_empty() {
        return flaw(&Lines::new(text).end(), "the file has names, but no frame").map_err(Wrong::from);
    }
    reel.frames.iter_mut().zip(&time).for_each(|(frame, time)| frame.time = *time);
    let found = reel.mean_step().filter(|_| !time.is_empty());
    let (unit, pitch, period) = hints.complete(None, None, found)?;
    let shape = ImageShape { rows, cols, unit, pitch };
    if time.is_empty() {
        reel.tick(period);
    }
    let force = Some(force).filter(|force| !force.is_empty());
    let Reel { frames, cells, dead } = reel;
    Ok(Recording { format: FORMAT.name, shape, frames, cells, dead, threshold: None, period, force })
}

/// The layout of the frames in the file.
enum Layout {
    /// A frame a row.
    Rows(Columns),
    /// A frame a block of rows.
    Blocks { rows: usize, cols: usize, are_separated: bool },
}

impl Layout {
    fn size(&self) -> (usize, usize) {
        match self {
            Self::Rows(columns) => columns.size,
            Self::Blocks { rows, cols, .. } => (*rows, *cols),
        }
    }
}

/// Returns the layout of a file without names, from the bench's size or from the blank lines.
fn layout(first: Piece<'_>, lines: Lines<'_>, hints: &Hints) -> Result<Layout, Wrong> {
    let width = Notation::of(first.text).fields(first).count();
    if let Some([rows, cols]) = hints.size {
        return match () {
            () if rows.checked_mul(cols) == Some(width) => Ok(Layout::Rows(Columns::plain(rows, cols))),
            () if cols == width => Ok(Layout::Blocks { rows, cols, are_separated: false }),
            () => {
                let message = format!(
                    "the first row has {width} numbers: this is neither a frame of {rows} by {cols} tactels nor a row of one"
                );
                flaw(&first, message).map_err(Wrong::from)
            }
        };
    }
    let is_comment = |line: &Piece<'_>| line.text.trim_start().starts_with('#');
    let mut lines = lines.filter(|line| !is_comment(line)).skip_while(|line| line.text.trim().is_empty());
    let rows = lines.by_ref().take_while(|line| !line.text.trim().is_empty()).count();
    if rows > 1 && lines.any(|line| !line.text.trim().is_empty()) {
        return Ok(Layout::Blocks { rows, cols: width, are_separated: true });
    }
    let refusal = hints.size(None).map(|_| ()).expect_err("there was no size");
    Err(match refusal {
        Refusal::Silent { message, help } => Refusal::Silent {
            message,
            help: format!("{help}, or add a first row with names of rows and columns, as `t0_0,t0_1`"),
        },
        other => other,
    }
    .into())
}

struct Reader {
    reel: Reel,
    /// Times from the first frame [ns]; empty if the file has none.
    time: Vec<i64>,
    /// Forces of another sensor [N]; empty if the file has none.
    force: Vec<f64>,
}

impl Reader {
    /// Reserves memory for the frames that the file can hold at most.
    fn reserve(&mut self, lines: Lines<'_>, tactels: usize) {
        let (mut count, mut bytes) = (0, 0);
        for line in lines.filter(is_content) {
            count += 1;
            bytes += line.text.len() + 1;
        }
        // A number takes at least one character and one separator.
        let frames = count.min(bytes / (2 * tactels) + 1);
        self.reel.frames.reserve_exact(frames);
        self.reel.cells.reserve_exact(frames * tactels);
    }

    /// Reads a frame a row.
    fn rows(&mut self, lines: Lines<'_>, names: Option<Piece<'_>>, columns: &Columns) -> Result<(), Flaw> {
        let tactels = columns.size.0 * columns.size.1;
        let mut start = None;
        let is_names = |line: &Piece<'_>| names.is_some_and(|names| names.start == line.start);
        let mut frame = vec![0.0; tactels];
        for line in lines.filter(|line| is_content(line) && !is_names(line)) {
            let notation = Notation::of(line.text);
            let mut found = 0;
            for (i, cell) in notation.fields(line).enumerate() {
                found += 1;
                let value = number(notation, cell, "this cell")?;
                match columns.role(i) {
                    None => {}
                    Some(Role::Tactel(index)) => frame[index] = value,
                    Some(Role::Passed) => {}
                    Some(Role::Force) if value.is_finite() => self.force.push(value),
                    Some(Role::Time) => self.time.push(self.since(&mut start, value * columns.second, cell)?),
                    Some(Role::Force) => return flaw(&cell, "a force must be a number"),
                }
            }
            if found != columns.count {
                let number = self.reel.frames.len() + 1;
                let message = format!("frame {number} has {found} columns, not {}", columns.count);
                return flaw(&line, message);
            }
            for (index, value) in frame.iter().enumerate() {
                let place =
                    || notation.fields(line).enumerate().find(|(i, _)| columns.role(*i) == Some(Role::Tactel(index)));
                self.reel.cell(index, *value).or_else(|message| flaw(&place().map_or(line, |(_, at)| at), message))?;
            }
            self.reel.frame(self.reel.frames.len() as u64, 0, columns.size.0, columns.size.1);
        }
        Ok(())
    }

    /// Returns a time since the first [ns].
    fn since(&self, start: &mut Option<f64>, seconds: f64, at: Piece<'_>) -> Result<i64, Flaw> {
        let since = seconds - *start.get_or_insert(seconds);
        if since < 0.0 {
            return flaw(&at, "the time goes back");
        }
        if !(0.0..1e9).contains(&since) {
            return flaw(&at, "a time must be a number, at most 1e9 s after the first frame");
        }
        let time = (since * 1e9).round() as i64;
        if self.time.last().is_some_and(|last| *last > time) { flaw(&at, "the time goes back") } else { Ok(time) }
    }

    /// Reads a frame a block.
    fn blocks(&mut self, mut lines: Lines<'_>, rows: usize, cols: usize, are_separated: bool) -> Result<(), Flaw> {
        let mut row = 0;
        let mut was_blank = true;
        for line in lines.by_ref() {
            let number = self.reel.frames.len() + 1;
            if line.text.trim().is_empty() {
                was_blank = true;
                if row > 0 {
                    return flaw(&line, format!("frame {number} ends after {row} of its {rows} rows"));
                }
                continue;
            }
            if !is_content(&line) {
                continue;
            }
            if are_separated && row == 0 && !was_blank {
                return flaw(&line, format!("frame {} has more than {rows} rows", number - 1));
            }
            was_blank = false;
            self.row(line, row, cols)?;
            row += 1;
            if row == rows {
                self.reel.frame(self.reel.frames.len() as u64, 0, rows, cols);
                row = 0;
            }
        }
        if row > 0 {
            let number = self.reel.frames.len() + 1;
            return flaw(
                &lines.end(),
                format!("frame {number} ends after {row} of its {rows} rows: the file is cut off"),
            );
        }
        Ok(())
    }

    fn row(&mut self, line: Piece<'_>, row: usize, cols: usize) -> Result<(), Flaw> {
        let notation = Notation::of(line.text);
        let found = notation.fields(line).count();
        if found != cols {
            let number = self.reel.frames.len() + 1;
            return flaw(&line, format!("row {} of frame {number} has {found} cells, not {cols}", row + 1));
        }
        for (col, cell) in notation.fields(line).enumerate() {
            let value = number(notation, cell, "this cell")?;
            self.reel.cell(row * cols + col, value).or_else(|message| flaw(&cell, message))?;
        }
        Ok(())
    }
}
