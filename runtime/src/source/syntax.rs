//! Syntax errors: TOML text to a tree of values, or to the first mistake at the place that causes it.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::diagnostic::{Code, Diagnostic};
use super::fix::Edit;
use super::map::SourceFile;
use super::suggest::did_you_mean;
use super::value::{Item, Key, Table, Value};

/// Parses a text as TOML.
///
/// # Errors
/// The first syntax error. The parser reports more, but they are mostly consequences of the first.
pub fn parse_table(file: &SourceFile) -> Result<Value, Box<Diagnostic>> {
    let (table, errors) = DeTable::parse_recoverable(&file.text);
    let at = |span: Range<usize>| span.start + file.base..span.end + file.base;
    let mut tree = Tree { base: file.base, too_big: None };
    let item = Item::Table(tree.table(table.get_ref()));
    let errors = errors
        .iter()
        .map(|error| (error.span().unwrap_or(0..0), error.message().lines().collect::<Vec<_>>().join("; ")));
    let Some((span, message)) = errors.chain(tree.too_big).min_by_key(|(span, _)| span.start) else {
        return Ok(Value { span: at(table.span()), item });
    };
    let mistake = match unclosed(&file.text, span.start) {
        Some((open, bracket)) => {
            let message = format!("`{bracket}` is opened here and never closed");
            Diagnostic::new(Code::Syntax, at(open), message)
        }
        None if message.starts_with("cannot extend value") => {
            let key = &file.text[span.clone()];
            let first = first_value(&file.text, key, span.start).unwrap_or(span.clone());
            let message = format!("`{key}` has a value here, so it cannot have keys of its own");
            Diagnostic::new(Code::Syntax, at(first), message).note(at(span), "it has one here")
        }
        None => unquoted(&file.text, &span, &message).map_or_else(
            || Diagnostic::new(Code::Syntax, at(span), message),
            |(value, text)| {
                let message = "a string needs a quote on each side";
                let quoted = format!("\"{text}\"");
                let diagnostic = Diagnostic::new(Code::Syntax, at(value.clone()), message);
                // A word without any quote may stand for a number.
                if file.text[value.clone()].contains('"') {
                    diagnostic.help(did_you_mean(&quoted)).edit(Edit::Replace(at(value), quoted))
                } else if let Some(number) = with_digits(&text) {
                    let message = "a number needs a digit on each side of its point";
                    let diagnostic = Diagnostic { message: message.to_owned(), ..diagnostic };
                    diagnostic.help(did_you_mean(&number)).edit(Edit::Replace(at(value), number))
                } else {
                    diagnostic.help(format!("write `{quoted}` if a string is meant"))
                }
            },
        ),
    };
    Err(Box::new(mistake))
}

/// Returns a value on the line of a mistake and the string that was meant, if a quote of it is missing or misplaced.
fn unquoted(text: &str, mistake: &Range<usize>, message: &str) -> Option<(Range<usize>, String)> {
    let start = text[..mistake.start].rfind('\n').map_or(0, |end| end + 1);
    let line = text[start..].lines().next()?;
    let mut at = start;
    for part in line.split_inclusive([',', '{', '}', '[', ']', '=', '#']) {
        let value = part.trim_end_matches([',', '{', '}', '[', ']', '=', '#']).trim();
        let place = at + part.find(value)?;
        at += part.len();
        let is_key = part.ends_with('=');
        let is_comment = part.ends_with('#');
        let word: String = value.chars().filter(|c| *c != '"').collect();
        let is_whole = value.len() == word.len() + 2 && value.starts_with('"') && value.ends_with('"');
        let is_here = (place..=place + value.len()).contains(&mistake.start);
        let is_quoted = word.len() < value.len() && !is_whole;
        if !is_key && (is_quoted || is_here && !is_whole) && is_text(&word) && !message.contains("duplicate") {
            return Some((place..place + value.len(), word));
        }
        if is_comment {
            return None;
        }
    }
    None
}

