//! Good inputs made bad, by a seed.

use std::ops::Range;

use tactflow_runtime::random::Random;

/// Longest input [bytes]. Longer ones only take longer.
const MAX_BYTES: usize = 1 << 16;
/// Most changes of one input.
const MAX_CHANGES: usize = 6;
/// One input in so many is pure chance.
const CHANCE: usize = 64;

/// Texts that parsers like to stumble over.
const TEXTS: &[&str] = &[
    "0",
    "-0",
    "-1",
    "1",
    "255",
    "65535",
    "65536",
    "2147483647",
    "2147483648",
    "-2147483649",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551616",
    "99999999999999999999999999",
    "1e308",
    "-1e308",
    "1e309",
    "1e-320",
    "1e19",
    "0.1",
    "nan",
    "NaN",
    "inf",
    "-inf",
    "null",
    "true",
    "\"\"",
    "[]",
    "{}",
    "[[",
    "]]",
    "'''",
    "\"\"\"",
    "\\u0000",
    "\\ud800",
    "\u{feff}",
    "ß",
    "\u{1f9e4}",
    "\t",
    "\r\n",
    "\r",
    "\u{c}",
    "#",
    "=",
    ",",
    ";",
    ".",
    "..",
    "builtin:",
];

/// Bytes of numbers that parsers like to stumble over.
const BYTES: &[&[u8]] = &[
    &[0],
    &[0xff],
    &[0x7f],
    &[0x80],
    &[0; 4],
    &[0xff; 2],
    &[0xff; 4],
    &[0xff; 8],
    &[0, 0x80],
    &[0, 0, 0, 0x80],
    &[0x80, 0, 0, 0],
    &[0, 0, 0, 0, 0, 0, 0, 0x80],
    &[0, 0, 0xc0, 0x7f],
    &[0x7f, 0xc0, 0, 0],
    &[0, 0, 0x80, 0x7f],
    &[0, 0, 0, 0, 0, 0, 0xf8, 0x7f],
    &[0x7f, 0xf8, 0, 0, 0, 0, 0, 0],
    &[0x7f, 0xef, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff],
    &[0xc3, 0x28],
    &[0xff, 0xfe],
    &[0xfe, 0xff],
];

/// Spoils the inputs of a corpus.
pub(super) struct Mutator<'c> {
    pub(super) corpus: &'c [Vec<u8>],
    pub(super) random: Random,
}

