//! The text of a Tekscan ASCII movie: a header of `KEY value` lines up to `ASCII_DATA @@`, then frames, then `@@`.
//!
//! I-Scan, F-Scan and CONFORMat write it, as `.csv` and as `.asf`. A frame is a line `Frame 3`, with or without more
//! (`Frame 3, 0.2,, 12/2/2019 6:21:52.54PM,,,Raw Sum=,,308`), and a line of cells for each row; `B` is a cell without a
//! sensel. Pressures become kPa, forces become N. All other text is refused at its place, so that a recording that was
//! cut or edited by hand does not pass as data. The header gives the mark that ends the movie: a file without it is cut
//! off.

mod header;

use tactflow_runtime::signal::Unit;

use crate::recordings::common::reel::Reel;
use crate::recordings::common::text::{Lines, Notation, Piece, shortened};
use crate::recordings::common::{FileFormat, FileHead, Hints, Recording, Refusal, TextError, Window};
use header::MovieHeader;

pub(super) const FORMAT: FileFormat =
    FileFormat::text("tekscan", "Tekscan ASCII movie (.csv, .asf)", recognises, parse);

fn recognises(head: &FileHead<'_>) -> bool {
    let is_key = |line: &str| line.starts_with("DATA_TYPE ") || line.starts_with("ASCII_DATA");
    head.text.lines().any(|line| is_key(line.trim_start().trim_start_matches('"')))
}

/// Reads a movie. Errors are all mistakes in the header, or the first mistake in the frames.
fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let mut lines = Lines::new(text);
    let header = header::read(&mut lines, text.len(), hints)?;
    let [rows, cols] = header.size;
    // Both are counts of what the file has, not of what its header says.
    let frames = text.matches("Frame").count().min(text.len() / (2 * rows * cols));
    let mut reel = Reel::new([
        "this cell is `B`, but it has a sensel in the first frame",
        "this cell has a sensel, but it is `B` in the first frame",
    ]);
    reel.frames.reserve_exact(frames);
    reel.cells.reserve_exact(frames * rows * cols);
    let mut reader = MovieReader { header, lines, notation: None, first: None, reel };
    reader.frames()?;
    let MovieReader { mut reel, header: MovieHeader { mut found, .. }, .. } = reader;
    let single = (reel.frames.len() == 1 && hints.rate_hz.is_none()).then_some(1.0);
    found.period = found.period.or(reel.mean_step()).or(single);
    // Times that are rounded until two are equal are ignored: then the frames come at the nominal rate.
    reel.forget_equal_times();
    reel.finish(FORMAT.name, found, hints)
}

struct MovieReader<'t> {
    header: MovieHeader<'t>,
    lines: Lines<'t>,
    notation: Option<Notation>,
    /// Place of the number of the first frame.
    first: Option<Piece<'t>>,
    reel: Reel,
}

impl<'t> MovieReader<'t> {
    fn frames(&mut self) -> Result<(), TextError> {
        while let Some(line) = self.lines.next() {
            let line = header::bare(line);
            match line.text {
                "" => {}
                text if text == self.header.mark => return self.end(line),
                _ if is_frame_line(line) => self.frame(line)?,
                text => return Err(line.error(format!("expected a frame or `@@`, found `{}`", shortened(text)))),
            }
        }
        let last = self.reel.frames.last();
        let after = last.map_or_else(String::new, |frame| format!(" after frame {}", frame.number));
        Err(self.lines.end().error(format!("the file ends{after} without `@@`: it is truncated")))
    }

    /// Checks the end at `@@`: no frame may be missing before it, and no text may come after it.
    fn end(&mut self, at: Piece<'t>) -> Result<(), TextError> {
        let (Some(first_at), [first, ..], Some(last)) = (self.first, &*self.reel.frames, self.reel.frames.last())
        else {
            return Err(at.error("the file has no frame"));
        };
        let MovieHeader { start_frame, end_frame, .. } = self.header;
        let count = self.reel.frames.len() as u64;
        // A part of a movie may have new numbers.
        let is_complete =
            start_frame.zip(end_frame).is_some_and(|(start, (end, _))| end.checked_sub(start) == Some(count - 1));
        if let Some(start) = start_frame {
            let message = format_args!("the first frame is {}, but `START_FRAME` is {start}", first.number);
            first_at.check(is_complete || start == first.number, message)?;
        }
        if let Some((end, at)) = end_frame {
            let message = format_args!("`END_FRAME` is {end}, but the last frame is {}", last.number);
            at.check(is_complete || end == last.number, message)?;
        }
        let after = self.lines.by_ref().map(header::bare).find(|line| !line.text.is_empty());
        after.map_or(Ok(()), |line| Err(line.error("unexpected text after `@@`, the end of the movie")))
    }