/// Returns the last key of this name before `end` that has a value.
fn first_value(text: &str, key: &str, end: usize) -> Option<Range<usize>> {
    let is_value = |at: &usize| {
        let before = text[..*at].rsplit('\n').next().unwrap_or_default();
        before.trim().is_empty() && text[at + key.len()..].trim_start_matches([' ', '\t']).starts_with('=')
    };
    let found = text[..end].rmatch_indices(key).map(|(at, _)| at).find(is_value)?;
    Some(found..found + key.len())
}

/// Returns a number with the digit that is missing beside its point; `None` for what is no such number.
fn with_digits(word: &str) -> Option<String> {
    word.parse::<f64>().ok()?;
    let (sign, digits) = word.split_at(word.len() - word.trim_start_matches(['-', '+']).len());
    let (whole, part) = digits.split_once('.')?;
    let one = |digits: &str| if digits.is_empty() { "0".to_owned() } else { digits.to_owned() };
    (whole.is_empty() || part.is_empty()).then(|| format!("{sign}{}.{}", one(whole), one(part)))
}

/// Returns whether a word can be meant as a string: it begins with a letter or a dot. So can a number without a digit
/// beside its point.
fn is_text(word: &str) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || "_-./:' ".contains(c);
    let begins = word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '.');
    begins && word.chars().all(is_part) || with_digits(word).is_some()
}

/// Returns the bracket or the quotes that are open at `at`, if they were opened on an earlier line and the line at `at`
/// looks like a new entry or a new section.
fn unclosed(text: &str, at: usize) -> Option<(Range<usize>, &'static str)> {
    let (open, what) = open_at(text, at)?;
    let line = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let is_statement = |line: &str| {
        let key = line.split_once('=').map(|(key, _)| key.trim());
        let is_word = |key: &str| key.chars().all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c));
        key.is_some_and(|key| !key.is_empty() && is_word(key)) || line.starts_with('[')
    };
    let is_end = text[at..].trim().is_empty() || what.len() > 1;
    let is_next = is_end || is_statement(text[line..].lines().next().unwrap_or_default().trim_start());
    (open < line && is_next).then(|| (open..open + what.len(), what))
}

