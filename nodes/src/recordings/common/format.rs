//! A file format, and the beginning of a file from which it is recognised.

use super::hints::Hints;
use super::recording::Recording;
use super::refusal::Refusal;
use super::text;

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
