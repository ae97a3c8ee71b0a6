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
        let order = value("fortran_order")?.split([',', '}']).next().unwrap_or("").trim();
        if !matches!(order, "True" | "False") {
            let order = shortened(order);
            return Err(format!("`fortran_order` of the array must be `True` or `False`, not `{order}`"));
        }
        let is_fortran = order == "True";
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
        let bits = self.bits(bytes);
        let unused = 64 - 8 * self.width as u32;
        match (self.kind, self.width) {
            (ElementKind::Float, 2) => half(bits as u16),
            (ElementKind::Float, 4) => f32::from_bits(bits as u32).into(),
            (ElementKind::Float, _) => f64::from_bits(bits),
            (ElementKind::Signed, _) => (((bits << unused) as i64) >> unused) as f64,
            _ => bits as f64,
        }
    }

    fn bits(&self, bytes: &[u8]) -> u64 {
        let add = |bits, byte: &u8| bits << 8 | u64::from(*byte);
        if self.is_big { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) }
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
        let letter = |bytes: &[u8]| {
            let code = u32::try_from(self.bits(bytes)).ok().and_then(char::from_u32);
            code.unwrap_or(char::REPLACEMENT_CHARACTER)
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
    let quote = text.chars().next().filter(|quote| matches!(quote, '\'' | '"'));
    let strange = || {
        // A list of fields ends at `]`, a name at its quote.
        let end = match quote {
            Some(quote) => text[1..].find(quote).map(|at| at + 2),
            None if text.starts_with('[') => text.find(']').map(|at| at + 1),
            None => None,
        };
        let name = shortened(&text[..end.unwrap_or(text.len())]);
        format!("elements of type `{name}` are not supported: save plain numbers")
    };
    let mark = quote.ok_or_else(strange)?;
    let name = text[1..].split(mark).next().unwrap_or("");
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

/// Converts a number of 16 bits (IEEE 754 binary16). It is written as 64 bits, whose exponent has another bias.
pub(super) fn half(bits: u16) -> f64 {
    const BIAS: f64 = f64::from_bits((1023 - 15 + 1023) << 52);
    let magnitude = u64::from(bits & 0x7fff) << 42;
    let is_finite = bits & 0x7c00 != 0x7c00;
    let number = if is_finite { f64::from_bits(magnitude) * BIAS } else { f64::from_bits(0x7ff << 52 | magnitude) };
    if bits >> 15 == 0 { number } else { -number }
}
