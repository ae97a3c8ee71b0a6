//! Files of tactile and pressure sensors, read: bytes in, a [`Recording`] or a [`Refusal`] out.
//!
//! A format is one file here and one line in [`FORMATS`]. Nothing in this module opens a file or knows a device. What a
//! file does not say, [`Hints`] may; where both say something, they must agree. Nothing is allocated from a number in
//! a header before the file is seen to hold as much, and nothing is mended silently.

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

/// Every format that is read: one line each, those that are sure of themselves first.
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

/// The most cells of an array of which a file holds only windows.
pub const MOST_CELLS: usize = 1 << 18;

/// How much of a file [`recognise`] looks at.
pub const HEAD: usize = 1 << 16;

/// A way to write a recording down.
#[derive(Debug)]
pub struct Format {
    /// What a bench file calls it.
    pub name: &'static str,
    /// What people call it, with the endings of its files.
    pub title: &'static str,
    /// Whether a file that begins so is one.
    pub recognises: fn(&Head<'_>) -> bool,
    /// Reads the whole of it.
    pub read: fn(&[u8], &Hints) -> Result<Recording, Refusal>,
}

/// How a file begins.
#[derive(Debug)]
pub struct Head<'b> {
    /// Its first bytes, at most [`HEAD`].
    pub bytes: &'b [u8],
    /// The same as text; what is cut off at the end may be garbled.
    pub text: String,
    /// The ending of its name in lower case, without the dot; empty if there is none.
    pub ending: String,
}

impl<'b> Head<'b> {
    /// How a file of that name begins.
    #[must_use]
    pub fn new(bytes: &'b [u8], name: &str) -> Self {
        let bytes = &bytes[..bytes.len().min(HEAD)];
        let ending = name.rsplit_once('.').map_or_else(String::new, |(_, ending)| ending.to_lowercase());
        Self { bytes, text: text::decode(bytes).into_owned(), ending }
    }
}

/// A recording: what a pad gave, frame by frame.
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
    /// Greatest value that the sensor's own filter takes for noise, in the unit of the cells.
    pub threshold: Option<f64>,
    /// Nominal time between two frames [s].
    pub period: f64,
    /// Force that was measured beside the pad, one a frame [N].
    pub force: Option<Vec<f64>>,
}

/// One frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Its number in the file.
    pub number: u64,
    /// Its time from the start of the recording [ns].
    pub time: i64,
    /// The part of the array that the file holds; there is nothing outside.
    pub window: Window,
    /// Index of its first cell among the cells of the recording.
    pub start: usize,
}

/// A rectangle of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Window {
    /// Its first row.
    pub top: u32,
    /// Its first column.
    pub left: u32,
    /// Number of its rows.
    pub rows: u32,
    /// Number of its columns.
    pub cols: u32,
}

impl Window {
    /// All of an array, whose sides fit into 32 bits as the file holds as much.
    #[must_use]
    pub fn whole(rows: usize, cols: usize) -> Self {
        let side = |count: usize| u32::try_from(count).expect("a side is not longer than its file");
        Self { top: 0, left: 0, rows: side(rows), cols: side(cols) }
    }

    /// Number of its cells.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rows as usize * self.cols as usize
    }

    /// Whether it has no cells.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Recording {
    /// Writes frame `index` to the cells of an image of the whole array: zero outside its window.
    ///
    /// # Panics
    /// If there is no such frame, or the image is not as large as the array.
    pub fn show(&self, index: usize, image: &mut [f32]) {
        let Frame { window, start, .. } = self.frames[index];
        image.fill(0.0);
        let cols = window.cols as usize;
        for row in 0..window.rows as usize {
            let to = (window.top as usize + row) * self.shape.cols + window.left as usize;
            image[to..to + cols].copy_from_slice(&self.cells[start + row * cols..][..cols]);
        }
    }

    /// Whether every frame and every dead cell lies where the rest says: what all readers promise.
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

/// Why a file is not read.
#[derive(Debug, Clone, PartialEq)]
pub enum Refusal {
    /// No format knows it.
    Stranger,
    /// A text is not as its format wants it.
    Damaged {
        /// The text, decoded.
        text: String,
        /// What is wrong, and where.
        flaws: Vec<Flaw>,
    },
    /// What is no text is not as its format wants it.
    Broken {
        /// What is wrong.
        message: String,
        /// What to do, if that is known.
        help: Option<String>,
    },
    /// The file does not say something, and no hint does.
    Silent {
        /// What it does not say.
        message: String,
        /// What to write into the bench.
        help: String,
    },
    /// A hint contradicts the file.
    Contradicted {
        /// Name of the hint.
        hint: &'static str,
        /// What the file says.
        message: String,
    },
}

impl Refusal {
    /// Something that is no text is wrong.
    pub fn broken(message: impl Into<String>) -> Self {
        Self::Broken { message: message.into(), help: None }
    }
}

/// The format of a file that begins so.
#[must_use]
pub fn recognise(head: &Head<'_>) -> Option<&'static Format> {
    FORMATS.iter().find(|format| (format.recognises)(head))
}

/// Reads a file, or the one in an archive, in the format that a hint names or that it is recognised by. Its name matters
/// only for its ending.
///
/// # Errors
/// Why it cannot be read.
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

/// Every format by name, for messages.
#[must_use]
pub fn list() -> String {
    let lines = FORMATS.iter().map(|format| format!("\n  `{}`: {}", format.name, format.title));
    format!("these are read, also in a `.zip` or `.gz`:{}", lines.collect::<String>())
}
