//! Lines of text in a stream of bytes, each of a limited length.

/// Maximum length of a line [bytes].
const MAX_LINE_BYTES: usize = 1 << 20;

/// The line that is being received.
#[derive(Debug, Default)]
pub(super) struct Lines {
    line: Vec<u8>,
    /// Whether the rest of that line is skipped because it is too long.
    is_skipping: bool,
    /// Number of lines received.
    pub(super) count: u64,
}

impl Lines {
    /// Takes bytes up to the end of a line. Returns how many, and the line if it is whole.
    ///
    /// # Errors
    /// If the line is too long or not UTF-8; beside the number of bytes.
    pub(super) fn feed(&mut self, bytes: &[u8]) -> (usize, Result<Option<String>, String>) {
        let end = bytes.iter().position(|byte| *byte == b'\n');
        if !self.is_skipping {
            self.line.extend_from_slice(&bytes[..end.unwrap_or(bytes.len())]);
        }
        let taken = end.map_or(bytes.len(), |end| end + 1);
        let number = self.count + 1;
        self.count += u64::from(end.is_some());
        let was_skipped = self.is_skipping;
        self.is_skipping &= end.is_none();
        if self.line.len() > MAX_LINE_BYTES {
            (self.line, self.is_skipping) = (Vec::new(), end.is_none());
            return (taken, Err(format!("line {number}: it is longer than 1 MiB")));
        }
        if end.is_none() || was_skipped {
            return (taken, Ok(None));
        }
        let line = String::from_utf8(std::mem::take(&mut self.line));
        (taken, line.map(Some).map_err(|_| format!("line {number}: it is not UTF-8 text")))
    }

    /// Whether a line has begun and not ended.
    pub(super) fn is_in_a_line(&self) -> bool {
        !self.line.is_empty()
    }
}