/// Returns the innermost bracket of a value, or the multi-line quotes, that are open at `at`.
fn open_at(text: &str, at: usize) -> Option<(usize, &'static str)> {
    let mut open: Vec<(usize, &'static str)> = Vec::new();
    let mut i = 0;
    while i < at {
        let rest = &text[i..];
        let multi = ["\"\"\"", "'''"].into_iter().find(|quotes| rest.starts_with(quotes));
        i += match rest.chars().next()? {
            '#' => rest.find('\n').unwrap_or(rest.len()),
            '"' | '\'' if multi.is_some() => {
                let quotes = multi?;
                match rest[3..].find(quotes) {
                    Some(end) if i + end + 6 <= at => end + 6,
                    _ => return Some((i, quotes)),
                }
            }
            quote @ ('"' | '\'') => string_length(rest, quote),
            '[' => {
                open.push((i, "["));
                1
            }
            '{' => {
                open.push((i, "{"));
                1
            }
            ']' | '}' => {
                open.pop();
                1
            }
            c => c.len_utf8(),
        };
    }
    open.pop()
}

/// Length of the string that a text starts with; it ends with its quote or with its line.
fn string_length(text: &str, quote: char) -> usize {
    let mut is_escaped = false;
    for (i, c) in text.char_indices().skip(1) {
        match c {
            '\n' => return i,
            c if c == quote && !is_escaped => return i + 1,
            c => is_escaped = c == '\\' && quote == '"' && !is_escaped,
        }
    }
    text.len()
}

/// Converts the parsed text into a tree of values.
struct Tree {
    base: usize,
    /// The first number that is too big: its place and the message.
    too_big: Option<(Range<usize>, String)>,
}

impl Tree {
    fn at(&self, span: Range<usize>) -> Range<usize> {
        span.start + self.base..span.end + self.base
    }

    fn table(&mut self, table: &DeTable<'_>) -> Table {
        let mut entries: Vec<(Key, Value)> = Vec::new();
        for (key, value) in table {
            let key = Key { name: key.get_ref().to_string(), span: self.at(key.span()) };
            entries.push((key, self.value(value)));
        }
        entries.sort_by_key(|(key, _)| key.span.start);
        Table { entries }
    }

    fn value(&mut self, value: &toml::Spanned<DeValue<'_>>) -> Value {
        let item = match value.get_ref() {
            DeValue::String(text) => Item::String(text.to_string()),
            DeValue::Integer(number) => {
                let read = i64::from_str_radix(number.as_str(), number.radix());
                if read.is_err() && self.too_big.is_none() {
                    self.too_big = Some((value.span(), format!("{number} does not fit in 64 bits")));
                }
                Item::Integer(read.unwrap_or_default())
            }
            DeValue::Float(number) => Item::Float(number.as_str().parse().unwrap_or(f64::NAN)),
            DeValue::Boolean(value) => Item::Boolean(*value),
            DeValue::Datetime(date) => Item::Datetime(date.to_string()),
            DeValue::Array(items) => Item::Array(items.iter().map(|item| self.value(item)).collect()),
            DeValue::Table(table) => Item::Table(self.table(table)),
        };
        Value { span: self.at(value.span()), item }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::source::SourceMap;

    #[test]
    fn a_number_gets_the_digit_that_is_missing_beside_its_point() {
        for (text, word, number) in [
            ("x = .13\n", ".13", "0.13"),
            ("x = [1.0, .5]\n", ".5", "0.5"),
            ("x = -.5\n", "-.5", "-0.5"),
            ("x = [+.5, 1.0]\n", "+.5", "+0.5"),
            ("x = { a = 2. }\n", "2.", "2.0"),
        ] {
            let mut sources = SourceMap::default();
            let file = sources.add_file(Path::new("x.toml"), text).clone();
            let mistake = parse_table(&file).unwrap_err();
            let Some(Edit::Replace(place, written)) = mistake.fix.first() else { panic!("{mistake:?}") };
            assert_eq!((&text[file.local(place)], &**written), (word, number), "{text}");
        }
    }

    #[test]
    fn only_the_first_mistake_is_reported_at_the_line_that_causes_it() {
        let cases = [
            ("a = \nb = 1\nc = = 2\n", "x.toml:1"),
            ("[a]\nx = \"pad\ny = 1\n[b]\nz = 2\n", "x.toml:2"),
            ("[a]\nx = pad\"\ny = \"1\"\n", "x.toml:2"),
            ("[a]\nx = \"\"\"pad\"\ny = \"1\"\n\n\n", "x.toml:2"),
            ("[a\nx = 1\n", "x.toml:1"),
            ("x = [1, 2\n\n[a]\ny = 1\n", "x.toml:1"),
            ("x = [1, 2\ny = 1\n", "x.toml:1"),
            ("x = [\n  { a = 1 },\n  { a = \"b },\n]\n", "x.toml:3"),
            ("x = [1, 2\n", "x.toml:1"),
            ("x = { a = 1\n[b]\ny = 1\n", "x.toml:1"),
            ("x = 1\nx = 2\n", "x.toml:2"),
            ("x = 1\ny = 99999999999999999999\n", "x.toml:2"),
        ];
        for (text, place) in cases {
            let mut sources = SourceMap::default();
            sources.add_file(Path::new("first.toml"), "ok = 1");
            let file = sources.add_file(Path::new("x.toml"), text).clone();
            let mistake = parse_table(&file).unwrap_err();
            let found = sources.locate(mistake.span.start);
            assert!(found.starts_with(&format!("{place}:")), "{text}: {found}: {}", mistake.message);
        }
    }
}
