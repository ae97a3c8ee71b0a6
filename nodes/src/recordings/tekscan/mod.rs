//! The text of a Tekscan ASCII movie: a header of `KEY value` lines up to `ASCII_DATA @@`, then frames, then `@@`.
//!
//! I-Scan, F-Scan and CONFORMat write it, as `.csv` and as `.asf`. A frame is a line `Frame 3`, with or without more
//! (`Frame 3, 0.2,, 12/2/2019 6:21:52.54PM,,,Raw Sum=,,308`), and a line of cells for each row; `B` is a cell without a
//! sensel. Pressures become kPa, forces become N. All other text is refused at its place, so that a recording that was cut
//! or edited by hand does not pass as data. The header gives the mark that ends the movie: a file without it is cut off.

mod header;

use tactflow_runtime::signal::{ImageShape, Unit};

use crate::recordings::common::text::{self, Lines, Notation, Piece, Wrong, flaw, shortened};
use crate::recordings::common::{Flaw, Format, Frame, Head, Hints, Recording, Refusal, Window};
use header::Header;

pub(super) const FORMAT: Format =
    Format { name: "tekscan", title: "Tekscan ASCII movie (.csv, .asf)", recognises, read };

fn recognises(head: &Head<'_>) -> bool {
    let is_key = |line: &str| line.starts_with("DATA_TYPE ") || line.starts_with("ASCII_DATA");
    head.text.lines().any(|line| is_key(line.trim_start().trim_start_matches('"')))
}

fn read(bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
    text::read(bytes, hints, parse)
}

/// Reads a movie. Errors are all mistakes in the header, or the first mistake in the frames.
fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let mut lines = Lines::new(text);
    let header = header::read(&mut lines, text.len(), hints)?;
    let tactels = header.shape.tactels();
    // Both are counts of what the file has, not of what its header says.
    let frames = text.matches("Frame").count().min(text.len() / (2 * tactels));
    let mut reader = Reader {
        header: &header,
        notation: None,
        first: None,
        times: Vec::new(),
        frames: Vec::with_capacity(frames),
        cells: Vec::with_capacity(frames * tactels),
        dead: Vec::new(),
    };
    reader.frames(&mut lines)?;
    let Reader { mut frames, cells, dead, times, .. } = reader;
    let period = set_times(&mut frames, &times, header.period, hints)?;
    let Header { mut shape, threshold, .. } = header;
    shape.unit = hints.unit(Some(shape.unit))?;
    shape.pitch = hints.pitch(Some(shape.pitch))?;
    hints.size(Some([shape.rows, shape.cols]))?;
    Ok(Recording { format: FORMAT.name, shape, frames, cells, dead, threshold, period, force: None })
}

/// Sets the times of the frames, and returns the nominal time between two frames [s].
///
/// Times that are rounded until two are equal are ignored: then the frames come at the nominal rate.
fn set_times(frames: &mut [Frame], times: &[i64], period: Option<f64>, hints: &Hints) -> Result<f64, Refusal> {
    let is_single = frames.len() == 1;
    let mean = match times {
        [first, .., last] if last > first => Some((last - first) as f64 * 1e-9 / (times.len() - 1) as f64),
        _ => hints.rate_hz.map(|rate| 1.0 / rate).or(is_single.then_some(1.0)),
    };
    let period = hints.period(period.or(mean))?;
    let are_times = times.len() == frames.len() && times.is_sorted_by(|a, b| a < b);
    for (index, frame) in frames.iter_mut().enumerate() {
        frame.time = if are_times { times[index] - times[0] } else { (index as f64 * period * 1e9).round() as i64 };
    }
    Ok(period)
}

struct Reader<'h> {
    header: &'h Header<'h>,
    notation: Option<Notation>,
    /// Place of the number of the first frame.
    first: Option<std::ops::Range<usize>>,
    /// Times of the frames [ns]; empty if the first frame has none.
    times: Vec<i64>,
    frames: Vec<Frame>,
    cells: Vec<f32>,
    dead: Vec<usize>,
}

