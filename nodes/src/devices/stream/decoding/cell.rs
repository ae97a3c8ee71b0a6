//! The numbers of a frame: their type and how they are read.

use tactflow_runtime::node::Param;

/// The type of a cell: a number in bytes, or a number in text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum Cell {
    /// A byte from 0 to 255.
    U8,
    /// A byte from -128 to 127.
    I8,
    /// 16 bits without a sign, the low byte first.
    U16le,
    /// 16 bits without a sign, the high byte first.
    U16be,
    /// 16 bits with a sign, the low byte first.
    I16le,
    /// 16 bits with a sign, the high byte first.
    I16be,
    /// 32 bits without a sign, the low byte first.
    U32le,
    /// 32 bits without a sign, the high byte first.
    U32be,
    /// 32 bits with a sign, the low byte first.
    I32le,
    /// 32 bits with a sign, the high byte first.
    I32be,
    /// A float of 32 bits, the low byte first.
    F32le,
    /// A float of 32 bits, the high byte first.
    F32be,
    /// A decimal number in text.
    Dec,
    /// A hexadecimal number in text.
    Hex,
}

/// The type of a stamp, of a counter and of the number of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum Field {
    /// A byte.
    U8,
    /// 16 bits, the low byte first.
    U16le,
    /// 16 bits, the high byte first.
    U16be,
    /// 32 bits, the low byte first.
    U32le,
    /// 32 bits, the high byte first.
    U32be,
    /// 64 bits, the low byte first.
    U64le,
    /// 64 bits, the high byte first.
    U64be,
    /// A decimal number in text.
    Dec,
    /// A hexadecimal number in text.
    Hex,
}

impl Cell {
    /// Whether it is a number in text.
    pub(crate) const fn is_text(self) -> bool {
        matches!(self, Self::Dec | Self::Hex)
    }

    /// Whether it is a whole number in bytes, which can be masked and shifted.
    pub(crate) const fn has_bits(self) -> bool {
        !matches!(self, Self::F32le | Self::F32be | Self::Dec | Self::Hex)
    }

    /// Returns its size: in bytes, or one value in text.
    pub(crate) const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 | Self::Dec | Self::Hex => 1,
            Self::U16le | Self::U16be | Self::I16le | Self::I16be => 2,
            _ => 4,
        }
    }

    /// Returns its bits, if it is a whole number.
    fn bits(self, bytes: &[u8]) -> Option<u32> {
        Some(match self {
            Self::U8 | Self::I8 => u32::from(*bytes.first()?),
            Self::U16le | Self::I16le => u32::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            Self::U16be | Self::I16be => u32::from(u16::from_be_bytes(*bytes.first_chunk()?)),
            Self::U32le | Self::I32le => u32::from_le_bytes(*bytes.first_chunk()?),
            Self::U32be | Self::I32be => u32::from_be_bytes(*bytes.first_chunk()?),
            _ => return None,
        })
    }

    /// Reads the number at the beginning of some bytes. `bits` are a mask and a shift, which make it a number without a
    /// sign.
    pub(crate) fn read(self, bytes: &[u8], bits: Option<(u32, u32)>) -> Option<f64> {
        if let Some((mask, shift)) = bits {
            return self.bits(bytes).map(|bits| f64::from((bits & mask).checked_shr(shift).unwrap_or(0)));
        }
        Some(match self {
            Self::I8 => f64::from(self.bits(bytes)? as u8 as i8),
            Self::I16le | Self::I16be => f64::from(self.bits(bytes)? as u16 as i16),
            Self::I32le | Self::I32be => f64::from(self.bits(bytes)? as i32),
            Self::F32le => f64::from(f32::from_le_bytes(*bytes.first_chunk()?)),
            Self::F32be => f64::from(f32::from_be_bytes(*bytes.first_chunk()?)),
            _ => f64::from(self.bits(bytes)?),
        })
    }

    /// Reads a number in text.
    pub(crate) fn read_text(self, word: &str) -> Option<f64> {
        match self {
            Self::Hex => read_hex(word).map(|number| number as f64),
            _ => word.parse().ok(),
        }
    }
}

impl Field {
    /// Whether it is a number in text.
    pub(crate) const fn is_text(self) -> bool {
        matches!(self, Self::Dec | Self::Hex)
    }

