//! Points from a PLY file: the properties x, y and z of its vertices, as text or in little-endian binary.
//!
//! The vertices must be the first element. Other properties and elements are left out.

use nalgebra::Vector3;

use super::table::lines;
use super::{MAX_POINTS, Points, Refused, as_text, coordinate, is_coordinate};

/// How to fix a file.
const HELP: &str =
    "write it with `tactflow run --points`, or export vertices with the properties x, y and z as `ascii 1.0`";

/// The header of a file.
#[derive(Debug, Default)]
struct Header {
    is_binary: bool,
    count: usize,
    /// The properties of a vertex, each with its type.
    properties: Vec<(String, Number)>,
    /// Length of the header [bytes].
    length: usize,
}

/// The type of a property.
#[derive(Debug, Clone, Copy)]
enum Number {
    Float,
    Double,
    /// A whole number of that many bytes.
    Whole(usize),
}

/// Returns whether a file is a PLY file.
pub(super) fn is_ply(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
}

/// Reads the vertices.
pub(super) fn read(bytes: &[u8]) -> Result<Points, Refused> {
    let header = Header::read(bytes)?;
    if header.count > MAX_POINTS {
        return Err(Refused::too_many());
    }
    let missing = |name: &str| Refused::whole(format!("its vertices have no property `{name}`"), HELP);
    let find = |name: &str| header.properties.iter().position(|(other, _)| other == name).ok_or_else(|| missing(name));
    let columns = [find("x")?, find("y")?, find("z")?];
    if header.is_binary { header.read_binary(bytes, columns) } else { header.read_text(bytes, columns) }
}

impl Header {
    /// Reads the header line by line.
    fn read(bytes: &[u8]) -> Result<Self, Refused> {
        let mut header = Self::default();
        let mut has_vertices = None;
        for line in bytes.split_inclusive(|byte| *byte == b'\n') {
            let start = header.length;
            header.length += line.len();
            let Ok(text) = str::from_utf8(line).map(str::trim) else { break };
            let refuse = |message: String| Refused::at(start..start + text.len(), message, HELP);
            let words: Vec<&str> = text.split_whitespace().collect();
            match words[..] {
                ["end_header"] if has_vertices.is_some() => return Ok(header),
                ["format", format, "1.0"] => {
                    header.is_binary = binary(format).ok_or_else(|| {
                        refuse(format!("`{format}` is not read, only `ascii` and `binary_little_endian`"))
                    })?
                }
                ["element", "vertex", count] if has_vertices.is_none() => {
                    header.count =
                        count.parse().map_err(|_| refuse(format!("`{count}` is not a number of vertices")))?;
                    has_vertices = Some(true);
                }
                ["element", name, _] if has_vertices.is_none() => {
                    return Err(refuse(format!("`{name}` comes before the vertices")));
                }
                ["element", ..] => has_vertices = Some(false),
                ["property", kind, name] if has_vertices == Some(true) => {
                    let number =
                        Number::named(kind).ok_or_else(|| refuse(format!("`{kind}` is not the type of a number")))?;
                    header.properties.push((name.into(), number));
                }
                ["property", ..] if has_vertices == Some(true) => {
                    return Err(refuse("a vertex with a list is not read".into()));
                }
                ["ply"] | ["comment" | "obj_info" | "property", ..] => {}
                _ => return Err(refuse("this is not a line of the header of a PLY file".into())),
            }
        }
        Err(Refused::whole("the header of the PLY file has no end", HELP))
    }

    /// Returns the mistake that the file ends too early.
    fn cut(&self, found: usize) -> Refused {
        Refused::whole(format!("the file states {} vertices, but it ends after {found}", self.count), HELP)
    }

    /// Reads the vertices of a text.
    fn read_text(&self, bytes: &[u8], columns: [usize; 3]) -> Result<Points, Refused> {
        let text = as_text(&bytes[self.length..])?;
        let mut found = Points::default();
        for (start, line) in lines(text, self.length).take(self.count) {
            let span = start..start + line.len();
            let mut point = [0.0; 3];
            for (place, column) in point.iter_mut().zip(columns) {
                let word = line.split_whitespace().nth(column).ok_or_else(|| {
                    Refused::at(span.clone(), "this vertex has fewer numbers than the header states", HELP)
                })?;
                *place = coordinate(word, start + word.as_ptr() as usize - line.as_ptr() as usize)?;
            }
            found.points.push(Vector3::from(point));
            found.spans.push(span);
        }
        if found.points.len() < self.count { Err(self.cut(found.points.len())) } else { Ok(found) }
    }

    /// Reads the vertices of a binary file.
    fn read_binary(&self, bytes: &[u8], columns: [usize; 3]) -> Result<Points, Refused> {
        let offset = |column: usize| self.properties[..column].iter().map(|(_, kind)| kind.size()).sum::<usize>();
        let stride = offset(self.properties.len());
        let mut points = Vec::new();
        for vertex in bytes[self.length..].chunks_exact(stride).take(self.count) {
            let mut point = [0.0; 3];
            for (place, column) in point.iter_mut().zip(columns) {
                let (name, kind) = &self.properties[column];
                let cell = &vertex[offset(column)..];
                *place = kind.read(cell).filter(is_coordinate).ok_or_else(|| {
                    let message = format!(
                        "`{name}` of vertex {} is not a coordinate in metres as a float or double",
                        points.len() + 1
                    );
                    Refused::whole(message, HELP)
                })?;
            }
            points.push(Vector3::from(point));
        }
        if points.len() < self.count { Err(self.cut(points.len())) } else { Ok(Points { points, ..Points::default() }) }
    }
}

/// Returns whether a format is binary, or `None` for one that is not read.
fn binary(format: &str) -> Option<bool> {
    match format {
        "ascii" => Some(false),
        "binary_little_endian" => Some(true),
        _ => None,
    }
}

impl Number {
    /// Returns the type of a name.
    fn named(name: &str) -> Option<Self> {
        match name {
            "char" | "uchar" | "int8" | "uint8" => Some(Self::Whole(1)),
            "short" | "ushort" | "int16" | "uint16" => Some(Self::Whole(2)),
            "int" | "uint" | "int32" | "uint32" => Some(Self::Whole(4)),
            "float" | "float32" => Some(Self::Float),
            "double" | "float64" => Some(Self::Double),
            _ => None,
        }
    }

    /// Returns its number of bytes.
    const fn size(self) -> usize {
        match self {
            Self::Float => 4,
            Self::Double => 8,
            Self::Whole(size) => size,
        }
    }

    /// Returns the number in the first bytes of a cell, or `None` for a whole number.
    fn read(self, cell: &[u8]) -> Option<f64> {
        match self {
            Self::Float => Some(f64::from(f32::from_le_bytes(*cell.first_chunk()?))),
            Self::Double => Some(f64::from_le_bytes(*cell.first_chunk()?)),
            Self::Whole(_) => None,
        }
    }
}