impl Reader<'_> {
    fn frames(&mut self, lines: &mut Lines<'_>) -> Result<(), Flaw> {
        while let Some(line) = lines.next() {
            let line = header::bare(line);
            match line.text {
                "" => {}
                text if text == self.header.mark => return self.end(line, lines),
                _ if is_frame_line(line) => self.frame(line, lines)?,
                text => return flaw(&line, format!("expected a frame or `@@`, found `{}`", shortened(text))),
            }
        }
        let after = self.frames.last().map_or_else(String::new, |frame| format!(" after frame {}", frame.number));
        flaw(&lines.end(), format!("the file ends{after} without `@@`: it is truncated"))
    }

    /// Checks the end at `@@`: no frame may be missing before it, and no text may come after it.
    fn end(&self, at: Piece<'_>, lines: &mut Lines<'_>) -> Result<(), Flaw> {
        let (Some(first), Some(last)) = (self.frames.first(), self.frames.last()) else {
            return flaw(&at, "the file has no frame");
        };
        let Header { start_frame, end_frame, .. } = self.header;
        // A part of a movie may have new numbers.
        let end = end_frame.as_ref().map(|(end, _)| *end);
        let count = self.frames.len() as u64;
        let is_complete = start_frame.zip(end).is_some_and(|(start, end)| end.checked_sub(start) == Some(count - 1));
        match (start_frame, end_frame) {
            _ if is_complete => {}
            (Some(start), _) if *start != first.number => {
                let message = format!("the first frame is {}, but `START_FRAME` is {start}", first.number);
                let span = self.first.clone().expect("the first frame has set it");
                return Err(Flaw { span, message });
            }
            (_, Some((end, span))) if last.number != *end => {
                let message = format!("`END_FRAME` is {end}, but the last frame is {}", last.number);
                return Err(Flaw { span: span.clone(), message });
            }
            _ => {}
        }
        match lines.map(header::bare).find(|line| !line.text.is_empty()) {
            Some(line) => flaw(&line, "unexpected text after `@@`, the end of the movie"),
            None => Ok(()),
        }
    }

    fn frame(&mut self, line: Piece<'_>, lines: &mut Lines<'_>) -> Result<(), Flaw> {
        let Line { number, at, time, sum } = frame_line(line)?;
        match self.frames.last() {
            Some(last) if last.number.checked_add(1) != Some(number) => {
                return flaw(&at, format!("frame {number} comes after frame {}", last.number));
            }
            None => self.first = Some(at.span()),
            _ => {}
        }
        self.time(time)?;
        let start = self.cells.len();
        let mut total = 0.0;
        for row in 0..self.header.shape.rows {
            total += self.row(number, row, lines)?;
        }
        match sum {
            // The sum of averages is rounded to a count.
            Some((wanted, at)) if self.header.shape.unit == Unit::RAW && (total - wanted).abs() > 0.5 => {
                let message = format!("`Raw Sum` is {wanted}, but the cells of frame {number} sum to {total}");
                return flaw(&at, message);
            }
            _ => {}
        }
        let ImageShape { rows, cols, .. } = self.header.shape;
        self.frames.push(Frame { number, time: 0, window: Window::whole(rows, cols), start });
        Ok(())
    }

    /// Adds the time of the next frame. The first frame decides whether the frames have times.
    fn time(&mut self, field: Option<Piece<'_>>) -> Result<(), Flaw> {
        let is_first = self.frames.is_empty();
        let Some(field) = field.filter(|field| !is_first || field.decimal("").is_ok()) else { return Ok(()) };
        if !is_first && self.times.is_empty() {
            return Ok(());
        }
        let seconds = field.decimal("the frame's time")?;
        if !(0.0..1e9).contains(&seconds) {
            let text = shortened(field.text);
            return flaw(&field, format!("the frame's time is not from 0 to 1e9 s: `{text}`"));
        }
        let time = (seconds * 1e9).round() as i64;
        if self.times.last().is_some_and(|last| *last > time) {
            return flaw(&field, "the time goes back");
        }
        self.times.push(time);
        Ok(())
    }

    /// Reads one row of cells, and returns its sum.
    fn row(&mut self, frame: u64, row: usize, lines: &mut Lines<'_>) -> Result<f64, Flaw> {
        let ImageShape { rows, cols, .. } = self.header.shape;
        let line = lines.next().map_or_else(|| lines.end(), Piece::trimmed);
        if line.text.is_empty() || line.text == self.header.mark || is_frame_line(line) {
            return flaw(&line, format!("frame {frame} ends after {row} of its {rows} rows"));
        }
        let notation = *self.notation.get_or_insert_with(|| Notation::of(line.text));
        let found = notation.fields(line).count();
        if found != cols {
            let cut = if lines.is_at_end() { ": the file ends in the middle of it" } else { "" };
            let message = format!("row {} of frame {frame} has {found} cells, but `COLS` is {cols}{cut}", row + 1);
            return flaw(&line, message);
        }
        let mut sum = 0.0;
        for (col, cell) in notation.fields(line).enumerate() {
            let value = self.cell(row * cols + col, cell, notation)?;
            sum += f64::from(value);
            self.cells.push(value);
        }
        Ok(sum)
    }

    fn cell(&mut self, index: usize, cell: Piece<'_>, notation: Notation) -> Result<f32, Flaw> {
        let is_dead = matches!(cell.text, "B" | "b");
        if self.frames.is_empty() {
            if is_dead {
                self.dead.push(index);
            }
        } else if is_dead != self.dead.binary_search(&index).is_ok() {
            let message = if is_dead {
                "this cell is `B`, but it has a sensel in the first frame"
            } else {
                "this cell has a sensel, but it is `B` in the first frame"
            };
            return flaw(&cell, message);
        }
        if is_dead {
            return Ok(0.0);
        }
        let value = (notation.number(cell, "this cell")? * self.header.factor) as f32;
        if value.is_finite() {
            Ok(value)
        } else {
            flaw(&cell, format!("this cell is too large: `{}`", shortened(cell.text)))
        }
    }
}

