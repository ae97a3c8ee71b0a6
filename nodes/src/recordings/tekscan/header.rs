//! The header of a Tekscan ASCII movie.

use std::ops::Range;

use tactflow_runtime::signal::{ImageShape, Unit};

use crate::recordings::common::text::{Lines, Piece, flaw, shortened};
use crate::recordings::common::units;
use crate::recordings::common::{Flaw, Hints};

/// The properties of the header that are used.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header<'t> {
    /// Size, pitch and unit of the frames.
    pub(super) shape: ImageShape,
    /// Factor from the file's unit to that of the cells.
    pub(super) factor: f64,
    /// Number of the first frame.
    pub(super) start_frame: Option<u64>,
    /// Number of the last frame, and its place.
    pub(super) end_frame: Option<(u64, Range<usize>)>,
    /// Noise threshold [raw].
    pub(super) threshold: Option<f64>,
    /// Nominal time between two frames [s].
    pub(super) period: Option<f64>,
    /// The line that ends the movie.
    pub(super) mark: &'t str,
}

/// The keys that are read.
const KEYS: [&str; 13] = [
    "DATA_TYPE",
    "ROWS",
    "COLS",
    "ROW_SPACING",
    "COL_SPACING",
    "UNITS",
    "START_FRAME",
    "END_FRAME",
    "NOISE_THRESHOLD",
    "SECONDS_PER_FRAME",
    "MILLISECONDS_PER_FRAME",
    "FRAMES_PER_SECOND",
    "MICRO_SECOND",
];

/// Minimum of `MICRO_SECOND` that is a time between two frames [µs]: a smaller value is a flag.
const MIN_PERIOD_US: f64 = 50.0;

/// Reads the header up to its line `ASCII_DATA @@`, in a file of `bytes` bytes.
pub(super) fn read<'t>(lines: &mut Lines<'t>, bytes: usize, hints: &Hints) -> Result<Header<'t>, Vec<Flaw>> {
    let mut keys = Keys { keys: Vec::new(), flaws: Vec::new(), end: Piece { text: "", start: 0 } };
    let header = keys.collect(lines).and_then(|mark| keys.header(mark, bytes, hints));
    match header {
        Some(header) if keys.flaws.is_empty() => Ok(header),
        _ => Err(keys.flaws),
    }
}

/// Removes what a spreadsheet adds to a line: quotes around it, separators after it.
pub(super) fn bare(line: Piece<'_>) -> Piece<'_> {
    let is_added = |c: char| c.is_whitespace() || ",;\"".contains(c);
    line.part(line.text.trim_end_matches(is_added)).trimmed().part_after_quote()
}

struct Keys<'t> {
    keys: Vec<(&'static str, Piece<'t>)>,
    flaws: Vec<Flaw>,
    end: Piece<'t>,
}

impl<'t> Keys<'t> {
    /// Collects the lines of the header, and returns the mark that ends the movie.
    fn collect(&mut self, lines: &mut Lines<'t>) -> Option<&'t str> {
        let mut is_comment = false;
        for line in lines {
            let line = bare(line);
            let key = line.text.split(|c: char| c.is_whitespace() || ",;:=".contains(c)).next().unwrap_or("");
            self.end = Piece { text: key, start: line.start };
            let is_gap = |c: char| c.is_whitespace() || ",;:=".contains(c);
            let value = line.part(line.text[key.len()..].trim_start_matches(is_gap));
            if key == "ASCII_DATA" {
                return Some(if value.text.is_empty() { "@@" } else { value.text });
            }
            if key == "Frame" && (!is_comment || value.text.starts_with(|c: char| c.is_ascii_digit())) {
                break;
            }
            let known = KEYS.iter().find(|known| known.eq_ignore_ascii_case(key));
            match known {
                // A comment may begin with any word.
                Some(known) if is_comment && (*known != key || self.find(known).is_some()) => {}
                Some(known) => {
                    is_comment = false;
                    self.add(known, value);
                }
                None => is_comment |= key == "COMMENTS",
            }
        }
        self.flaws.push(Flaw { span: self.end.span(), message: "the header has no last line `ASCII_DATA @@`".into() });
        None
    }

    fn add(&mut self, key: &'static str, value: Piece<'t>) {
        match self.find(key) {
            Some(other) if other.text != value.text => {
                let message = format!("`{key}` is given twice");
                self.flaws.push(Flaw { span: self.end.span(), message });
            }
            Some(_) => {}
            None => self.keys.push((key, value)),
        }
    }

    fn find(&self, key: &str) -> Option<Piece<'t>> {
        self.keys.iter().find(|(other, _)| *other == key).map(|(_, value)| *value)
    }