impl Mutator<'_> {
    /// Returns a spoilt input.
    pub(super) fn make(&mut self) -> Vec<u8> {
        if self.random.below(CHANCE) == 0 {
            let length = self.random.below(300);
            return (0..length).map(|_| self.random.below(256) as u8).collect();
        }
        let good = self.any().to_vec();
        let mut bytes = good.clone();
        let mut changes = 1 + self.random.below(MAX_CHANGES);
        // Changes can cancel out, and some do nothing to short inputs.
        while changes > 0 || bytes == good {
            bytes = self.change(bytes);
            bytes.truncate(MAX_BYTES);
            changes = changes.saturating_sub(1);
        }
        bytes
    }

    fn change(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        match self.random.below(10) {
            0 | 1 => self.spoil_bytes(bytes),
            2..=4 => self.spoil_token(&bytes),
            5 | 6 => self.spoil_lines(&bytes),
            7 => self.spoil_range(bytes),
            8 => self.spoil_number(bytes),
            _ => self.splice(&bytes),
        }
    }

    fn any(&mut self) -> &[u8] {
        &self.corpus[self.random.below(self.corpus.len())]
    }

    /// A range of `len` bytes, most often a short one.
    fn range(&mut self, len: usize) -> Range<usize> {
        let start = self.random.below(len + 1);
        let longest = if self.random.below(4) == 0 { len } else { 24.min(len) };
        start..len.min(start + self.random.below(longest + 1))
    }

    fn spoil_bytes(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        if bytes.is_empty() {
            return bytes;
        }
        let (a, b) = (self.random.below(bytes.len()), self.random.below(bytes.len()));
        match self.random.below(5) {
            0 => bytes[a] ^= 1 << self.random.below(8),
            1 => bytes[a] = self.random.below(256) as u8,
            2 => bytes.swap(a, b),
            3 => bytes.insert(a, self.random.below(256) as u8),
            _ => drop(bytes.remove(a)),
        }
        bytes
    }

    /// Another token in the place of one.
    fn spoil_token(&mut self, bytes: &[u8]) -> Vec<u8> {
        let old = self.token(bytes);
        let new = match self.random.below(4) {
            0 | 1 => TEXTS[self.random.below(TEXTS.len())].as_bytes().to_vec(),
            2 => bytes[self.token(bytes)].to_vec(),
            _ => {
                let other = self.any().to_vec();
                other[self.token(&other)].to_vec()
            }
        };
        [&bytes[..old.start], &new, &bytes[old.end..]].concat()
    }

    /// The word or number around a place, or the one byte there.
    fn token(&mut self, bytes: &[u8]) -> Range<usize> {
        if bytes.is_empty() {
            return 0..0;
        }
        let at = self.random.below(bytes.len());
        let is_word = |byte: &u8| byte.is_ascii_alphanumeric() || b"_+-.".contains(byte);
        if !is_word(&bytes[at]) {
            return at..at + 1;
        }
        let start = bytes[..at].iter().rposition(|byte| !is_word(byte)).map_or(0, |before| before + 1);
        let end = bytes[at..].iter().position(|byte| !is_word(byte)).map_or(bytes.len(), |length| at + length);
        start..end
    }

    fn spoil_lines(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut lines: Vec<&[u8]> = bytes.split_inclusive(|byte| *byte == b'\n').collect();
        if lines.is_empty() {
            return Vec::new();
        }
        let (a, b) = (self.random.below(lines.len()), self.random.below(lines.len()));
        match self.random.below(4) {
            0 | 1 => drop(lines.remove(a)),
            2 => lines.swap(a, b),
            _ => lines.insert(b, lines[a]),
        }
        lines.concat()
    }

    fn spoil_range(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        let range = self.range(bytes.len());
        let at = self.random.below(bytes.len() + 1);
        match self.random.below(5) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(range)),
            2 => {
                let part = bytes[range].to_vec();
                drop(bytes.splice(at..at, part));
            }
            3 => bytes[range].fill(self.random.below(256) as u8),
            _ => {
                let part = bytes[range].repeat(1 + self.random.below(40));
                drop(bytes.splice(at..at, part));
            }
        }
        bytes
    }

    /// The bytes of an unusual number, over others or between them.
    fn spoil_number(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        let number = BYTES[self.random.below(BYTES.len())];
        let at = self.random.below(bytes.len() + 1);
        let replaced = if self.random.below(3) == 0 { 0 } else { number.len() };
        let end = bytes.len().min(at + replaced);
        drop(bytes.splice(at..end, number.iter().copied()));
        bytes
    }

    /// The beginning of one input with the end of another, or a part of another in between.
    fn splice(&mut self, bytes: &[u8]) -> Vec<u8> {
        let at = self.random.below(bytes.len() + 1);
        let other = self.any().to_vec();
        if self.random.below(2) == 0 {
            let from = self.random.below(other.len() + 1);
            return [&bytes[..at], &other[from..]].concat();
        }
        let part = self.range(other.len());
        [&bytes[..at], &other[part], &bytes[at..]].concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn make(corpus: &[Vec<u8>]) -> Vec<Vec<u8>> {
        (0..1000).map(|number| Mutator { corpus, random: Random::new(1, number) }.make()).collect()
    }

    #[test]
    fn inputs_differ_from_each_other_and_from_the_corpus_and_repeat() {
        let corpus = [b"[graph]\nclock = \"pad\"\n".to_vec(), (0..99).collect()];
        let made = make(&corpus);
        assert_eq!(made, make(&corpus));
        let mut different = made.clone();
        different.sort();
        different.dedup();
        let spoilt = different.iter().filter(|bytes| !corpus.contains(bytes)).count();
        assert!(spoilt > 900, "{spoilt}");
        assert!(made.iter().all(|bytes| bytes.len() <= MAX_BYTES));
    }

    #[test]
    fn an_empty_input_is_spoilt_too() {
        let made = make(&[Vec::new()]);
        let spoilt = made.iter().filter(|bytes| !bytes.is_empty()).count();
        // What is left is pure chance of no bytes.
        assert!(spoilt > 990, "{spoilt}");
    }
}
