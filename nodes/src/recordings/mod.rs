//! Readers for files of tactile and pressure sensors: bytes in, a [`Recording`] or a [`Refusal`] out.
//!
//! A format is one file here and one line in [`FORMATS`]. Nothing in this module opens a file or knows a device.
//! [`Hints`] give what a file does not; where both give a value, they must agree. Memory follows the bytes that are in
//! the file, never a number in a header. No mistake is repaired silently.

mod archive;
mod csv;
mod fields;
mod footscan;
mod hints;
mod novel_asc;
mod novel_lst;
mod npy;
mod reel;
mod tekscan;
pub mod text;
mod units;
mod xsensor;
mod zebris;
mod zip;

#[cfg(test)]
mod testing;

use tactflow_runtime::signal::ImageShape;

pub use hints::{Assumed, Hints};
pub use text::Flaw;

/// All formats, those with the strictest recognition first.
pub const FORMATS: &[Format] = &[
    npy::NPY,
    npy::NPZ,
    tekscan::FORMAT,
    novel_lst::FORMAT,
    novel_asc::FORMAT,
    zebris::FORMAT,
    xsensor::FORMAT,
    footscan::FORMAT,
    csv::FORMAT,
];

/// Maximum number of cells of an array.
pub const MAX_CELLS: usize = 1 << 18;

/// Number of bytes at the start of a file that [`recognise`] looks at.
pub const HEAD_BYTES: usize = 1 << 16;

/// A file format of recordings.
#[derive(Debug)]
pub struct Format {
    /// Name in a bench file.
    pub name: &'static str,
    /// Title with the usual file endings.
    pub title: &'static str,
    /// Whether a file with this beginning has the format.
    pub recognises: fn(&Head<'_>) -> bool,
    /// Reads a whole file.
    pub read: fn(&[u8], &Hints) -> Result<Recording, Refusal>,
}

/// The beginning of a file.
#[derive(Debug)]
pub struct Head<'b> {
    /// The first bytes, at most [`HEAD_BYTES`].
    pub bytes: &'b [u8],
    /// The same bytes as text; the last character may be garbled.
    pub text: String,
    /// The ending of the file's name in lower case, without the dot; empty if there is none.
    pub ending: String,
}

impl<'b> Head<'b> {
    /// Returns the beginning of the file `name`.
    #[must_use]
    pub fn new(bytes: &'b [u8], name: &str) -> Self {
        let bytes = &bytes[..bytes.len().min(HEAD_BYTES)];
        let ending = name.rsplit_once('.').map_or_else(String::new, |(_, ending)| ending.to_lowercase());
        Self { bytes, text: text::decode(bytes).into_owned(), ending }
    }
}

/// A recording of a pad, frame by frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Name of its format.
    pub format: &'static str,
    /// Size, pitch and unit of the whole array.
    pub shape: ImageShape,
    /// The frames, in order.
    pub frames: Vec<Frame>,
    /// The windows of all frames, one after the other, row after row.
    pub cells: Vec<f32>,
    /// Index in the whole array of each cell that does not exist, in order.
    pub dead: Vec<usize>,
    /// Maximum value that the sensor's own filter treats as noise, in the unit of the cells.
    pub threshold: Option<f64>,
    /// Nominal time between two frames [s].
    pub period: f64,
    /// Force that another sensor measured, one value a frame [N].
    pub force: Option<Vec<f64>>,
}

/// One frame of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Number in the file.
    pub number: u64,
    /// Time from the start of the recording [ns].
    pub time: i64,
    /// The part of the array that the file holds; all cells outside are 0.
    pub window: Window,
    /// Index of the first cell among the cells of the recording.
    pub start: usize,
}

/// A rectangle of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Window {
    /// First row.
    pub top: u32,
    /// First column.
    pub left: u32,
    /// Number of rows.
    pub rows: u32,
    /// Number of columns.
    pub cols: u32,
}

impl Window {
    /// Returns the window of a whole array. Its sides fit into 32 bits because the file holds its cells.
    #[must_use]
    pub fn whole(rows: usize, cols: usize) -> Self {
        let side = |count: usize| u32::try_from(count).expect("a side is not longer than its file");
        Self { top: 0, left: 0, rows: side(rows), cols: side(cols) }
    }

