//! A line of JSON, read so that a mistake in it names its field.
//!
//! A number that is none (`NaN`, `Infinity`, `-Infinity`), as some writers of JSON put it, is read and then refused where
//! it is asked for: by its field. Whole numbers and floats are both numbers.

/// A value, as far as the protocol needs it.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Json {
    Null,
    Flag(bool),
    Number(f64),
    Text(String),
    List(Vec<Json>),
    Table,
}

impl Json {
    /// What it is, for a message.
    pub(super) const fn described(&self) -> &'static str {
        match self {
            Self::Null => "null",
            Self::Flag(_) => "a yes or no",
            Self::Number(_) => "a number",
            Self::Text(_) => "a text",
            Self::List(_) => "a list",
            Self::Table => "an object",
        }
    }
}

/// The fields of the object that a line holds, in its order.
///
/// # Errors
/// What is wrong with the text, with the field it is in.
pub(super) fn object(line: &str) -> Result<Vec<(String, Json)>, String> {
    let mut text = Text { bytes: line.as_bytes(), at: 0 };
    let fields = text.object(0)?;
    text.skip();
    match text.peek() {
        None => Ok(fields),
        Some(_) => Err(text.unexpected("the end of the line")),
    }
}

/// As deep as lists and objects may stand in each other.
const DEEPEST: usize = 32;

struct Text<'l> {
    bytes: &'l [u8],
    at: usize,
}

impl Text<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn skip(&mut self) {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    fn unexpected(&self, wanted: &str) -> String {
        let rest = String::from_utf8_lossy(&self.bytes[self.at..self.bytes.len().min(self.at + 48)]);
        let (found, place) = (rest.chars().take(12).collect::<String>().replace(char::is_control, "?"), self.at + 1);
        match found.is_empty() {
            true => format!("the line ends where {wanted} is expected"),
            false => format!("expected {wanted} at byte {place}, found `{found}`"),
        }
    }

    /// Takes a byte after white space, if it is there.
    fn takes(&mut self, byte: u8) -> bool {
        self.skip();
        let is_there = self.peek() == Some(byte);
        self.at += usize::from(is_there);
        is_there
    }

    fn object(&mut self, depth: usize) -> Result<Vec<(String, Json)>, String> {
        if !self.takes(b'{') {
            return Err(self.unexpected("`{`"));
        }
        let mut fields: Vec<(String, Json)> = Vec::new();
        if self.takes(b'}') {
            return Ok(fields);
        }
        loop {
            self.skip();
            let name = self.text()?;
            let in_field = |why: String| if depth == 0 { format!("`{name}`: {why}") } else { why };
            if !self.takes(b':') {
                return Err(in_field(self.unexpected("`:`")));
            }
            let value = self.value(depth + 1).map_err(in_field)?;
            if fields.iter().any(|(known, _)| *known == name) {
                return Err(format!("`{name}` comes twice"));
            }
            let is_last = !self.takes(b',');
            if is_last && !self.takes(b'}') {
                return Err(format!("after `{name}`: {}", self.unexpected("`,` or `}`")));
            }
            fields.push((name, value));
            if is_last {
                return Ok(fields);
            }
        }
    }

    fn value(&mut self, depth: usize) -> Result<Json, String> {
        if depth > DEEPEST {
            return Err(format!("lists and objects stand deeper than {DEEPEST} in each other"));
        }
        self.skip();
        match self.peek() {
            Some(b'{') => self.object(depth).map(|_| Json::Table),
            Some(b'[') => self.list(depth),
            Some(b'"') => self.text().map(Json::Text),
            _ => self.word(),
        }
    }

    fn list(&mut self, depth: usize) -> Result<Json, String> {
        let mut items = Vec::new();
        self.at += 1;
        if self.takes(b']') {
            return Ok(Json::List(items));
        }
        loop {
            items.push(self.value(depth + 1)?);
            if self.takes(b']') {
                return Ok(Json::List(items));
            }
            if !self.takes(b',') {
                return Err(self.unexpected("`,` or `]`"));
            }
        }
    }

    /// A number, or one of the few words.
    fn word(&mut self) -> Result<Json, String> {
        let is_part = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.');
        let length = self.bytes[self.at..].iter().take_while(|byte| is_part(byte)).count();
        let word = str::from_utf8(&self.bytes[self.at..self.at + length]).unwrap_or_default();
        let value = match word {
            "null" => Json::Null,
            "true" => Json::Flag(true),
            "false" => Json::Flag(false),
            // The parser takes every spelling of what is no number, too.
            number => Json::Number(number.parse().map_err(|_| self.unexpected("a value"))?),
        };
        self.at += length;
        Ok(value)
    }

