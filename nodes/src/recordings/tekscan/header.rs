//! The header of a Tekscan ASCII movie.

use tactflow_runtime::signal::Unit;

use crate::recordings::common::reel::Properties;
use crate::recordings::common::text::{Lines, Piece, shortened};
use crate::recordings::common::{Hints, TextError, units};

/// The properties of the header that are used.
#[derive(Debug)]
pub(super) struct MovieHeader<'t> {
    /// Number of rows and of columns.
    pub(super) size: [usize; 2],
    /// Size, pitch, unit, time between two frames, and noise threshold.
    pub(super) found: Properties,
    /// Number of the first frame.
    pub(super) start_frame: Option<u64>,
    /// Number of the last frame, and its place.
    pub(super) end_frame: Option<(u64, Piece<'t>)>,
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
pub(super) fn read<'t>(lines: &mut Lines<'t>, bytes: usize, hints: &Hints) -> Result<MovieHeader<'t>, Vec<TextError>> {
    let mut keys = Keys { keys: Vec::new(), flaws: Vec::new(), end: Piece { text: "", start: 0 } };
    let header = keys.collect(lines).and_then(|mark| keys.header(mark, bytes, hints));
    header.filter(|_| keys.flaws.is_empty()).ok_or(keys.flaws)
}

/// Removes what a spreadsheet adds to a line: quotes around it, separators after it.
pub(super) fn bare(line: Piece<'_>) -> Piece<'_> {
    let is_added = |c: char| c.is_whitespace() || ",;\"".contains(c);
    line.part(line.text.trim_end_matches(is_added)).trimmed().part_after_quote()
}

struct Keys<'t> {
    keys: Vec<(&'static str, Piece<'t>)>,
    flaws: Vec<TextError>,
    end: Piece<'t>,
}

impl<'t> Keys<'t> {
    /// Collects the lines of the header, and returns the mark that ends the movie.
    fn collect(&mut self, lines: &mut Lines<'t>) -> Option<&'t str> {
        let is_gap = |c: char| c.is_whitespace() || ",;:=".contains(c);
        let mut is_comment = false;
        for line in lines.map(bare) {
            let key = line.text.split(is_gap).next().unwrap_or("");
            self.end = Piece { text: key, start: line.start };
            let value = line.part(line.text[key.len()..].trim_start_matches(is_gap));
            if key == "ASCII_DATA" {
                return Some(if value.text.is_empty() { "@@" } else { value.text });
            }
            if key == "Frame" && (!is_comment || value.text.starts_with(|c: char| c.is_ascii_digit())) {
                break;
            }
            match KEYS.iter().find(|known| known.eq_ignore_ascii_case(key)) {
                // A comment may begin with any word.
                Some(known) if is_comment && (*known != key || self.find(known).is_some()) => {}
                Some(known) => {
                    is_comment = false;
                    self.add(known, value);
                }
                None => is_comment |= key == "COMMENTS",
            }
        }
        self.flaws.push(self.end.error("the header has no last line `ASCII_DATA @@`"));
        None
    }

    fn add(&mut self, key: &'static str, value: Piece<'t>) {
        match self.find(key) {
            Some(other) if other.text != value.text => {
                self.flaws.push(self.end.error(format!("`{key}` is given twice")));
            }
            Some(_) => {}
            None => self.keys.push((key, value)),
        }
    }

    fn find(&self, key: &str) -> Option<Piece<'t>> {
        self.keys.iter().find(|(other, _)| *other == key).map(|(_, value)| *value)
    }

