//! A seeded generator of hostile files.

use tactflow_runtime::random::Random;

/// A source of hostile files.
pub(super) struct Hostile(pub(super) Random);

const NUMBERS: [&str; 12] =
    ["99999999999999999999", "4294967296", "1e308", "-1e308", "1e-320", "NaN", "inf", "-1", "0", "65536", "", "1,5"];

impl Hostile {
    fn below(&mut self, count: usize) -> usize {
        self.0.below(count.max(1))
    }

    fn range(&mut self, len: usize) -> std::ops::Range<usize> {
        let (a, b) = (self.below(len + 1), self.below(len + 1));
        a.min(b)..a.max(b)
    }

    /// A good file made bad, in one to three ways.
    pub(super) fn make(&mut self, good: &[u8]) -> Vec<u8> {
        let mut bytes = good.to_vec();
        for _ in 0..=self.below(3) {
            bytes = match self.below(4) {
                0 => self.spoil_bytes(bytes),
                1 | 2 => self.spoil_lines(&bytes),
                _ => self.spoil_encoding(&bytes),
            };
        }
        bytes
    }

    fn spoil_bytes(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        let len = bytes.len();
        if len == 0 {
            return bytes;
        }
        let (a, b) = (self.below(len), self.below(len));
        match self.below(7) {
            0 => bytes.truncate(a),
            1 => bytes.swap(a, b),
            2 => bytes[a] ^= 1 << self.below(8),
            3 => bytes[a..len.min(a + 8)].fill(self.below(256) as u8),
            4 => drop(bytes.drain(self.range(len))),
            5 => {
                let part = bytes[self.range(len)].to_vec();
                bytes.splice(a..a, part);
            }
            _ => drop(bytes.splice(a..a, [0xff, 0xfe, 0x00, 0xc3, 0x28][..=self.below(5).min(4)].to_vec())),
        }
        bytes
    }

    fn spoil_lines(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut lines: Vec<Vec<u8>> = bytes.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
        let count = lines.len();
        if count == 0 {
            return Vec::new();
        }
        let (a, b) = (self.below(count), self.below(count));
        match self.below(8) {
            0 => lines.swap(a, b),
            1 => drop(lines.remove(a)),
            2 => lines.insert(b, lines[a].clone()),
            3 => {
                let block = lines[self.range(count)].to_vec();
                lines.splice(a..a, block);
            }
            4 => drop(lines.drain(self.range(count))),
            5 => lines[a] = [b"\n", &*lines[a]].concat(),
            6 if self.below(8) == 0 => lines[a] = self.widen(&lines[a]),
            _ => {
                for _ in 0..=self.below(3) {
                    let at = self.below(count);
                    lines[at] = self.renumber(&lines[at]);
                }
            }
        }
        lines.concat()
    }

    /// A million columns more.
    fn widen(&mut self, line: &[u8]) -> Vec<u8> {
        let separator = b"\t,; "[self.below(4)];
        let cell = [b'0', b'x', b'"', b'-'][self.below(4)];
        [line.trim_ascii_end(), &[separator, cell].repeat(1_000_000), b"\n"].concat()
    }

    /// Another number in the place of one of the line.
    fn renumber(&mut self, line: &[u8]) -> Vec<u8> {
        let is_number = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
        let Some(start) = line.iter().skip(self.below(line.len())).position(is_number) else { return line.to_vec() };
        let end = line[start..].iter().position(|byte| !is_number(byte)).map_or(line.len(), |end| start + end);
        [&line[..start], NUMBERS[self.below(NUMBERS.len())].as_bytes(), &line[end..]].concat()
    }

    fn spoil_encoding(&mut self, bytes: &[u8]) -> Vec<u8> {
        let units = || String::from_utf8_lossy(bytes).encode_utf16().collect::<Vec<u16>>();
        let latin = || String::from_utf8_lossy(bytes).chars().map(|c| c as u32 as u8).collect::<Vec<u8>>();
        match self.below(9) {
            0 => units().into_iter().flat_map(u16::to_le_bytes).collect(),
            1 => units().into_iter().flat_map(u16::to_be_bytes).collect(),
            2 => [0xfeff].into_iter().chain(units()).flat_map(u16::to_le_bytes).collect(),
            3 => [0xfeff].into_iter().chain(units()).flat_map(u16::to_be_bytes).skip(self.below(2)).collect(),
            4 => latin(),
            5 => [b"\xef\xbb\xbf", bytes].concat(),
            6 => bytes.iter().map(|byte| if *byte == b'\n' { b'\r' } else { *byte }).collect(),
            7 => bytes.iter().map(|byte| if *byte == b'.' { b',' } else { *byte }).collect(),
            _ => bytes.iter().map(|byte| if matches!(byte, b',' | b'\t') { b';' } else { *byte }).collect(),
        }
    }
}
