//! The text of a Tekscan ASCII movie: a header of `KEY value` lines up to `ASCII_DATA`, then frames, then `@@`.
//!
//! A frame is a line `Frame 3, 0.2,, 12/2/2019 6:21:52.54PM,,,Raw Sum=,,308` and a line of cells for each row; `B` is
//! a cell where there is no sensel. Anything else is refused at its place: a recording that was cut or edited by hand
//! must not pass as data. Nothing is allocated from a number in the header before the file is seen to hold as much.

mod header;

use tactflow_runtime::signal::{ImageShape, Unit};

use super::text::{self, Flaw, Lines, Piece, Wrong, flaw, shortened};
use super::{Format, Frame, Hints, Recording, Refusal, Window};
use header::Header;

pub(super) const FORMAT: Format = Format {
    name: "tekscan",
    title: "Tekscan ASCII movie (.csv, .asf)",
    recognises: |head| head.text.trim_start().starts_with("DATA_TYPE "),
    read,
};

fn read(bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
    text::read(bytes, hints, parse)
}

/// Reads a movie: everything that is wrong with its header, or the first thing that is wrong with its frames.
fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let mut lines = Lines::new(text);
    let header = header::read(&mut lines, text.len())?;
    let mut reader = Reader { header: &header, frames: Vec::new(), cells: Vec::new(), dead: Vec::new() };
    reader.frames(&mut lines)?;
    let Reader { frames, cells, dead, .. } = reader;
    let period = hints.period(Some(header.period.unwrap_or_else(|| mean_step(&frames))))?;
    let Header { mut shape, threshold, .. } = header;
    shape.unit = hints.unit(Some(shape.unit))?;
    shape.pitch = hints.pitch(Some(shape.pitch))?;
    hints.size(Some([shape.rows, shape.cols]))?;
    Ok(Recording { format: FORMAT.name, shape, frames, cells, dead, threshold, period, force: None })
}

/// Mean time between two frames [s]; a second if that says nothing.
fn mean_step(frames: &[Frame]) -> f64 {
    match frames {
        [first, .., last] if last.time > first.time => {
            (last.time - first.time) as f64 * 1e-9 / (frames.len() - 1) as f64
        }
        _ => 1.0,
    }
}

struct Reader<'h> {
    header: &'h Header,
    frames: Vec<Frame>,
    cells: Vec<f32>,
    dead: Vec<usize>,
}