fn is_frame_line(line: Piece<'_>) -> bool {
    line.part_after_quote().after("Frame").is_some()
}

/// The content of the line of a frame.
struct Line<'t> {
    number: u64,
    /// Place of the number.
    at: Piece<'t>,
    /// The field of the time, which may hold something else.
    time: Option<Piece<'t>>,
    /// The sum of all cells [raw], and its place.
    sum: Option<(f64, Piece<'t>)>,
}

/// Parses `Frame 3` or `Frame 3, 0.2,, …,,,Raw Sum=,,308`.
fn frame_line(line: Piece<'_>) -> Result<Line<'_>, Flaw> {
    let rest = line.part_after_quote().after("Frame").expect("the caller has checked the line");
    let rest = rest.part(rest.text.trim_start_matches([':', '#', '=', ' ', '\t']));
    let mut fields = Notation::of(rest.text).fields(rest);
    let at = fields.next().unwrap_or(rest);
    let number = at.count("the frame's number")?;
    let time = fields.next();
    let Some(key) = fields.find(|field| field.after("Raw Sum").is_some()) else {
        return Ok(Line { number, at, time, sum: None });
    };
    let beside = key.text.split_once('=').map(|(_, sum)| key.part(sum).trimmed());
    let sum = beside.filter(|sum| !sum.text.is_empty()).or_else(|| fields.find(|field| !field.text.is_empty()));
    match sum {
        Some(sum) => Ok(Line { number, at, time, sum: Some((sum.decimal("the frame's sum")?, sum)) }),
        None => flaw(&key, "`Raw Sum=` has no number: the line is cut off"),
    }
}

#[cfg(test)]
mod tests;