    fn text(&mut self) -> Result<String, String> {
        if self.peek() != Some(b'"') {
            return Err(self.unexpected("a name in quotes"));
        }
        let (start, mut text) = (self.at, Vec::new());
        self.at += 1;
        loop {
            let byte = self.peek();
            self.at += 1;
            match byte {
                Some(b'"') => break,
                Some(b'\\') => text.extend(self.escape()?.to_string().bytes()),
                Some(byte) => text.push(byte),
                None => {
                    self.at = start;
                    return Err(format!("the text that begins at byte {} has no end", start + 1));
                }
            }
        }
        Ok(String::from_utf8_lossy(&text).into_owned())
    }

    /// What stands behind a backslash.
    fn escape(&mut self) -> Result<char, String> {
        let byte = self.peek();
        self.at += 1;
        Ok(match byte {
            Some(byte @ (b'"' | b'\\' | b'/')) => char::from(byte),
            Some(b'b') => '\u{8}',
            Some(b'f') => '\u{c}',
            Some(b'n') => '\n',
            Some(b'r') => '\r',
            Some(b't') => '\t',
            Some(b'u') => {
                let first = self.unit()?;
                let is_pair = (0xd800..0xdc00).contains(&first) && self.bytes[self.at..].starts_with(b"\\u");
                let second = if is_pair {
                    self.at += 2;
                    Some(self.unit()?)
                } else {
                    None
                };
                let units = [Some(first), second].into_iter().flatten();
                char::decode_utf16(units).next().and_then(Result::ok).unwrap_or(char::REPLACEMENT_CHARACTER)
            }
            _ => {
                self.at -= 1;
                return Err(self.unexpected("an escape"));
            }
        })
    }

    fn unit(&mut self) -> Result<u16, String> {
        let digits = self.bytes.get(self.at..self.at + 4).and_then(|digits| str::from_utf8(digits).ok());
        let unit = digits.and_then(|digits| u16::from_str_radix(digits, 16).ok());
        let unit = unit.ok_or_else(|| self.unexpected("four hexadecimal digits"))?;
        self.at += 4;
        Ok(unit)
    }
}

/// A text in quotes.
pub(super) fn quoted(text: &str) -> String {
    let mut quoted = String::from('"');
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            letter if letter.is_control() => quoted.push_str(&format!("\\u{:04x}", letter as u32)),
            letter => quoted.push(letter),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sort_of_value_and_both_sorts_of_numbers() {
        let line =
            r#" { "a" : [1, -2.5e-1,"x\"\u00e4\ud83d\ude00\n"], "b":null,"c":true ,"d":{"e":[{}]}, "f":[], "g":7 } "#;
        let fields = object(line).unwrap();
        let list = vec![Json::Number(1.0), Json::Number(-0.25), Json::Text("x\"ä😀\n".into())];
        let expected = [
            ("a", Json::List(list)),
            ("b", Json::Null),
            ("c", Json::Flag(true)),
            ("d", Json::Table),
            ("f", Json::List(vec![])),
            ("g", Json::Number(7.0)),
        ];
        assert_eq!(fields, expected.map(|(name, value)| (name.to_owned(), value)));
        assert_eq!(object("{}"), Ok(vec![]));
        assert_eq!(object(&format!("{{{}:1}}", quoted("a\"\\\n\u{1f}"))).unwrap()[0].0, "a\"\\\n\u{1f}");
    }

    #[test]
    fn what_is_no_number_is_read_to_be_refused_by_its_field() {
        for word in ["NaN", "nan", "Infinity", "-Infinity", "1e999"] {
            let fields = object(&format!("{{\"q\":[{word}]}}")).unwrap();
            let (_, Json::List(items)) = &fields[0] else { panic!("a list") };
            assert!(matches!(items[0], Json::Number(number) if !number.is_finite()), "{word}");
        }
    }

    #[test]
    fn a_mistake_names_its_field_and_its_place() {
        let deep = format!("{{\"a\":{}1{}}}", "[".repeat(900_000), "]".repeat(9));
        let cases = [
            ("", "the line ends where `{` is expected"),
            ("hello", "expected `{` at byte 1, found `hello`"),
            ("{\"q\":[1,2", "`q`: the line ends where `,` or `]` is expected"),
            ("{\"q\":[1 2]}", "`q`: expected `,` or `]` at byte 9, found `2]}`"),
            ("{\"q\":zero}", "`q`: expected a value at byte 6, found `zero}`"),
            ("{\"q\"=1}", "`q`: expected `:` at byte 5, found `=1}`"),
            ("{\"q\":1;}", "after `q`: expected `,` or `}` at byte 7, found `;}`"),
            ("{\"q\":1}}", "expected the end of the line at byte 8, found `}`"),
            ("{q:1}", "expected a name in quotes at byte 2, found `q:1}`"),
            ("{\"q\":1,\"q\":2}", "`q` comes twice"),
            ("{\"q", "the text that begins at byte 2 has no end"),
            ("{\"q\":\"\\x\"}", "`q`: expected an escape at byte 8, found `x\"}`"),
            (&deep, "`a`: lists and objects stand deeper than 32 in each other"),
        ];
        for (line, message) in cases {
            assert_eq!(object(line).unwrap_err(), message, "{}", &line[..line.len().min(40)]);
        }
    }
}
