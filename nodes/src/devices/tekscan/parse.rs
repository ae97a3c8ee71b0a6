//! The text of a Tekscan ASCII movie: a header of `KEY value` lines up to `ASCII_DATA`, then frames, then `@@`.
//!
//! A frame is a line `Frame 3, 0.2,, 12/2/2019 6:21:52.54PM,,,Raw Sum=,,308` and a line of cells for each row; `B` is
//! a cell where there is no sensel. Anything else is refused at its place: a recording that was cut or edited by hand
//! must not pass as data. Nothing is allocated from a number in the header before the file is seen to hold as much.

use std::ops::Range;

use tactflow_runtime::signal::{ImageShape, Unit};

use super::header::{self, Header};

/// A movie.
#[derive(Debug, Clone, PartialEq)]
pub struct Movie {
    /// Size, pitch and unit of the frames.
    pub shape: ImageShape,
    /// The frames, in order.
    pub frames: Vec<Frame>,
    /// The values of all frames, one after the other; 0 where there is no sensel.
    pub cells: Vec<f32>,
    /// Index of each cell in a frame where there is no sensel.
    pub dead: Vec<usize>,
    /// Greatest value that the sensor's own filter takes for noise, in the unit of the cells.
    pub threshold: Option<f64>,
    /// Nominal time between two frames [s].
    pub period: f64,
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Its number in the file.
    pub number: u64,
    /// Its time [ns].
    pub time: i64,
}

/// What is wrong with a text, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flaw {
    /// The place.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
}

pub(super) fn flaw<T>(at: &Piece<'_>, message: impl Into<String>) -> Result<T, Flaw> {
    Err(Flaw { span: at.span(), message: message.into() })
}

/// A piece of the text that knows its place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece<'t> {
    pub(super) text: &'t str,
    pub(super) start: usize,
}

impl<'t> Piece<'t> {
    pub(super) fn span(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// Without the blanks around it.
    pub(super) fn trimmed(self) -> Self {
        let start = self.start + self.text.len() - self.text.trim_start().len();
        Self { text: self.text.trim(), start }
    }

    pub(super) fn split(self, at: char) -> impl Iterator<Item = Self> + Clone {
        let offset = move |part: &str| part.as_ptr() as usize - self.text.as_ptr() as usize + self.start;
        self.text.split(at).map(move |text| Self { text, start: offset(text) })
    }

    /// A finite number.
    pub(super) fn number(self, what: &str) -> Result<f64, Flaw> {
        match self.text.parse::<f64>() {
            Ok(number) if number.is_finite() => Ok(number),
            Ok(_) => flaw(&self, format!("{what} is not finite: `{}`", shortened(self.text))),
            Err(_) => flaw(&self, format!("{what} is not a number: `{}`", shortened(self.text))),
        }
    }

    /// A whole number.
    pub(super) fn count(self, what: &str) -> Result<u64, Flaw> {
        self.text.parse().or_else(|_| flaw(&self, format!("{what} is not a whole number: `{}`", shortened(self.text))))
    }
}

/// The lines of a text, without their ends.
pub(super) struct Lines<'t> {
    text: &'t str,
    next: usize,
}

impl<'t> Lines<'t> {
    /// The place just past the last character.
    fn end(&self) -> Piece<'t> {
        let text = self.text.trim_end();
        Piece { text: &text[text.len()..], start: text.len() }
    }

    fn is_at_end(&self) -> bool {
        self.next >= self.text.len()
    }
}

impl<'t> Iterator for Lines<'t> {
    type Item = Piece<'t>;

    fn next(&mut self) -> Option<Piece<'t>> {
        let rest = &self.text[self.next..];
        if rest.is_empty() {
            return None;
        }
        let start = self.next;
        let line = rest.split_once('\n').map_or(rest, |(line, _)| line);
        self.next = (start + line.len() + 1).min(self.text.len());
        Some(Piece { text: line.strip_suffix('\r').unwrap_or(line), start })
    }
}

/// Reads a movie.
///
/// # Errors
/// Everything that is wrong with the header, or the first thing that is wrong with the frames.
pub fn parse(text: &str) -> Result<Movie, Vec<Flaw>> {
    let mut lines = Lines { text, next: 0 };
    let header = header::read(&mut lines, text.len())?;
    let mut reader = Reader { header: &header, frames: Vec::new(), cells: Vec::new(), dead: Vec::new() };
    reader.frames(&mut lines).map_err(|flaw| vec![flaw])?;
    let Reader { frames, cells, dead, .. } = reader;
    let period = header.period.unwrap_or_else(|| mean_step(&frames));
    Ok(Movie { shape: header.shape, frames, cells, dead, threshold: header.threshold, period })
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
        self.frames.push(frame);
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

/// A sum, and where it stands.
type Sum<'t> = Option<(f64, Piece<'t>)>;

/// `Frame 3, 0.2,, …,,,Raw Sum=,,308`: its number, its time and its sum, if there is one.
fn frame_line(line: Piece<'_>) -> Result<(Frame, Sum<'_>), Flaw> {
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
    let frame = Frame { number, time: (seconds * 1e9).round() as i64 };
    let Some(key) = fields.find(|field| field.text.starts_with("Raw Sum")) else { return Ok((frame, None)) };
    match fields.find(|field| !field.text.is_empty()) {
        Some(sum) => Ok((frame, Some((sum.number("the frame's sum")?, sum)))),
        None => flaw(&key, "`Raw Sum=` has no number: the line is cut off"),
    }
}

/// A text that a message can hold.
pub(super) fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(40).collect();
    if short.len() < text.len() {
        short.push('…');
    }
    short
}
