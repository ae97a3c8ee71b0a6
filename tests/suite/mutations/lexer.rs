//! The tokens of a graph file, as far as a slip of the finger is concerned.

use std::ops::Range;

/// A string with its quotes, a number, or one word of a key or of a table's header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Token {
    pub(super) span: Range<usize>,
}

/// The tokens of a text; blanks, comments and punctuation are none.
pub(super) fn tokens(text: &str) -> Vec<Token> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let start = text.len() - rest.len();
        let length = match first {
            '#' => rest.find('\n').unwrap_or(rest.len()),
            '"' => rest[1..].find('"').map_or(rest.len(), |end| end + 2),
            c if is_word(c) => word(rest),
            c => c.len_utf8(),
        };
        if first == '"' || is_word(first) {
            tokens.push(Token { span: start..start + length });
        }
        rest = &rest[length..];
    }
    tokens
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '+')
}

/// Length of the word that a text begins with; a dot belongs to a number and parts two words.
fn word(text: &str) -> usize {
    let is_number = text.trim_start_matches(['-', '+']).starts_with(|c: char| c.is_ascii_digit());
    text.find(|c: char| !(is_word(c) || is_number && c == '.')).unwrap_or(text.len())
}

#[test]
fn keys_strings_and_numbers_are_tokens_and_comments_are_not() {
    let text = "[nodes.pid] # not.this\ngains.x = { kp = -2.5, to = \"a.b # c\" }\nselect = [1, 0]\n";
    let found: Vec<&str> = tokens(text).into_iter().map(|token| &text[token.span]).collect();
    let expected = ["nodes", "pid", "gains", "x", "kp", "-2.5", "to", "\"a.b # c\"", "select", "1", "0"];
    assert_eq!(found, expected);
}
