//! The header of a Tekscan ASCII movie.

use std::ops::Range;

use tactflow_runtime::signal::{Base, ImageShape, Unit};

use crate::recordings::text::{Flaw, Lines, Piece, flaw, shortened};

/// What the header says that matters.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    /// Size, pitch and unit of the frames.
    pub(super) shape: ImageShape,
    /// Number of the first frame.
    pub(super) start_frame: Option<u64>,
    /// Number of the last frame, and where that stands.
    pub(super) end_frame: Option<(u64, Range<usize>)>,
    /// Noise threshold, in the unit of the cells.
    pub(super) threshold: Option<f64>,
    /// Nominal time between two frames [s].
    pub(super) period: Option<f64>,
}

const UNITS: [(&str, Unit); 3] = [("raw", Unit::RAW), ("kPa", Unit::of(Base::Kilopascal)), ("N", Unit::NEWTON)];
const LENGTHS: [(&str, f64); 3] = [("centimeters", 0.01), ("millimeters", 0.001), ("inches", 0.0254)];

/// Reads the header, up to and with its line `ASCII_DATA @@`, of a file of `bytes` bytes.
pub(super) fn read(lines: &mut Lines<'_>, bytes: usize) -> Result<Header, Vec<Flaw>> {
    let mut keys = Keys { keys: Vec::new(), flaws: Vec::new(), end: Piece { text: "", start: 0 } };
    let has_end = keys.collect(lines);
    let mut header = None;
    if has_end {
        header = keys.header(bytes);
    }
    if keys.flaws.is_empty() { Ok(header.expect("without a flaw it is whole")) } else { Err(keys.flaws) }
}

struct Keys<'t> {
    keys: Vec<(&'t str, Piece<'t>)>,
    flaws: Vec<Flaw>,
    end: Piece<'t>,
}

impl<'t> Keys<'t> {
    /// Collects the lines of the header; whether it has an end.
    fn collect(&mut self, lines: &mut Lines<'t>) -> bool {
        for line in lines {
            let line = line.trimmed();
            let key = line.text.split_whitespace().next().unwrap_or("");
            self.end = Piece { text: key, start: line.start };
            if key == "Frame" {
                break;
            }
            let value = Piece { text: &line.text[key.len()..], start: line.start + key.len() }.trimmed();
            if key == "ASCII_DATA" {
                return true;
            }
            if self.keys.iter().any(|(other, _)| *other == key) && !key.is_empty() {
                self.flaws
                    .push(Flaw { span: self.end.span(), message: format!("`{}` is given twice", shortened(key)) });
            }
            self.keys.push((key, value));
        }
        self.flaws.push(Flaw { span: self.end.span(), message: "the header has no `ASCII_DATA @@` at its end".into() });
        false
    }

    fn header(&mut self, bytes: usize) -> Option<Header> {
        let movie = |value: Piece<'_>| match value.text {
            "MOVIE" => Ok(()),
            other => flaw(&value, format!("the file is a `{}`, not a `MOVIE`", shortened(other))),
        };
        let is_movie = self.required("DATA_TYPE", movie);
        let rows = self.required("ROWS", |value| size(value, "ROWS"));
        let cols = self.required("COLS", |value| size(value, "COLS"));
        let x = self.required("COL_SPACING", |value| length(value, "COL_SPACING"));
        let y = self.required("ROW_SPACING", |value| length(value, "ROW_SPACING"));
        let unit = self.required("UNITS", unit);
        let start_frame = self.optional("START_FRAME", |value| value.count("`START_FRAME`"));
        let end_frame = self.optional("END_FRAME", |value| Ok((value.count("`END_FRAME`")?, value.span())));
        let threshold = self.optional("NOISE_THRESHOLD", |value| value.number("`NOISE_THRESHOLD`"));
        let period = self.optional("SECONDS_PER_FRAME", |value| positive(value, "SECONDS_PER_FRAME"));
        let (rows, cols) = (rows?, cols?);
        // A cell takes a character and what ends it.
        if rows.checked_mul(cols).and_then(|cells| cells.checked_mul(2)).is_none_or(|least| least > bytes) {
            let (_, value) = self.keys.iter().find(|(key, _)| *key == "ROWS").expect("it was read");
            let message = format!("a frame of {rows} by {cols} cells is more than the file holds");
            self.flaws.push(Flaw { span: value.span(), message });
        }
        is_movie?;
        let shape = ImageShape { rows, cols, pitch: [x?, y?], unit: unit? };
        Some(Header { shape, start_frame, end_frame, threshold, period })
    }

    fn optional<T>(&mut self, key: &str, read: impl FnOnce(Piece<'t>) -> Result<T, Flaw>) -> Option<T> {
        let (_, value) = self.keys.iter().find(|(other, _)| *other == key)?;
        read(*value).map_err(|flaw| self.flaws.push(flaw)).ok()
    }

    fn required<T>(&mut self, key: &str, read: impl FnOnce(Piece<'t>) -> Result<T, Flaw>) -> Option<T> {
        if !self.keys.iter().any(|(other, _)| *other == key) {
            self.flaws.push(Flaw { span: self.end.span(), message: format!("the header has no `{key}`") });
        }
        self.optional(key, read)
    }
}

fn size(value: Piece<'_>, key: &str) -> Result<usize, Flaw> {
    match usize::try_from(value.count(&format!("`{key}`"))?) {
        Ok(size) if size > 0 => Ok(size),
        _ => flaw(&value, format!("`{key}` is at least 1")),
    }
}

fn positive(value: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let number = value.number(&format!("`{key}`"))?;
    if number > 0.0 { Ok(number) } else { flaw(&value, format!("`{key}` is greater than 0")) }
}

/// `0.127 centimeters` in metres.
fn length(value: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let (number, name) = value.text.split_once(char::is_whitespace).unwrap_or((value.text, ""));
    let number = positive(Piece { text: number, start: value.start }, key)?;
    match LENGTHS.iter().find(|(length, _)| *length == name.trim()) {
        Some((_, metres)) => Ok(number * metres),
        None => flaw(
            &value,
            format!("`{key}` is in `centimeters`, `millimeters` or `inches`, not `{}`", shortened(name.trim())),
        ),
    }
}

fn unit(value: Piece<'_>) -> Result<Unit, Flaw> {
    match UNITS.iter().find(|(name, _)| *name == value.text) {
        Some((_, unit)) => Ok(*unit),
        None => {
            flaw(&value, format!("the unit `{}` is not known here; `raw`, `kPa` and `N` are", shortened(value.text)))
        }
    }
}
