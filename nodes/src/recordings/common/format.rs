//! A file format, and the beginning of a file from which it is recognised.

use super::hints::Hints;
use super::recording::Recording;
use super::refusal::Refusal;
use super::text;

/// Number of bytes at the start of a file from which its format is recognised.
pub const HEAD_BYTES: usize = 1 << 16;

/// A file format of recordings.
#[derive(Debug)]
pub struct FileFormat {
    /// Name in a bench file.
    pub name: &'static str,
    /// Title with the usual file endings.
    pub title: &'static str,
    /// Whether a file with this beginning has the format.
    pub recognises: fn(&FileHead<'_>) -> bool,
    /// Reads a whole file.
    pub parser: Parser,
}

/// Reads a whole file: the decoded text, or the bytes.
#[derive(Debug, Clone, Copy)]
pub enum Parser {
    /// Reads a text.
    Text(fn(&str, &Hints) -> Result<Recording, Refusal>),
    /// Reads bytes.
    Bytes(fn(&[u8], &Hints) -> Result<Recording, Refusal>),
}

impl FileFormat {
    /// Returns a format of texts.
    #[must_use]
    pub const fn text(
        name: &'static str,
        title: &'static str,
        recognises: fn(&FileHead<'_>) -> bool,
        parse: fn(&str, &Hints) -> Result<Recording, Refusal>,
    ) -> Self {
        Self { name, title, recognises, parser: Parser::Text(parse) }
    }

    /// Reads a whole file.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn read(&self, bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
        let parse = match self.parser {
            Parser::Text(parse) => parse,
            Parser::Bytes(parse) => return parse(bytes, hints),
        };
        let text = text::decode(bytes);
        parse(&text, hints).map_err(|refusal| match refusal {
            Refusal::Damaged { flaws, .. } => Refusal::Damaged { text: text.into_owned(), flaws },
            other => other,
        })
    }
}

/// The beginning of a file.
#[derive(Debug)]
pub struct FileHead<'b> {
    /// The first bytes, at most [`HEAD_BYTES`].
    pub bytes: &'b [u8],
    /// The same bytes as text; the last character may be garbled.
    pub text: String,
    /// The ending of the file's name in lower case, without the dot; empty if there is none.
    pub ending: String,
}

impl<'b> FileHead<'b> {
    /// Returns the beginning of the file `name`.
    #[must_use]
    pub fn new(bytes: &'b [u8], name: &str) -> Self {
        let bytes = &bytes[..bytes.len().min(HEAD_BYTES)];
        let ending = name.rsplit_once('.').map_or_else(String::new, |(_, ending)| ending.to_lowercase());
        Self { bytes, text: text::decode(bytes).into_owned(), ending }
    }
}