    fn header(&mut self, mark: &'t str, bytes: usize, hints: &Hints) -> Option<Header<'t>> {
        let movie = |value: Piece<'_>| match value.text {
            text if text.eq_ignore_ascii_case("MOVIE") => Ok(()),
            other => flaw(&value, format!("the file is a `{}`, not a `MOVIE`", shortened(other))),
        };
        self.optional("DATA_TYPE", movie);
        let [known_rows, known_cols] = hints.size.map_or([None; 2], |size| size.map(Some));
        let [known_x, known_y] = hints.pitch.map_or([None; 2], |pitch| pitch.map(Some));
        let rows = self.required("ROWS", known_rows, |value| size(value, "ROWS"));
        let cols = self.required("COLS", known_cols, |value| size(value, "COLS"));
        let x = self.required("COL_SPACING", known_x, |value| length(value, "COL_SPACING"));
        let y = self.required("ROW_SPACING", known_y, |value| length(value, "ROW_SPACING"));
        let unit = self.required("UNITS", hints.unit.map(|unit| (unit, 1.0)), unit);
        let start_frame = self.optional("START_FRAME", |value| value.count("`START_FRAME`"));
        let end_frame = self.optional("END_FRAME", |value| Ok((value.count("`END_FRAME`")?, value.span())));
        let threshold = self.optional("NOISE_THRESHOLD", |value| value.decimal("`NOISE_THRESHOLD`"));
        let period = self.period();
        let (rows, cols) = (rows?, cols?);
        // A cell takes a character and what ends it.
        if rows.checked_mul(cols).and_then(|cells| cells.checked_mul(2)).is_none_or(|least| least > bytes) {
            let at = self.find("ROWS").unwrap_or(self.end);
            let message = format!("a frame of {rows} by {cols} cells is more than the file holds");
            self.flaws.push(Flaw { span: at.span(), message });
        }
        let (unit, factor) = unit?;
        let shape = ImageShape { rows, cols, pitch: [x?, y?], unit };
        // The threshold of the sensor's own filter is in raw counts.
        let threshold = threshold.filter(|_| unit == Unit::RAW);
        Some(Header { shape, factor, start_frame, end_frame, threshold, period, mark })
    }

    /// Returns the time between two frames [s], from any of its keys.
    fn period(&mut self) -> Option<f64> {
        let none_is_zero = |number: f64| Some(number).filter(|number| *number > 0.0);
        let mut time = |key| self.optional(key, |value| not_negative(value, key)).and_then(none_is_zero);
        let seconds = time("SECONDS_PER_FRAME");
        let milliseconds = time("MILLISECONDS_PER_FRAME").map(|ms| ms / 1e3);
        let rate = time("FRAMES_PER_SECOND").map(|rate| 1.0 / rate);
        let microseconds = time("MICRO_SECOND").filter(|us| *us >= MIN_PERIOD_US).map(|us| us / 1e6);
        let period = seconds.or(milliseconds).or(rate).or(microseconds);
        period.filter(|period| period.is_finite() && *period > 0.0)
    }

    fn optional<T>(&mut self, key: &str, read: impl FnOnce(Piece<'t>) -> Result<T, Flaw>) -> Option<T> {
        let value = self.find(key)?;
        read(value).map_err(|flaw| self.flaws.push(flaw)).ok()
    }

    /// Returns the value of a key, or the known value if the header has no such key.
    fn required<T>(
        &mut self,
        key: &str,
        known: Option<T>,
        read: impl FnOnce(Piece<'t>) -> Result<T, Flaw>,
    ) -> Option<T> {
        match (self.find(key), known) {
            (None, None) => {
                self.flaws.push(Flaw { span: self.end.span(), message: format!("the header has no `{key}`") });
                None
            }
            (None, known) => known,
            (Some(_), _) => self.optional(key, read),
        }
    }
}

fn size(value: Piece<'_>, key: &str) -> Result<usize, Flaw> {
    match usize::try_from(value.count(&format!("`{key}`"))?) {
        Ok(size) if size > 0 => Ok(size),
        _ => flaw(&value, format!("`{key}` must be at least 1")),
    }
}

fn not_negative(value: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let number = value.words().next().unwrap_or(value).decimal(&format!("`{key}`"))?;
    if number >= 0.0 { Ok(number) } else { flaw(&value, format!("`{key}` must be greater than 0")) }
}

/// Parses `0.127 centimeters` to metres.
fn length(value: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let is_number = |c: char| c.is_ascii_digit() || ".,+-".contains(c);
    // `5.08e-3 meters` has two words, `4mm` has one.
    let split = value.text.split_once(char::is_whitespace);
    let (number, name) = split.unwrap_or_else(|| {
        let name = value.text.trim_start_matches(is_number);
        value.text.split_at(value.text.len() - name.len())
    });
    let number = not_negative(value.part(number), key)?;
    match units::metres(name) {
        Some(metres) if number > 0.0 && (number * metres).is_finite() => Ok(number * metres),
        Some(_) => flaw(&value, format!("`{key}` must be greater than 0")),
        None => {
            let name = shortened(name.trim());
            flaw(&value, format!("the unit of `{key}` must be `centimeters`, `millimeters` or `inches`, not `{name}`"))
        }
    }
}

fn unit(value: Piece<'_>) -> Result<(Unit, f64), Flaw> {
    let unknown = || format!("the unit `{}` is unknown; known are {}", shortened(value.text), units::KNOWN);
    units::unit(value.text).ok_or_else(|| Flaw { span: value.span(), message: unknown() })
}
