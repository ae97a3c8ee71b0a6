//! What the text formats share: decoding, lines, pieces with their place, numbers.

use std::borrow::Cow;
use std::fmt::Display;
use std::ops::Range;

use super::refusal::TextError;

/// Decodes bytes as text.
///
/// A byte order mark selects UTF-8 or UTF-16, and is left out. Without one, zero bytes show UTF-16, valid UTF-8 is read
/// as such, and all else as Latin-1.
#[must_use]
pub fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => narrow(rest),
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        // The first characters of a header are ASCII.
        [1..=255, 0, 1..=255, 0, ..] => wide(bytes, u16::from_le_bytes),
        [0, 1..=255, 0, 1..=255, ..] => wide(bytes, u16::from_be_bytes),
        _ => narrow(bytes),
    }
}

fn narrow(bytes: &[u8]) -> Cow<'_, str> {
    match str::from_utf8(bytes) {
        Ok(text) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(bytes.iter().map(|byte| char::from(*byte)).collect()),
    }
}

fn wide(bytes: &[u8], unit: impl Fn([u8; 2]) -> u16) -> Cow<'_, str> {
    let units = bytes.as_chunks().0.iter().map(|pair| unit(*pair));
    Cow::Owned(char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER)).collect())
}

/// A slice of the text with its byte offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece<'t> {
    pub(crate) text: &'t str,
    pub(crate) start: usize,
}

impl<'t> Piece<'t> {
    /// Returns its byte range.
    pub(crate) fn span(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// Returns the piece for `text`, which is a slice of this piece's text.
    pub(crate) fn part(&self, text: &'t str) -> Self {
        Self { text, start: text.as_ptr() as usize - self.text.as_ptr() as usize + self.start }
    }

    /// Returns the piece without surrounding blanks.
    pub(crate) fn trimmed(self) -> Self {
        self.part(self.text.trim())
    }

    /// Returns the words.
    pub(crate) fn words(self) -> impl Iterator<Item = Self> + Clone {
        self.text.split_whitespace().map(move |text| self.part(text))
    }

    /// Returns the piece after `prefix`, or `None` if it does not start with it; the case does not matter.
    pub(crate) fn after(self, prefix: &str) -> Option<Self> {
        let head = self.text.get(..prefix.len())?;
        head.eq_ignore_ascii_case(prefix).then(|| self.part(&self.text[prefix.len()..]))
    }

    /// Returns the piece without a quote at its start.
    pub(crate) fn part_after_quote(self) -> Self {
        self.part(self.text.trim_start_matches('"')).trimmed()
    }

    /// Returns an error at this piece.
    pub(crate) fn error(&self, message: impl Into<String>) -> TextError {
        TextError { span: self.span(), message: message.into() }
    }

    /// Returns an error at this piece unless a condition holds.
    pub(crate) fn check(&self, holds: bool, message: impl Display) -> Result<(), TextError> {
        if holds { Ok(()) } else { Err(self.error(message.to_string())) }
    }

    /// Parses a finite number, with a decimal point or a decimal comma.
    pub(crate) fn decimal(self, what: &str) -> Result<f64, TextError> {
        Notation::default().number(self, what)
    }

    /// Parses a number greater than 0, with a decimal point or a decimal comma.
    pub(crate) fn positive(self, what: &str) -> Result<f64, TextError> {
        let number = self.decimal(what)?;
        self.check(number > 0.0, format_args!("{what} must be greater than 0"))?;
        Ok(number)
    }

    /// Parses a whole number.
    pub(crate) fn count(self, what: &str) -> Result<u64, TextError> {
        let message = || format!("{what} is not a whole number: `{}`", shortened(self.text));
        self.text.parse().map_err(|_| self.error(message()))
    }

    /// Parses a number of rows or columns: a whole number greater than 0.
    pub(crate) fn side(self, what: &str) -> Result<usize, TextError> {
        let side = usize::try_from(self.count(what)?).ok().filter(|side| *side > 0);
        side.ok_or_else(|| self.error(format!("{what} must be at least 1")))
    }
}

/// The lines of a text, without their ends.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lines<'t> {
    text: &'t str,
    next: usize,
}