    fn frame(&mut self, line: Piece<'t>) -> Result<(), TextError> {
        let FrameLine { number, at, time, sum } = frame_line(line)?;
        self.reel.follows(number, at)?;
        self.first.get_or_insert(at);
        let time = self.time(time)?;
        let [rows, cols] = self.header.size;
        let start = self.reel.cells.len();
        for row in 0..rows {
            self.row(number, row)?;
        }
        if let Some((wanted, at)) = sum
            && self.header.found.unit == Some((Unit::RAW, 1.0))
        {
            let total: f64 = self.reel.cells[start..].iter().map(|cell| f64::from(*cell)).sum();
            let message = format_args!("`Raw Sum` is {wanted}, but the cells of frame {number} sum to {total}");
            // The sum of averages is rounded to a count.
            at.check((total - wanted).abs() <= 0.5, message)?;
        }
        self.reel.frame(number, time, Window::whole(rows, cols));
        Ok(())
    }

    /// Returns the time of the next frame [ns]. The first frame decides whether the frames have times.
    fn time(&self, field: Option<Piece<'t>>) -> Result<Option<i64>, TextError> {
        let is_first = self.reel.frames.is_empty();
        let is_time =
            |field: &Piece<'t>| if is_first { field.decimal("").is_ok() } else { self.reel.is_timed_alike(true) };
        let Some(field) = field.filter(is_time) else { return Ok(None) };
        let seconds = field.decimal("the frame's time")?;
        let is_in_range = (0.0..1e9).contains(&seconds);
        field
            .check(is_in_range, format_args!("the frame's time is not from 0 to 1e9 s: `{}`", shortened(field.text)))?;
        self.reel.time(seconds * 1e9, field).map(Some)
    }

    /// Reads one row of cells.
    fn row(&mut self, frame: u64, row: usize) -> Result<(), TextError> {
        let [rows, cols] = self.header.size;
        let line = self.lines.next().map_or_else(|| self.lines.end(), Piece::trimmed);
        let is_end = line.text.is_empty() || line.text == self.header.mark || is_frame_line(line);
        line.check(!is_end, format_args!("frame {frame} ends after {row} of its {rows} rows"))?;
        let notation = *self.notation.get_or_insert_with(|| Notation::of(line.text));
        let (found, cut) = (notation.fields(line).count(), self.lines.cut());
        let message = format_args!("row {} of frame {frame} has {found} cells, but `COLS` is {cols}{cut}", row + 1);
        line.check(found == cols, message)?;
        let factor = self.header.found.factor();
        self.reel.row(notation.fields(line), |cell| {
            if matches!(cell.text, "B" | "b") {
                return Ok(f64::NAN);
            }
            let value = notation.number(cell, "this cell")? * factor;
            let is_small = (value as f32).is_finite();
            cell.check(is_small, format_args!("this cell is too large: `{}`", shortened(cell.text)))?;
            Ok(value)
        })
    }
}

fn is_frame_line(line: Piece<'_>) -> bool {
    line.part_after_quote().after("Frame").is_some()
}

/// The content of the line of a frame.
struct FrameLine<'t> {
    number: u64,
    /// Place of the number.
    at: Piece<'t>,
    /// The field of the time, which may hold something else.
    time: Option<Piece<'t>>,
    /// The sum of all cells [raw], and its place.
    sum: Option<(f64, Piece<'t>)>,
}

/// Parses `Frame 3` or `Frame 3, 0.2,, …,,,Raw Sum=,,308`.
fn frame_line(line: Piece<'_>) -> Result<FrameLine<'_>, TextError> {
    let rest = line.part_after_quote().after("Frame").expect("the caller has checked the line");
    let rest = rest.part(rest.text.trim_start_matches([':', '#', '=', ' ', '\t']));
    let mut fields = Notation::of(rest.text).fields(rest);
    let at = fields.next().unwrap_or(rest);
    let number = at.count("the frame's number")?;
    let time = fields.next();
    let Some(key) = fields.find(|field| field.after("Raw Sum").is_some()) else {
        return Ok(FrameLine { number, at, time, sum: None });
    };
    let beside = key.text.split_once('=').map(|(_, sum)| key.part(sum).trimmed());
    let sum = beside.filter(|sum| !sum.text.is_empty()).or_else(|| fields.find(|field| !field.text.is_empty()));
    let sum = sum.ok_or_else(|| key.error("`Raw Sum=` has no number: the line is cut off"))?;
    Ok(FrameLine { number, at, time, sum: Some((sum.decimal("the frame's sum")?, sum)) })
}

#[cfg(test)]
mod tests;
