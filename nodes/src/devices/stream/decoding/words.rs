//! The words of a text: numbers with separators between them.

use std::ops::Range;

/// Finds the words of a text, up to `most`. Commas and semicolons separate words, and so does white space. Returns
/// whether the text has this many at most, and nothing is missing between two commas.
pub(crate) fn find_words(text: &[u8], most: usize, words: &mut Vec<Range<usize>>) -> bool {
    words.clear();
    // Whether a word has been seen since the last comma.
    let mut has_word = false;
    let mut start = None;
    for (i, byte) in text.iter().copied().chain(std::iter::once(b' ')).enumerate() {
        let is_comma = matches!(byte, b',' | b';');
        if is_comma || byte.is_ascii_whitespace() {
            if let Some(start) = start.take() {
                if words.len() == most {
                    return false;
                }
                words.push(start..i);
                has_word = true;
            }
            if is_comma {
                if !has_word {
                    return false;
                }
                has_word = false;
            }
        } else if start.is_none() {
            start = Some(i);
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_separated_by_commas_semicolons_and_white_space() {
        let cases: [(&str, Option<&[&str]>); 9] = [
            ("1,2,3", Some(&["1", "2", "3"])),
            ("1, 2 ,3,", Some(&["1", "2", "3"])),
            (" 1\t2  3\n", Some(&["1", "2", "3"])),
            ("1;2;3\r", Some(&["1", "2", "3"])),
            ("", Some(&[])),
            ("1,,3", None),
            (",1", None),
            ("1 2 3 4", None),
            ("1,2\n3", Some(&["1", "2", "3"])),
        ];
        let mut words = Vec::new();
        for (text, expected) in cases {
            let found = find_words(text.as_bytes(), 3, &mut words);
            let found = found.then(|| words.iter().map(|word| &text[word.clone()]).collect::<Vec<_>>());
            assert_eq!(found.as_deref(), expected, "{text:?}");
        }
    }
}