    /// Returns the number of cells.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows as usize * self.cols as usize
    }

    /// Whether there are no cells.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Recording {
    /// Writes frame `index` to the cells of an image of the whole array, with zeros outside its window.
    ///
    /// # Panics
    /// If there is no such frame, or the image is smaller than the array.
    pub fn show(&self, index: usize, image: &mut [f32]) {
        let Frame { window, start, .. } = self.frames[index];
        image.fill(0.0);
        let cols = window.cols as usize;
        for row in 0..window.rows as usize {
            let to = (window.top as usize + row) * self.shape.cols + window.left as usize;
            image[to..to + cols].copy_from_slice(&self.cells[start + row * cols..][..cols]);
        }
    }

    /// Whether frames, cells, dead cells and times are consistent. Every reader guarantees this.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let ImageShape { rows, cols, pitch, .. } = self.shape;
        let mut next = 0;
        let frames_fit = self.frames.iter().all(|frame| {
            let Window { top, left, rows: high, cols: wide } = frame.window;
            let fits = top as usize + high as usize <= rows && left as usize + wide as usize <= cols;
            let follows = frame.start == next;
            next += frame.window.len();
            fits && follows
        });
        frames_fit
            && next == self.cells.len()
            && !self.frames.is_empty()
            && self.frames.is_sorted_by_key(|frame| frame.time)
            && self.cells.iter().all(|cell| cell.is_finite())
            && self.dead.is_sorted_by(|a, b| a < b)
            && self.dead.last().is_none_or(|last| *last < self.shape.tactels())
            && self.period > 0.0
            && pitch.iter().all(|pitch| pitch.is_finite() && *pitch > 0.0)
            && self.force.as_ref().is_none_or(|force| force.len() == self.frames.len())
    }
}

/// Why a file is refused.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// No format recognises it.
    Stranger,
    /// A text does not follow its format.
    Damaged {
        /// The text, decoded.
        text: String,
        /// What is wrong, and where.
        flaws: Vec<Flaw>,
    },
    /// A file that is not text does not follow its format.
    Broken {
        /// What is wrong.
        message: String,
        /// What to do instead, if that is known.
        help: Option<String>,
    },
    /// Neither the file nor a hint gives a property.
    Silent {
        /// What is missing.
        message: String,
        /// What to write in the bench.
        help: String,
    },
    /// A hint contradicts the file.
    Contradicted {
        /// Name of the hint.
        hint: &'static str,
        /// The value of the file.
        message: String,
    },
}

impl Refusal {
    /// Returns a refusal of a file that is not text.
    pub fn broken(message: impl Into<String>) -> Self {
        Self::Broken { message: message.into(), help: None }
    }
}

/// Returns the format of a file with this beginning.
#[must_use]
pub fn recognise(head: &Head<'_>) -> Option<&'static Format> {
    FORMATS.iter().find(|format| (format.recognises)(head))
}

/// Reads a file, or the file in an archive.
///
/// A hint names the format; without one the content decides. Only the ending of `name` matters.
///
/// # Errors
/// Why it is refused.
pub fn read(bytes: &[u8], name: &str, hints: &Hints) -> Result<Recording, Refusal> {
    match archive::unpack(bytes, name, hints)? {
        Some((unpacked, name)) => read_plain(&unpacked, &name, hints),
        None => read_plain(bytes, name, hints),
    }
}

fn read_plain(bytes: &[u8], name: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let format = match &hints.format {
        Some(name) => FORMATS.iter().find(|format| format.name == name),
        None => recognise(&Head::new(bytes, name)),
    };
    format.map_or(Err(Refusal::Stranger), |format| (format.read)(bytes, hints))
}

/// Returns all formats by name, for messages.
#[must_use]
pub fn list() -> String {
    let lines = FORMATS.iter().map(|format| format!("\n  `{}`: {}", format.name, format.title));
    format!("known formats, also in a `.zip` or `.gz`:{}", lines.collect::<String>())
}