    fn header(&mut self, mark: &'t str, bytes: usize, hints: &Hints) -> Option<MovieHeader<'t>> {
        self.optional("DATA_TYPE", |value, _| {
            let kind = shortened(value.text);
            let is_movie = value.text.eq_ignore_ascii_case("MOVIE");
            value.check(is_movie, format_args!("the file is a `{kind}`, not a `MOVIE`"))
        });
        let [known_rows, known_cols] = hints.size.map_or([None; 2], |size| size.map(Some));
        let [known_x, known_y] = hints.pitch.map_or([None; 2], |pitch| pitch.map(Some));
        let rows = self.required("ROWS", known_rows, Piece::side);
        let cols = self.required("COLS", known_cols, Piece::side);
        let x = self.required("COL_SPACING", known_x, length);
        let y = self.required("ROW_SPACING", known_y, length);
        let unit = self.required("UNITS", hints.unit.map(|unit| (unit, 1.0)), unit);
        let start_frame = self.optional("START_FRAME", Piece::count);
        let end_frame = self.optional("END_FRAME", |value, what| Ok((value.count(what)?, value)));
        let threshold = self.optional("NOISE_THRESHOLD", Piece::decimal);
        let period = self.period();
        let size @ [rows, cols] = [rows?, cols?];
        // A cell takes a character and what ends it.
        if rows.checked_mul(cols).and_then(|cells| cells.checked_mul(2)).is_none_or(|least| least > bytes) {
            let at = self.find("ROWS").unwrap_or(self.end);
            self.flaws.push(at.error(format!("a frame of {rows} by {cols} cells is more than the file holds")));
        }
        // The threshold of the sensor's own filter is in raw counts.
        let threshold = threshold.filter(|_| unit.is_some_and(|(unit, _)| unit == Unit::RAW));
        let pitch = Some([x?, y?]);
        let found = Properties { size: Some(size), unit: Some(unit?), pitch, period, threshold, force: None };
        Some(MovieHeader { size, found, start_frame, end_frame, mark })
    }

    /// Returns the time between two frames [s], from any of its keys.
    fn period(&mut self) -> Option<f64> {
        let mut time = |key| self.optional(key, not_negative).filter(|number| *number > 0.0);
        let seconds = time("SECONDS_PER_FRAME");
        let milliseconds = time("MILLISECONDS_PER_FRAME").map(|ms| ms / 1e3);
        let rate = time("FRAMES_PER_SECOND").map(f64::recip);
        let microseconds = time("MICRO_SECOND").filter(|us| *us >= MIN_PERIOD_US).map(|us| us / 1e6);
        let period = seconds.or(milliseconds).or(rate).or(microseconds);
        period.filter(|period| period.is_finite() && *period > 0.0)
    }

    /// Parses the value of a key; `parse` also gets the name of the key for messages.
    fn optional<T>(&mut self, key: &str, parse: impl FnOnce(Piece<'t>, &str) -> Result<T, TextError>) -> Option<T> {
        let value = self.find(key)?;
        parse(value, &format!("`{key}`")).map_err(|flaw| self.flaws.push(flaw)).ok()
    }

    /// Returns the value of a key, or the known value if the header has no such key.
    fn required<T>(
        &mut self,
        key: &str,
        known: Option<T>,
        parse: impl FnOnce(Piece<'t>, &str) -> Result<T, TextError>,
    ) -> Option<T> {
        if self.find(key).is_some() {
            return self.optional(key, parse);
        }
        if known.is_none() {
            self.flaws.push(self.end.error(format!("the header has no `{key}`")));
        }
        known
    }
}

fn not_negative(value: Piece<'_>, what: &str) -> Result<f64, TextError> {
    let number = value.words().next().unwrap_or(value).decimal(what)?;
    value.check(number >= 0.0, format_args!("{what} must be greater than 0"))?;
    Ok(number)
}

/// Parses `0.127 centimeters` to metres.
fn length(value: Piece<'_>, what: &str) -> Result<f64, TextError> {
    let is_number = |c: char| c.is_ascii_digit() || ".,+-".contains(c);
    // `5.08e-3 meters` has two words, `4mm` has one.
    let split = value.text.split_once(char::is_whitespace);
    let (number, name) = split.unwrap_or_else(|| {
        let name = value.text.trim_start_matches(is_number);
        value.text.split_at(value.text.len() - name.len())
    });
    let number = not_negative(value.part(number), what)?;
    let strange = || {
        let name = shortened(name.trim());
        value.error(format!("the unit of {what} must be `centimeters`, `millimeters` or `inches`, not `{name}`"))
    };
    let length = number * units::metres(name).ok_or_else(strange)?;
    value.check(length > 0.0 && length.is_finite(), format_args!("{what} must be greater than 0"))?;
    Ok(length)
}

fn unit(value: Piece<'_>, _: &str) -> Result<(Unit, f64), TextError> {
    let unknown = || format!("the unit `{}` is unknown; known are {}", shortened(value.text), units::KNOWN);
    units::unit(value.text).ok_or_else(|| value.error(unknown()))
}
