//! Values as JSON text, without an allocation for each number.

use std::fmt::Write;

use super::schema::{ORIENTATION, POSITION};
use crate::record::seconds_text;
use crate::signal::{Arenas, Flag, Image, Jacobian, Kind, Mask, Regions, Shape, Signal, VectorImage, VectorImageShape};

/// What the JSON of a port contains besides its value.
pub(crate) struct PortText {
    pub(crate) shape: Shape,
    /// Names of the scalars, as JSON strings with a colon and, except for the time before, a comma.
    names: Vec<String>,
    frame: String,
    row: Vec<f64>,
}

/// Returns the key of a scalar of a port in its messages: the name of a component, and `value` for one without a name.
/// `t` is the time.
pub(crate) fn scalar_key(name: &str) -> &str {
    match name {
        "" => "value",
        "t" => "t_",
        name => name,
    }
}

/// Writes a number; one that is not finite is null.
fn put_number(out: &mut String, value: f64) {
    // Writing to a string cannot fail.
    let _ = if value.is_finite() { write!(out, "{value:?}") } else { write!(out, "null") };
}

/// Writes a text in quotes.
pub(crate) fn quoted_json(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// Writes the `timestamp` of Foxglove's schemas.
pub(crate) fn put_timestamp(out: &mut String, nanos: i64) {
    let nanos = nanos.max(0);
    let _ = write!(out, "\"timestamp\":{{\"sec\":{},\"nsec\":{}}}", nanos / 1_000_000_000, nanos % 1_000_000_000);
}

impl PortText {
    pub(crate) fn new(shape: &Shape, frames: &[Option<String>]) -> Self {
        let scalars = shape.scalars();
        let name = |name: &String| format!(",{}:", quoted_json(scalar_key(name)));
        // The frame of a pose is the one in which it is written.
        let frame = frames.get(usize::from(shape.kind() == Kind::Pose)).cloned().flatten().unwrap_or_default();
        Self {
            shape: shape.clone(),
            names: scalars.iter().map(|(scalar, _)| name(scalar)).collect(),
            frame: quoted_json(&frame),
            row: vec![0.0; scalars.len()],
        }
    }

    /// Whether the schema of the port can say that it is absent.
    pub(crate) fn has_null(kind: Kind) -> bool {
        !matches!(kind, Kind::Image | Kind::VectorImage | Kind::Mask | Kind::Pose)
    }

    /// Writes the value in a slot, or that there is none, at a time of the graph \[ns\] and of the file \[ns\].
    pub(crate) fn write(&mut self, arenas: &Arenas, slot: Option<u32>, [now, time]: [i64; 2], out: &mut String) {
        match (&self.shape, slot) {
            (Shape::Image(shape), Some(slot)) => {
                let image = &Image::arena(arenas)[slot as usize];
                let cells = image.cells().iter().flat_map(|cell| cell.to_le_bytes());
                self.grid(shape.pitch, [image.rows(), image.cols()], (&["value"], 4, 7), cells, time, out);
            }
            (Shape::VectorImage(VectorImageShape(shape)), Some(slot)) => {
                let image = &VectorImage::arena(arenas)[slot as usize];
                let cells = image.cells().iter().flatten().flat_map(|value| value.to_le_bytes());
                self.grid(shape.pitch, [image.rows(), image.cols()], (&["x", "y", "z"], 4, 7), cells, time, out);
            }
            (Shape::Mask(shape), Some(slot)) => {
                let mask = &Mask::arena(arenas)[slot as usize];
                let (rows, cols) = (mask.rows(), mask.cols());
                let cells = (0..rows).flat_map(|i| (0..cols).map(move |j| u8::from(mask.contains(i, j))));
                self.grid(shape.pitch, [rows, cols], (&["mask"], 1, 1), cells, time, out);
            }
            (Shape::Pose(_), Some(slot)) => {
                arenas.read_scalars(Kind::Pose, slot, 0, &mut self.row);
                self.pose(time, out);
            }
            (Shape::Regions(_), _) => regions(slot.map(|slot| &Regions::arena(arenas)[slot as usize]), now, out),
            (Shape::Jacobian(_), _) => jacobian(slot.map(|slot| &Jacobian::arena(arenas)[slot as usize]), now, out),
            (shape, slot) => {
                let kind = shape.kind();
                match slot {
                    Some(slot) => drop(arenas.read_scalars(kind, slot, 0, &mut self.row)),
                    None => self.row.fill(f64::NAN),
                }
                let flag = slot.filter(|_| kind == Kind::Flag).map(|slot| Flag::arena(arenas)[slot as usize]);
                self.scalars(flag, now, out);
            }
        }
    }

    fn scalars(&self, flag: Option<bool>, now: i64, out: &mut String) {
        let _ = write!(out, "{{\"t\":{}", seconds_text(now));
        for (name, value) in self.names.iter().zip(&self.row) {
            out.push_str(name);
            match flag {
                Some(flag) => out.push_str(if flag { "true" } else { "false" }),
                None => put_number(out, *value),
            }
        }
        out.push('}');
    }

    fn pose(&self, time: i64, out: &mut String) {
        out.push('{');
        put_timestamp(out, time);
        let _ = write!(out, ",\"frame_id\":{},\"pose\":{{", self.frame);
        put_vector(out, POSITION, &["x", "y", "z"], &self.row[..3]);
        out.push(',');
        put_vector(out, ORIENTATION, &["x", "y", "z", "w"], &self.row[3..]);
        out.push_str("}}");
    }

    /// Writes the pose that was written last as the transform of a frame in its parent.
    pub(crate) fn write_transform(&self, child: &str, time: i64, out: &mut String) {
        out.push('{');
        put_timestamp(out, time);
        let _ = write!(out, ",\"parent_frame_id\":{},\"child_frame_id\":{child},", self.frame);
        put_vector(out, "translation", &["x", "y", "z"], &self.row[..3]);
        out.push(',');
        put_vector(out, "rotation", &["x", "y", "z", "w"], &self.row[3..]);
        out.push('}');
    }

    /// Writes a grid whose middle is the origin of its frame. `fields` are the names of the
    /// fields of a cell, and the size and the type of each.
    fn grid(
        &self,
        pitch: [f64; 2],
        [rows, cols]: [usize; 2],
        fields: (&[&str], usize, u8),
        cells: impl Iterator<Item = u8>,
        time: i64,
        out: &mut String,
    ) {
        let (names, size, code) = fields;
        let stride = names.len() * size;
        out.push('{');
        put_timestamp(out, time);
        let _ = write!(out, ",\"frame_id\":{},\"pose\":{{", self.frame);
        let corner = [-(cols as f64) * pitch[0] / 2.0, -(rows as f64) * pitch[1] / 2.0, 0.0];
        put_vector(out, POSITION, &["x", "y", "z"], &corner);
        out.push(',');
        put_vector(out, ORIENTATION, &["x", "y", "z", "w"], &[0.0, 0.0, 0.0, 1.0]);
        let _ = write!(out, "}},\"column_count\":{cols},");
        put_vector(out, "cell_size", &["x", "y"], &pitch);
        let _ = write!(out, ",\"row_stride\":{},\"cell_stride\":{stride},", cols * stride);
        out.push_str("\"fields\":[");
        for (i, name) in names.iter().enumerate() {
            let comma = if i > 0 { "," } else { "" };
            let _ = write!(out, "{comma}{{\"name\":\"{name}\",\"offset\":{},\"type\":{code}}}", i * size);
        }
        out.push_str("],\"data\":\"");
        put_base64(out, cells);
        out.push_str("\"}");
    }
}

fn put_vector(out: &mut String, name: &str, axes: &[&str], values: &[f64]) {
    let _ = write!(out, "\"{name}\":{{");
    for (i, (axis, value)) in axes.iter().zip(values).enumerate() {
        let _ = write!(out, "{}\"{axis}\":{value:?}", if i > 0 { "," } else { "" });
    }
    out.push('}');
}

fn regions(regions: Option<&Regions>, now: i64, out: &mut String) {
    let _ = write!(out, "{{\"t\":{},", seconds_text(now));
    let Some(regions) = regions else { return out.push_str("\"regions\":null,\"runs\":null}") };
    out.push_str("\"regions\":[");
    for (i, region) in regions.list().iter().enumerate() {
        let _ = write!(out, "{}{{\"area\":{},\"force\":", if i > 0 { "," } else { "" }, region.area);
        put_number(out, region.force);
        out.push('}');
    }
    out.push_str("],\"runs\":[");
    for (i, run) in regions.runs().iter().enumerate() {
        let comma = if i > 0 { "," } else { "" };
        let _ = write!(out, "{comma}[{},{},{},{}]", run.row, run.start, run.end, run.region);
    }
    out.push_str("]}");
}

fn jacobian(jacobian: Option<&Jacobian>, now: i64, out: &mut String) {
    let _ = write!(out, "{{\"t\":{},", seconds_text(now));
    let Some(jacobian) = jacobian else { return out.push_str("\"columns\":null}") };
    out.push_str("\"columns\":[");
    for (i, column) in jacobian.0.iter().enumerate() {
        out.push_str(if i > 0 { ",[" } else { "[" });
        for (j, value) in column.0.iter().enumerate() {
            out.push_str(if j > 0 { "," } else { "" });
            put_number(out, *value);
        }
        out.push(']');
    }
    out.push_str("]}");
}

/// Writes bytes as base64 (RFC 4648, section 4).
fn put_base64(out: &mut String, bytes: impl Iterator<Item = u8>) {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = bytes.peekable();
    while bytes.peek().is_some() {
        let group = [bytes.next(), bytes.next(), bytes.next()];
        let bits = group.iter().fold(0_u32, |bits, byte| bits << 8 | u32::from(byte.unwrap_or(0)));
        let count = group.iter().flatten().count();
        for i in 0..4 {
            let digit = ALPHABET[(bits >> (18 - 6 * i) & 63) as usize];
            out.push(char::from(if i <= count { digit } else { b'=' }));
        }
    }
}

/// Reads base64. `None` if the text is not base64.
pub(crate) fn base64(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => Some(byte - b'A'),
        b'a'..=b'z' => Some(byte - b'a' + 26),
        b'0'..=b'9' => Some(byte - b'0' + 52),
        b'+' => Some(62),
        b'/' => Some(63),
        _ => None,
    };
    let digits = text.trim_end_matches('=').as_bytes();
    let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
    for group in digits.chunks(4) {
        let mut bits = 0_u32;
        for byte in group {
            bits = bits << 6 | u32::from(digit(*byte)?);
        }
        bits <<= 6 * (4 - group.len());
        bytes.extend_from_slice(bits.to_be_bytes().get(1..group.len())?);
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_rfc() {
        // RFC 4648, section 10.
        let cases = [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ];
        for (plain, coded) in cases {
            let mut text = String::new();
            put_base64(&mut text, plain.bytes());
            assert_eq!((text.as_str(), base64(coded).as_deref()), (coded, Some(plain.as_bytes())));
        }
        let all: Vec<u8> = (0..=255).collect();
        let mut text = String::new();
        put_base64(&mut text, all.iter().copied());
        assert_eq!(base64(&text), Some(all));
        assert_eq!(base64("a b="), None);
    }

    #[test]
    fn a_feature_that_is_called_as_the_time_has_another_key() {
        let unit = crate::signal::Unit::ONE;
        let shape = crate::signal::FeaturesShape::new([("t", unit), ("x", unit)]);
        let mut arenas = Arenas::default();
        let slot = arenas.add(&shape.clone().into());
        crate::signal::Features::arena_mut(&mut arenas)[0].fill(&[Some(0.5), None]);
        let mut text = String::new();
        PortText::new(&shape.into(), &[None]).write(&arenas, Some(slot), [1_500_000_000, 0], &mut text);
        assert_eq!(text, "{\"t\":1.5,\"t_\":0.5,\"x\":null}");
    }

    #[test]
    fn a_number_that_is_not_finite_is_null() {
        let mut text = String::new();
        [1.0, 1e-7, f64::NAN, f64::INFINITY, -0.0, 1e300].iter().for_each(|value| {
            put_number(&mut text, *value);
            text.push(' ');
        });
        assert_eq!(text, "1.0 1e-7 null null -0.0 1e300 ");
    }
}
