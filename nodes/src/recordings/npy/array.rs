//! An array in a file of numpy: `\x93NUMPY`, a version, a header in Python's notation, the elements.

use crate::recordings::common::text::shortened;

/// First bytes of an array.
pub(crate) const MAGIC: &[u8] = b"\x93NUMPY";

/// An array that borrows its elements from the file.
#[derive(Debug, Clone)]
pub(super) struct Array<'a> {
    /// Numbers of elements along the axes.
    pub(super) shape: Vec<usize>,
    kind: ElementKind,
    /// Whether the first axis runs fastest.
    is_fortran: bool,
    is_big: bool,
    /// Bytes of an element.
    pub(super) width: usize,
    bytes: &'a [u8],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ElementKind {
    Bool,
    Signed,
    Unsigned,
    Float,
    Bytes,
    Text,
}

impl<'a> Array<'a> {
    /// Reads a file of one array. Its length must be exactly that of its header and elements.
    pub(super) fn read(file: &'a [u8]) -> Result<Self, String> {
        let array = Self::begin(file)?;
        let wanted = array.shape.iter().try_fold(array.width, |size, axis| size.checked_mul(*axis));
        if wanted == Some(array.bytes.len()) {
            return Ok(array);
        }
        let (shape, width, found) = (named(&array.shape), array.width, array.bytes.len());
        Err(format!("its header has {shape} elements of {width} bytes, but {found} bytes come after it"))
    }

    /// Reads the header; the elements may be cut off.
    pub(super) fn begin(file: &'a [u8]) -> Result<Self, String> {
        let (header, bytes) = split(file).ok_or("the header of the array is cut off")?;
        let header = str::from_utf8(header).map_err(|_| "the header of the array is not text")?;
        let value = |key: &str| value(header, key).ok_or_else(|| format!("the header of the array has no `{key}`"));
        let (is_big, kind, width) = element(value("descr")?)?;
        let is_fortran = match value("fortran_order")?.split([',', '}']).next().unwrap_or("").trim() {
            "True" => true,
            "False" => false,
            other => {
                return Err(format!(
                    "`fortran_order` of the array must be `True` or `False`, not `{}`",
                    shortened(other)
                ));
            }
        };
        let shape = shape(value("shape")?)?;
        Ok(Self { shape, kind, is_fortran, is_big, width, bytes })
    }

    /// Whether its elements are numbers.
    pub(super) const fn is_number(&self) -> bool {
        !matches!(self.kind, ElementKind::Bytes | ElementKind::Text)
    }

    /// Returns the number of elements.
    pub(super) fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Returns the position of an element in the file, from its index along each axis.
    pub(super) fn place(&self, index: &[usize]) -> usize {
        let step = |place: usize, (index, axis): (&usize, &usize)| place * axis + index;
        let axes = index.iter().zip(&self.shape);
        if self.is_fortran { axes.rev().fold(0, step) } else { axes.fold(0, step) }
    }

    /// Returns the number at a position.
    pub(super) fn number(&self, place: usize) -> f64 {
        let bytes = &self.bytes[place * self.width..][..self.width];
        let bits = bytes.iter().enumerate().fold(0, |bits, (i, byte)| {
            let shift = 8 * if self.is_big { self.width - 1 - i } else { i };
            bits | u64::from(*byte) << shift
        });
        let unused = 64 - 8 * self.width as u32;
        match (self.kind, self.width) {
            (ElementKind::Float, 2) => half(bits as u16),
            (ElementKind::Float, 4) => f32::from_bits(bits as u32).into(),
            (ElementKind::Float, _) => f64::from_bits(bits),
            (ElementKind::Signed, _) => (((bits << unused) as i64) >> unused) as f64,
            _ => bits as f64,
        }
    }

    /// Returns all numbers, or `None` if there are more axes than one or no numbers.
    pub(super) fn numbers(&self) -> Option<impl ExactSizeIterator<Item = f64> + Clone + '_> {
        (self.is_number() && self.shape.len() <= 1).then(|| (0..self.len()).map(|place| self.number(place)))
    }

    /// Returns the text, or `None` if it is not a single text.
    pub(super) fn text(&self) -> Option<String> {
        let step = match self.kind {
            ElementKind::Text => 4,
            ElementKind::Bytes => 1,
            _ => return None,
        };
        let letter = |bytes: &[u8]| match (bytes, self.is_big) {
            ([byte], _) => char::from(*byte),
            (bytes, is_big) => {
                let bytes: [u8; 4] = bytes.try_into().expect("four at a time");
                let code = if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) };
                char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER)
            }
        };
        let is_short = self.len() == 1 && self.width <= 256;
        is_short.then(|| self.bytes.chunks_exact(step).map(letter).filter(|letter| *letter != '\0').collect())
    }
}