impl Reader<'_> {
    fn frames(&mut self, lines: &mut Lines<'_>) -> Result<(), Flaw> {
        while let Some(line) = lines.next() {
            let line = line.trimmed();
            match line.text {
                "" => {}
                "@@" => return self.end(line, lines),
                text if text.starts_with("Frame") => self.frame(line, lines)?,
                text => return flaw(&line, format!("expected a frame or `@@`, found `{}`", shortened(text))),
            }
        }
        let after = self.frames.last().map_or_else(String::new, |frame| format!(" after frame {}", frame.number));
        flaw(&lines.end(), format!("the file ends{after} without `@@`: it is truncated"))
    }

    /// The `@@`: nothing may be missing before it, and nothing may come after it.
    fn end(&self, at: Piece<'_>, lines: &mut Lines<'_>) -> Result<(), Flaw> {
        let Some(last) = self.frames.last() else { return flaw(&at, "the movie has no frame") };
        match &self.header.end_frame {
            Some((end, span)) if last.number != *end => {
                let message = format!("`END_FRAME` promises {end} frames, but the last is frame {}", last.number);
                return Err(Flaw { span: span.clone(), message });
            }
            _ => {}
        }
        match lines.find(|line| !line.text.trim().is_empty()) {
            Some(line) => flaw(&line.trimmed(), "something comes after the movie's end, `@@`"),
            None => Ok(()),
        }
    }

    fn frame(&mut self, line: Piece<'_>, lines: &mut Lines<'_>) -> Result<(), Flaw> {
        let (frame, sum) = frame_line(line)?;
        let number = line.split(',').next().expect("a split gives at least one").trimmed();
        match self.frames.last() {
            Some(last) if last.number.checked_add(1) != Some(frame.number) => {
                return flaw(&number, format!("frame {} comes after frame {}", frame.number, last.number));
            }
            Some(last) if last.time > frame.time => {
                let at = line.split(',').nth(1).expect("the time was read from it").trimmed();
                return flaw(&at, "the time goes back");
            }
            None if self.header.start_frame.is_some_and(|start| start != frame.number) => {
                return flaw(&number, format!("the first frame is {}, but `START_FRAME` says otherwise", frame.number));
            }
            _ => {}
        }
        let start = self.cells.len();
        let mut total = 0.0;
        for row in 0..self.header.shape.rows {
            total += self.row(frame.number, row, lines)?;
        }
        match sum {
            Some((wanted, at))
                if self.header.shape.unit == Unit::RAW && (total - wanted).abs() > 1e-9 * total.abs() =>
            {
                return flaw(
                    &at,
                    format!("`Raw Sum` says {wanted}, but the cells of frame {} sum to {total}", frame.number),
                );
            }
            _ => {}
        }
        let ImageShape { rows, cols, .. } = self.header.shape;
        let window = Window::whole(rows, cols);
        self.frames.push(Frame { number: frame.number, time: frame.time, window, start });
        Ok(())
    }

    /// Reads one row of cells and gives its sum.
    fn row(&mut self, frame: u64, row: usize, lines: &mut Lines<'_>) -> Result<f64, Flaw> {
        let ImageShape { rows, cols, .. } = self.header.shape;
        let line = lines.next().map_or_else(|| lines.end(), Piece::trimmed);
        if line.text.is_empty() || line.text == "@@" || line.text.starts_with("Frame") {
            return flaw(&line, format!("frame {frame} ends after {row} of its {rows} rows"));
        }
        let found = line.split(',').count();
        if found != cols {
            let cut = if lines.is_at_end() { ": the file ends in the middle of it" } else { "" };
            let message =
                format!("row {} of frame {frame} has {found} cells, but `COLS` promises {cols}{cut}", row + 1);
            return flaw(&line, message);
        }
        let mut sum = 0.0;
        for (col, cell) in line.split(',').enumerate() {
            let value = self.cell(row * cols + col, cell.trimmed())?;
            sum += f64::from(value);
            self.cells.push(value);
        }
        Ok(sum)
    }

    fn cell(&mut self, index: usize, cell: Piece<'_>) -> Result<f32, Flaw> {
        let is_dead = cell.text == "B";
        if self.frames.is_empty() {
            if is_dead {
                self.dead.push(index);
            }
        } else if is_dead != self.dead.binary_search(&index).is_ok() {
            let message = if is_dead {
                "there was a sensel here in the first frame"
            } else {
                "there was no sensel here in the first frame"
            };
            return flaw(&cell, message);
        }
        if is_dead {
            return Ok(0.0);
        }
        let value = cell.number("this cell")? as f32;
        if value.is_finite() { Ok(value) } else { flaw(&cell, format!("this cell is too large: `{}`", cell.text)) }
    }
}

/// What the line before a frame says.
struct Line {
    number: u64,
    time: i64,
}

/// A sum, and where it stands.
type Sum<'t> = Option<(f64, Piece<'t>)>;

/// `Frame 3, 0.2,, …,,,Raw Sum=,,308`: its number, its time and its sum, if there is one.
fn frame_line(line: Piece<'_>) -> Result<(Line, Sum<'_>), Flaw> {
    let mut fields = line.split(',').map(Piece::trimmed);
    let first = fields.next().expect("a split gives at least one");
    let number = first.text.strip_prefix("Frame").unwrap_or(first.text);
    let number = Piece { text: number, start: first.start + first.text.len() - number.len() }.trimmed();
    let number = number.count("the frame's number")?;
    let Some(time) = fields.next() else { return flaw(&line, format!("frame {number} has no time")) };
    let seconds = time.number("the frame's time")?;
    if !(0.0..1e9).contains(&seconds) {
        return flaw(&time, format!("the frame's time is no number of seconds from 0 to 1e9: `{}`", time.text));
    }
    let frame = Line { number, time: (seconds * 1e9).round() as i64 };
    let Some(key) = fields.find(|field| field.text.starts_with("Raw Sum")) else { return Ok((frame, None)) };
    match fields.find(|field| !field.text.is_empty()) {
        Some(sum) => Ok((frame, Some((sum.number("the frame's sum")?, sum)))),
        None => flaw(&key, "`Raw Sum=` has no number: the line is cut off"),
    }
}

#[cfg(test)]
mod tests;
