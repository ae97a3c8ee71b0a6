//! What all formats that are text have in common: decoding, lines, pieces that know their place, numbers.

use std::borrow::Cow;
use std::ops::Range;

use super::{Hints, Recording, Refusal};

/// What is wrong with a text, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flaw {
    /// The place.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
}

/// A flaw at a piece.
pub(super) fn flaw<T>(at: &Piece<'_>, message: impl Into<String>) -> Result<T, Flaw> {
    Err(Flaw { span: at.span(), message: message.into() })
}

/// Why a text is not read: what is wrong with it, or something about hints.
#[derive(Debug)]
pub(super) enum Wrong {
    Flaws(Vec<Flaw>),
    Refusal(Refusal),
}

impl From<Flaw> for Wrong {
    fn from(flaw: Flaw) -> Self {
        Self::Flaws(vec![flaw])
    }
}

impl From<Vec<Flaw>> for Wrong {
    fn from(flaws: Vec<Flaw>) -> Self {
        Self::Flaws(flaws)
    }
}

impl From<Refusal> for Wrong {
    fn from(refusal: Refusal) -> Self {
        Self::Refusal(refusal)
    }
}

/// Reads bytes as text with a reader of text.
pub(super) fn read(
    bytes: &[u8],
    hints: &Hints,
    parse: impl FnOnce(&str, &Hints) -> Result<Recording, Wrong>,
) -> Result<Recording, Refusal> {
    let text = decode(bytes);
    parse(&text, hints).map_err(|wrong| match wrong {
        Wrong::Flaws(flaws) => Refusal::Damaged { text: text.into_owned(), flaws },
        Wrong::Refusal(refusal) => refusal,
    })
}

/// Bytes as text: UTF-8 or UTF-16 by their mark, UTF-16 by its zeros, UTF-8 where it is that, and else Latin-1, which
/// everything is. Marks are left out.
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

/// A piece of the text that knows its place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece<'t> {
    pub(super) text: &'t str,
    pub(super) start: usize,
}

impl<'t> Piece<'t> {
    /// The place.
    pub(super) fn span(&self) -> Range<usize> {
        self.start..self.start + self.text.len()
    }

    /// The part of this piece that `text` is: a slice of its text.
    pub(super) fn part(&self, text: &'t str) -> Self {
        Self { text, start: text.as_ptr() as usize - self.text.as_ptr() as usize + self.start }
    }

    /// Without the blanks around it.
    pub(super) fn trimmed(self) -> Self {
        self.part(self.text.trim())
    }

    /// The parts between blanks.
    pub(super) fn words(self) -> impl Iterator<Item = Self> + Clone {
        self.text.split_whitespace().map(move |text| self.part(text))
    }

    /// What comes after `prefix`, in whatever case that is written, if the piece begins with it.
    pub(super) fn after(self, prefix: &str) -> Option<Self> {
        let head = self.text.get(..prefix.len())?;
        head.eq_ignore_ascii_case(prefix).then(|| self.part(&self.text[prefix.len()..]))
    }

    /// Without a quote before it.
    pub(super) fn part_after_quote(self) -> Self {
        self.part(self.text.trim_start_matches('"')).trimmed()
    }

    /// A finite number that may have a comma before its decimals.
    pub(super) fn decimal(self, what: &str) -> Result<f64, Flaw> {
        Notation { separator: None, has_decimal_comma: true }.number(self, what)
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
#[derive(Debug, Clone)]
pub(super) struct Lines<'t> {
    text: &'t str,
    next: usize,
}

impl<'t> Lines<'t> {
    pub(super) const fn new(text: &'t str) -> Self {
        Self { text, next: 0 }
    }

    /// The place just past the last character.
    pub(super) fn end(&self) -> Piece<'t> {
        let text = self.text.trim_end();
        Piece { text: &text[text.len()..], start: text.len() }
    }

    pub(super) fn is_at_end(&self) -> bool {
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
        let line = rest.find(['\n', '\r']).map_or(rest, |end| &rest[..end]);
        let end = if rest[line.len()..].starts_with("\r\n") { 2 } else { 1 };
        self.next = (start + line.len() + end).min(self.text.len());
        Some(Piece { text: line, start })
    }
}

/// How a text writes the numbers of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Notation {
    /// What stands between two numbers; nothing if blanks do.
    pub(super) separator: Option<char>,
    /// Whether a comma may stand before the decimals: no comma stands between two numbers.
    pub(super) has_decimal_comma: bool,
}

impl Notation {
    /// What a row of numbers shows: `;`, a tab, a comma or blanks. A comma beside another separator is a decimal one.
    pub(super) fn of(row: &str) -> Self {
        let row = row.trim();
        let separator = match row {
            row if row.contains(';') => Some(';'),
            row if row.contains('\t') => Some('\t'),
            row if row.contains(',') && !is_decimal_comma_between_blanks(row) => Some(','),
            _ => None,
        };
        Self { separator, has_decimal_comma: separator != Some(',') }
    }

    /// The fields of a row, trimmed. Separators at the end of a row are not followed by a field.
    pub(super) fn fields<'t>(self, row: Piece<'t>) -> impl Iterator<Item = Piece<'t>> + Clone {
        let row = row.trimmed();
        let separator = self.separator;
        let text = separator
            .map_or(row.text, |separator| row.text.trim_end_matches(|c: char| c == separator || c.is_whitespace()));
        let is_gap = move |c: char| separator.map_or(c.is_whitespace(), |separator| c == separator);
        let parts = row.part(text).text.split(is_gap).map(move |text| row.part(text).trimmed());
        parts.filter(move |part| separator.is_some() || !part.text.is_empty())
    }

    /// A finite number.
    pub(super) fn number(self, piece: Piece<'_>, what: &str) -> Result<f64, Flaw> {
        if !self.has_decimal_comma || !piece.text.contains(',') {
            return piece.number(what);
        }
        if let Ok(number) = piece.text.replacen(',', ".", 1).parse::<f64>()
            && number.is_finite()
        {
            return Ok(number);
        }
        piece.number(what)
    }
}

/// Whether every comma of a row of blanks and numbers stands within a number, as in `0,5 1,25`.
fn is_decimal_comma_between_blanks(row: &str) -> bool {
    let mut words = row.split_whitespace().peekable();
    let is_decimal = |word: &str| {
        word.split_once(',').is_none_or(|(whole, part)| {
            !part.is_empty() && !part.contains(',') && !whole.contains('.') && !part.contains('.')
        })
    };
    words.next().is_some() && words.peek().is_some() && row.split_whitespace().all(is_decimal)
}

/// A text that a message can hold.
#[must_use]
pub fn shortened(text: &str) -> String {
    let clean = |c: char| if c.is_control() { ' ' } else { c };
    let mut short: String = text.chars().take(40).map(clean).collect();
    if text.chars().nth(40).is_some() {
        short.push('…');
    }
    short
}