/// Splits a file after its header, into the header and the elements.
fn split(file: &[u8]) -> Option<(&[u8], &[u8])> {
    let rest = file.strip_prefix(MAGIC)?;
    let (version, rest) = rest.split_first_chunk::<2>()?;
    let (size, rest) = if version[0] == 1 {
        let (size, rest) = rest.split_first_chunk()?;
        (u16::from_le_bytes(*size).into(), rest)
    } else {
        let (size, rest) = rest.split_first_chunk()?;
        (usize::try_from(u32::from_le_bytes(*size)).ok()?, rest)
    };
    rest.split_at_checked(size)
}

/// Returns the text after `'key':`.
fn value<'h>(header: &'h str, key: &str) -> Option<&'h str> {
    let (_, rest) = header.split_once(&format!("'{key}'")).or_else(|| header.split_once(&format!("\"{key}\"")))?;
    Some(rest.trim_start().strip_prefix(':')?.trim_start())
}

/// Parses `'<f8'`: byte order, kind and size.
fn element(text: &str) -> Result<(bool, ElementKind, usize), String> {
    // A list of fields ends at `]`, a name at its quote.
    let end = match text.chars().next() {
        Some(quote @ ('\'' | '"')) => text[1..].find(quote).map(|at| at + 2),
        Some('[') => text.find(']').map(|at| at + 1),
        _ => None,
    };
    let strange = || {
        format!(
            "elements of type `{}` are not supported: save plain numbers",
            shortened(&text[..end.unwrap_or(text.len())])
        )
    };
    let quote = text.chars().next().filter(|quote| matches!(quote, '\'' | '"')).ok_or_else(strange)?;
    let name = text[1..].split(quote).next().unwrap_or("");
    let (order, name) = match name.split_at_checked(1) {
        Some((order @ ("<" | ">" | "=" | "|"), rest)) => (order, rest),
        _ => ("=", name),
    };
    let (kind, size) = name.split_at_checked(1).ok_or_else(strange)?;
    let size: usize = size.parse().map_err(|_| strange())?;
    let (kind, width) = match (kind, size) {
        ("b", 1) => (ElementKind::Bool, 1),
        ("i", 1 | 2 | 4 | 8) => (ElementKind::Signed, size),
        ("u", 1 | 2 | 4 | 8) => (ElementKind::Unsigned, size),
        ("f", 2 | 4 | 8) => (ElementKind::Float, size),
        ("S", 1..=256) => (ElementKind::Bytes, size),
        ("U", 1..=64) => (ElementKind::Text, 4 * size),
        _ => return Err(strange()),
    };
    Ok((order == ">" || order == "=" && cfg!(target_endian = "big"), kind, width))
}

/// Parses `(309, 28, 28)`.
fn shape(text: &str) -> Result<Vec<usize>, String> {
    let strange = || "`shape` of the array is not a list of sizes".to_owned();
    let (axes, _) = text.strip_prefix('(').and_then(|text| text.split_once(')')).ok_or_else(strange)?;
    let axes: Vec<&str> = axes.split(',').map(str::trim).filter(|axis| !axis.is_empty()).take(33).collect();
    if axes.len() > 32 {
        return Err(strange());
    }
    axes.into_iter().map(|axis| axis.trim_end_matches('L').parse().map_err(|_| strange())).collect()
}

/// Formats a shape as `[309, 28, 28]`.
pub(super) fn named(shape: &[usize]) -> String {
    let axes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    format!("[{}]", axes.join(", "))
}

/// Converts a number of 16 bits (IEEE 754 binary16).
pub(super) fn half(bits: u16) -> f64 {
    const MIN_SUBNORMAL: f64 = 1.0 / 16_777_216.0;
    let (sign, exponent, fraction) = (u64::from(bits >> 15) << 63, u64::from(bits >> 10 & 31), u64::from(bits & 1023));
    let magnitude = match exponent {
        0 => return if sign == 0 { fraction as f64 * MIN_SUBNORMAL } else { -(fraction as f64) * MIN_SUBNORMAL },
        31 => 0x7ff,
        _ => exponent + 1023 - 15,
    };
    f64::from_bits(sign | magnitude << 52 | fraction << 42)
}