    /// Returns its size: in bytes, or one value in text.
    pub(crate) const fn size(self) -> usize {
        match self {
            Self::U8 | Self::Dec | Self::Hex => 1,
            Self::U16le | Self::U16be => 2,
            Self::U32le | Self::U32be => 4,
            Self::U64le | Self::U64be => 8,
        }
    }

    /// Returns the number of bits after which it begins again at 0; `None` if it does not.
    pub(crate) const fn bits(self) -> Option<u32> {
        match self {
            Self::U8 | Self::U16le | Self::U16be | Self::U32le | Self::U32be => Some(8 * self.size() as u32),
            _ => None,
        }
    }

    /// Reads the number at the beginning of some bytes.
    pub(crate) fn read(self, bytes: &[u8]) -> Option<u64> {
        Some(match self {
            Self::U8 => u64::from(*bytes.first()?),
            Self::U16le => u64::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            Self::U16be => u64::from(u16::from_be_bytes(*bytes.first_chunk()?)),
            Self::U32le => u64::from(u32::from_le_bytes(*bytes.first_chunk()?)),
            Self::U32be => u64::from(u32::from_be_bytes(*bytes.first_chunk()?)),
            Self::U64le => u64::from_le_bytes(*bytes.first_chunk()?),
            Self::U64be => u64::from_be_bytes(*bytes.first_chunk()?),
            Self::Dec | Self::Hex => return None,
        })
    }

    /// Reads a number in text. A decimal one can have a fraction.
    pub(crate) fn read_text(self, word: &str) -> Option<f64> {
        match self {
            Self::Hex => read_hex(word).map(|number| number as f64),
            _ => word.parse().ok().filter(|number: &f64| number.is_finite()),
        }
    }
}

fn read_hex(word: &str) -> Option<u32> {
    let digits = word.strip_prefix("0x").or_else(|| word.strip_prefix("0X")).unwrap_or(word);
    // `from_str_radix` accepts a sign.
    digits.chars().all(|digit| digit.is_ascii_hexdigit()).then(|| u32::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_from_bytes() {
        let bytes = [0xFE, 0x80, 0x00, 0x01];
        let cases = [
            (Cell::U8, 254.0),
            (Cell::I8, -2.0),
            (Cell::U16le, 33022.0),
            (Cell::U16be, 65152.0),
            (Cell::I16le, -32514.0),
            (Cell::I16be, -384.0),
            (Cell::U32le, 16_810_238.0),
            (Cell::U32be, 4_269_801_473.0),
            (Cell::I32le, 16_810_238.0),
            (Cell::I32be, -25_165_823.0),
        ];
        for (cell, expected) in cases {
            assert_eq!(cell.read(&bytes, None), Some(expected), "{cell:?}");
            assert_eq!(cell.read(&bytes[..cell.size() - 1], None), None, "{cell:?} cut short");
        }
        assert_eq!(Cell::F32le.read(&[0, 0, 0xC8, 0x41], None), Some(25.0));
        assert_eq!(Cell::F32be.read(&[0x41, 0xC8, 0, 0], None), Some(25.0));
        // A word of Myrmex: channel 9 in the high nibble, value 0x234 in the low 12 bits.
        assert_eq!(Cell::U16le.read(&[0x34, 0x92], Some((0x0FFF, 0))), Some(564.0));
        assert_eq!(Cell::U16le.read(&[0x34, 0x92], Some((0xF000, 12))), Some(9.0));
        assert_eq!(Cell::I16le.read(&[0xFF, 0xFF], Some((0xFFFF, 40))), Some(0.0), "a shift beyond the bits");
    }

    #[test]
    fn numbers_are_read_from_text() {
        let cases = [
            (Cell::Dec, "12", Some(12.0)),
            (Cell::Dec, "-1.5e2", Some(-150.0)),
            (Cell::Dec, "0x1", None),
            (Cell::Hex, "FFFF", Some(65535.0)),
            (Cell::Hex, "0x1f", Some(31.0)),
            (Cell::Hex, "+1", None),
            (Cell::Hex, "", None),
            (Cell::Hex, "g", None),
        ];
        for (cell, text, expected) in cases {
            assert_eq!(cell.read_text(text), expected, "{text}");
        }
        assert_eq!(Field::U64be.read(&[0, 0, 0, 0, 0, 0, 1, 2]), Some(258));
        assert_eq!(Field::U32le.bits(), Some(32));
        assert_eq!(Field::Dec.read_text("nan"), None);
    }
}
