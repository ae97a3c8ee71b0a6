//! The points of a path from a file: a table (CSV) or a point cloud (PLY).

mod ply;
mod table;

use std::ops::Range;
use std::sync::Arc;

use nalgebra::Vector3;
use tactflow_runtime::node::{At, FilePath, Mistake};
use tactflow_runtime::source::Code;

use crate::usual::USUAL_REACH_M;

/// Largest number of points of a path. Each costs some 200 bytes and a share of the time to load the graph.
const MAX_POINTS: usize = 100_000;
/// Largest size of a file: that of the largest path, with more columns than it needs [bytes].
const MAX_BYTES: usize = 64 << 20;

/// Largest coordinate, as for points in the graph [m].
const MAX_COORDINATE_M: f64 = 1e6;

/// The points of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Points {
    /// The points [m].
    pub(super) points: Vec<Vector3<f64>>,
    /// The place of each point in the text; empty for a binary file.
    spans: Vec<Range<usize>>,
    /// The text; empty for a binary file.
    text: Arc<str>,
}

/// Why a file is refused.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Refused {
    /// The place in the text, or `None` for the file as a whole.
    span: Option<Range<usize>>,
    message: String,
    help: String,
}

impl Refused {
    /// Refuses the file as a whole.
    fn whole(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { span: None, message: message.into(), help: help.into() }
    }

    /// Refuses a place.
    fn at(span: Range<usize>, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { span: Some(span), message: message.into(), help: help.into() }
    }

    /// Refuses a file with too many points.
    fn too_many() -> Self {
        Self::whole(
            format!("the file has more than {MAX_POINTS} points"),
            "leave points out: between two points the path is straight, and its corners are rounded",
        )
    }
}

/// Reads the points of a file.
pub(super) fn read(file: &FilePath) -> Result<Points, Mistake> {
    let bytes = file.bytes()?;
    let found = if bytes.len() > MAX_BYTES {
        let (size, most) = (bytes.len() >> 20, MAX_BYTES >> 20);
        Err(Refused::whole(
            format!("the file has {size} MB, but a path has at most {most} MB"),
            Refused::too_many().help,
        ))
    } else if ply::is_ply(&bytes) {
        ply::read(&bytes)
    } else {
        as_text(&bytes).and_then(table::read)
    };
    match found {
        Ok(points) => {
            let text = if points.spans.is_empty() { Arc::default() } else { String::from_utf8_lossy(&bytes).into() };
            Ok(Points { text, ..points })
        }
        Err(Refused { span: Some(span), message, help }) => {
            Err(Mistake::data(file, &*String::from_utf8_lossy(&bytes), span, message).help(help))
        }
        Err(Refused { span: None, message, help }) => {
            Err(Mistake::new(Code::BadData, At::Span(file.span.clone()), message).help(help))
        }
    }
}

/// Returns the bytes as text.
fn as_text(bytes: &[u8]) -> Result<&str, Refused> {
    str::from_utf8(bytes).map_err(|error| {
        let message = format!("byte {} of the file is not UTF-8 text", error.valid_up_to() + 1);
        Refused::whole(message, "write the points as a CSV file with the columns x, y and z, or as a PLY file")
    })
}

/// Returns whether a number is a coordinate with which distances can be computed.
fn is_coordinate(number: &f64) -> bool {
    number.abs() <= MAX_COORDINATE_M
}

/// Parses a coordinate.
fn coordinate(text: &str, start: usize) -> Result<f64, Refused> {
    let number: Option<f64> = text.parse().ok().filter(is_coordinate);
    number.ok_or_else(|| {
        let short: String = text.chars().take(40).collect();
        let found = if short.is_empty() { "nothing".into() } else { format!("`{short}`") };
        let message = format!("expected a coordinate in metres, found {found}");
        Refused::at(start..start + text.len(), message, "write a finite number with a decimal point, such as `0.04`")
    })
}

impl Points {
    /// Returns the place of a point.
    pub(super) fn place(&self, file: &FilePath, i: usize) -> At {
        match self.spans.get(i) {
            Some(span) => At::Data { file: Box::new(file.clone()), text: Arc::clone(&self.text), span: span.clone() },
            None => At::Param("file".into()),
        }
    }

    /// Returns a warning if a coordinate is beyond the reach of an arm.
    pub(super) fn unusual(&self) -> Option<Mistake> {
        let far = self.points.iter().map(Vector3::amax).find(|size| *size > USUAL_REACH_M)?;
        let message = format!("the path has a coordinate of {far} m, but usual is at most {USUAL_REACH_M} m");
        let warning = Mistake::new(Code::UnusualValue, At::Param("file".into()), message);
        Some(warning.help("if the file is in millimetres, divide all coordinates by 1000"))
    }
}

#[cfg(test)]
mod tests;