impl<'t> Lines<'t> {
    pub(crate) const fn new(text: &'t str) -> Self {
        Self { text, next: 0 }
    }

    /// Returns the empty piece after the last character.
    pub(crate) fn end(&self) -> Piece<'t> {
        let text = self.text.trim_end();
        Piece { text: &text[text.len()..], start: text.len() }
    }

    pub(crate) fn is_at_end(&self) -> bool {
        self.next >= self.text.len()
    }

    /// Returns the end of a message about the last line: whether the file ends in it.
    pub(crate) fn cut(&self) -> &'static str {
        if self.is_at_end() { ": the file ends in the middle of it" } else { "" }
    }

    /// Returns the next line that is not blank, without surrounding blanks, or the end of the text.
    pub(crate) fn next_filled(&mut self) -> Piece<'t> {
        let line = self.map(Piece::trimmed).find(|line| !line.text.is_empty());
        line.unwrap_or_else(|| self.end())
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
        let line = rest.find(['\n', '\r']).map_or(rest, |end| &rest[..end]);
        let end = if rest[line.len()..].starts_with("\r\n") { 2 } else { 1 };
        self.next = (start + line.len() + end).min(self.text.len());
        Some(Piece { text: line, start })
    }
}

/// How a text writes the numbers of a row. A comma that does not separate numbers is a decimal comma.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Notation {
    /// Separator of two numbers; `None` for blanks.
    pub(crate) separator: Option<char>,
}

impl Notation {
    /// Detects the notation of a row: `;`, a tab, a comma or blanks. A comma next to another separator is decimal.
    pub(crate) fn of(row: &str) -> Self {
        let row = row.trim();
        let comma = || (row.contains(',') && !is_decimal_comma_between_blanks(row)).then_some(',');
        Self { separator: [';', '\t'].into_iter().find(|separator| row.contains(*separator)).or_else(comma) }
    }

    /// Returns the trimmed fields of a row. A separator at the end of the row is ignored.
    pub(crate) fn fields<'t>(self, row: Piece<'t>) -> impl Iterator<Item = Piece<'t>> + Clone {
        let row = row.trimmed();
        let separator = self.separator;
        let text = separator
            .map_or(row.text, |separator| row.text.trim_end_matches(|c: char| c == separator || c.is_whitespace()));
        let is_gap = move |c: char| separator.map_or(c.is_whitespace(), |separator| c == separator);
        let parts = row.part(text).text.split(is_gap).map(move |text| row.part(text).trimmed());
        parts.filter(move |part| separator.is_some() || !part.text.is_empty())
    }

    /// Parses a finite number.
    pub(crate) fn number(self, piece: Piece<'_>, what: &str) -> Result<f64, TextError> {
        let mut text = Cow::Borrowed(piece.text);
        if self.separator != Some(',') && text.contains(',') {
            text = text.replacen(',', ".", 1).into();
        }
        let flaw = match text.parse::<f64>() {
            Ok(number) if number.is_finite() => return Ok(number),
            Ok(_) => "finite",
            Err(_) => "a number",
        };
        Err(piece.error(format!("{what} is not {flaw}: `{}`", shortened(piece.text))))
    }
}

/// Whether every comma of a row of numbers between blanks is decimal, as in `0,5 1,25`.
fn is_decimal_comma_between_blanks(row: &str) -> bool {
    let is_decimal = |word: &str| {
        word.split_once(',').is_none_or(|(whole, part)| {
            !part.is_empty() && !part.contains(',') && !whole.contains('.') && !part.contains('.')
        })
    };
    row.split_whitespace().nth(1).is_some() && row.split_whitespace().all(is_decimal)
}

/// Shortens a text for a message: at most 40 characters, none of them a control character.
#[must_use]
pub fn shortened(text: &str) -> String {
    let clean = |c: char| if c.is_control() { ' ' } else { c };
    let mut short: String = text.chars().take(40).map(clean).collect();
    if text.chars().nth(40).is_some() {
        short.push('…');
    }
    short
}
