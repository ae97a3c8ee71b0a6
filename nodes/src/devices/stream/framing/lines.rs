//! Frames of text: a line each, or several lines up to a line that begins with a mark.
//!
//! What comes before the first end of a line may be the rest of a line, so it is no frame. With a mark, the first three
//! frames are judged when the mark after them has come. From then on a frame is delivered with its last value.

use bytes::BytesMut;

use super::{Counts, IsSound, take_until};

/// Number of frames in a row after which a frame is believed before the mark behind it has come.
const ROW: u32 = 3;

/// Finds frames in lines.
#[derive(Clone, Default)]
pub(crate) struct Lines {
    /// How the line that ends a frame begins; empty for an empty line. `None` if each line is a frame.
    mark: Option<Vec<u8>>,
    /// Maximum number of bytes of a frame.
    longest: usize,
    pending: BytesMut,
    /// The lines of the frame so far.
    text: Vec<u8>,
    /// Whether the beginning of the next line is known.
    is_aligned: bool,
    /// Whether the beginning of the next frame is known.
    has_begun: bool,
    /// Whether this frame was delivered before its mark has come.
    is_delivered: bool,
    /// Number of good frames in a row.
    row: u32,
    /// Whether the text is a frame that was delivered at its mark.
    is_over: bool,
    pub(super) counts: Counts,
}

/// What a line is.
enum Line {
    /// A frame, or the end of one.
    Frame,
    Other,
}

impl Lines {
    pub(crate) fn new(mark: Option<Vec<u8>>, longest: usize) -> Self {
        Self { mark, longest, text: Vec::with_capacity(longest), ..Self::default() }
    }

    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
    }

    pub(super) fn forget(&mut self) {
        self.pending.clear();
        self.text.clear();
        (self.is_aligned, self.has_begun, self.is_delivered, self.is_over, self.row) = (false, false, false, false, 0);
    }

    pub(super) fn next(&mut self, is_sound: IsSound<'_>) -> Option<&[u8]> {
        while let Some(line) = take_until(&mut self.pending, b'\n') {
            let line = line.strip_suffix(b"\r").unwrap_or(&line);
            if !std::mem::replace(&mut self.is_aligned, true) || line.len() > self.longest {
                self.counts.skipped += line.len() as u64 + 1;
                self.break_off();
                continue;
            }
            let found = match self.mark.is_some() {
                true => self.add(line, is_sound),
                false => self.judge(line, is_sound),
            };
            if matches!(found, Line::Frame) {
                return Some(&self.text);
            }
        }
        // A line without an end must not grow for ever.
        if self.pending.len() > self.longest {
            self.counts.skipped += self.pending.len() as u64;
            self.pending.clear();
            self.is_aligned = false;
            self.break_off();
        }
        None
    }

    /// Judges a line that is a frame of its own.
    fn judge(&mut self, line: &[u8], is_sound: IsSound<'_>) -> Line {
        if line.trim_ascii().is_empty() {
            return Line::Other;
        }
        if !is_sound(line) {
            self.counts.rejected += 1;
            self.counts.skipped += line.len() as u64 + 1;
            return Line::Other;
        }
        self.text.clear();
        self.text.extend_from_slice(line);
        Line::Frame
    }

    /// Adds a line to a frame of several lines, or ends the frame.
    fn add(&mut self, line: &[u8], is_sound: IsSound<'_>) -> Line {
        if std::mem::take(&mut self.is_over) {
            self.text.clear();
        }
        if self.is_mark(line) {
            return self.end(is_sound);
        }
        if !self.has_begun || line.trim_ascii().is_empty() {
            return Line::Other;
        }
        if self.is_delivered || self.text.len() + line.len() >= self.longest {
            // There is more than a frame before the mark.
            self.is_delivered = false;
            self.counts.rejected += 1;
            self.break_off();
            return Line::Other;
        }
        if !self.text.is_empty() {
            self.text.push(b'\n');
        }
        self.text.extend_from_slice(line);
        if self.row >= ROW && is_sound(&self.text) {
            self.is_delivered = true;
            return Line::Frame;
        }
        Line::Other
    }

    /// Ends a frame of several lines at its mark.
    fn end(&mut self, is_sound: IsSound<'_>) -> Line {
        let had_begun = std::mem::replace(&mut self.has_begun, true);
        if std::mem::take(&mut self.is_delivered) {
            self.text.clear();
            return Line::Other;
        }
        if !had_begun || self.text.is_empty() {
            self.text.clear();
            return Line::Other;
        }
        if !is_sound(&self.text) {
            self.counts.rejected += 1;
            self.break_off();
            self.has_begun = true;
            return Line::Other;
        }
        self.row += 1;
        if self.row < ROW {
            self.text.clear();
            return Line::Other;
        }
        // The text is lent out.
        self.is_over = true;
        Line::Frame
    }

    /// Drops the frame so far, and believes the next ones only with their marks.
    fn break_off(&mut self) {
        self.text.clear();
        self.counts.resyncs += u64::from(self.row >= ROW);
        (self.row, self.has_begun) = (0, false);
    }

    fn is_mark(&self, line: &[u8]) -> bool {
        match self.mark.as_deref() {
            Some([]) => line.trim_ascii().is_empty(),
            Some(mark) => line.trim_ascii().starts_with(mark),
            None => false,
        }
    }
}
