//! `xsensor`: the CSV export of XSENSOR's software (X3, Pro, Foresight).
//!
//! A line has a key and a value, with a colon after the key in some versions: `Units` and `Threshold` at the top, then
//! for each frame `FRAME`, `Date`, `Time`, and for each pad `SENSOR`, `Rows`, `Columns`, `Sensel Width (cm)`, `Sensel
//! Height (cm)`, figures, and `SENSELS` with a line of cells for each row. Blank lines and lines of commas may be
//! anywhere. Numbers may be in quotes, with a decimal comma. Groups of sensels (`GROUP`) repeat parts of the pads and are
//! ignored. Pressures become kPa. Times are times of the day.
//!
//! A file may have several pads, as the two insoles of a pair: the bench selects one with `pad`. There is no default.

use tactflow_runtime::signal::{ImageShape, Unit};

use crate::recordings::common::fields::Fields;
use crate::recordings::common::reel::{Reel, bounded};
use crate::recordings::common::text::{self, Lines, Piece, Wrong, flaw, shortened};
use crate::recordings::common::{Flaw, Format, Head, Hints, Recording, Refusal, units};

pub(super) const FORMAT: Format = Format {
    name: "xsensor",
    title: "the CSV export of XSENSOR's software",
    recognises,
    read: |bytes, hints| text::read(bytes, hints, parse),
};

/// Length of a day [ns].
const DAY_NS: i64 = 86_400_000_000_000;
/// Maximum length of a recording [ns].
const MAX_LENGTH_NS: i64 = 400 * DAY_NS;

/// Maximum number of pads that a message lists.
const MAX_LISTED: usize = 32;

fn recognises(head: &Head<'_>) -> bool {
    let has = |wanted: &str| Lines::new(&head.text).any(|line| Entry::of(line, separator(line.text)).is(wanted));
    has("sensels") && has("columns") && (has("rows") || has("units"))
}

/// Returns the separator of a line with a key.
fn separator(line: &str) -> char {
    line.chars().find(|c| matches!(c, ',' | ';' | '\t')).unwrap_or(',')
}

/// The first field of a line, and the next field that is not empty.
struct Entry<'t> {
    key: Piece<'t>,
    value: Piece<'t>,
}

impl<'t> Entry<'t> {
    fn of(line: Piece<'t>, separator: char) -> Self {
        let mut fields = Fields::new(line, separator);
        let key = fields.next().unwrap_or(line);
        let key = key.part(key.text.trim_end_matches(':').trim_end());
        let value =
            fields.find(|field| !field.text.is_empty()).unwrap_or_else(|| line.part(&line.text[line.text.len()..]));
        Self { key, value }
    }

    fn is(&self, key: &str) -> bool {
        self.key.text.eq_ignore_ascii_case(key)
    }

    /// Returns the unit in brackets after the key, as in `Sensel Width (cm)`.
    fn unit_after(&self, key: &str) -> Option<&'t str> {
        let rest = self.key.after(key)?.text.trim();
        Some(rest.trim_start_matches('(').trim_end_matches(')'))
    }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let pad = choose(text, hints)?;
    let mut reader = Reader {
        lines: Lines::new(text),
        pad,
        reel: Reel::default(),
        unit: None,
        threshold: None,
        size: None,
        pitch: [None; 2],
        frame: None,
        part: Part::Pad,
        has_times: true,
        day: 0,
    };
    reader.read()?;
    let Reader { mut reel, lines, unit, threshold, size, pitch, .. } = reader;
    let Some([rows, cols]) = size.filter(|_| !reel.frames.is_empty()) else {
        return flaw(&lines.end(), "the file has no frame").map_err(Wrong::from);
    };
    hints.size(Some([rows, cols]))?;
    let (unit, factor) = unit.unzip();
    let pitch = pitch[0].zip(pitch[1]).map(|(x, y)| [x, y]);
    // Stamps of whole seconds are too coarse for the times of the frames.
    let has_times = reel.frames.is_sorted_by(|a, b| a.time < b.time);
    let (unit, pitch, period) = hints.complete(unit, pitch, reel.mean_step().filter(|_| has_times))?;
    if has_times {
        reel.start_at_zero();
    } else {
        reel.tick(period);
    }
    let threshold = threshold.map(|threshold| threshold * factor.unwrap_or(1.0));
    let shape = ImageShape { rows, cols, pitch, unit };
    let Reel { frames, cells, dead } = reel;
    Ok(Recording { format: FORMAT.name, shape, frames, cells, dead, threshold, period, force: None })
}

/// Returns the pad that the bench selects, or the only pad of the first frame; `None` if the file does not name it.
fn choose<'t>(text: &'t str, hints: &Hints) -> Result<Option<&'t str>, Refusal> {
    let mut frames = 0;
    let mut names: Vec<&str> = Vec::new();
    for line in Lines::new(text) {
        let entry = Entry::of(line, separator(line.text));
        frames += usize::from(entry.is("frame"));
        if frames > 1 || names.len() == MAX_LISTED {
            break;
        }
        if entry.is("sensor") && !names.contains(&entry.value.text) {
            names.push(entry.value.text);
        }
    }
    let list = || names.iter().map(|name| format!("`{}`", shortened(name))).collect::<Vec<_>>().join(", ");
    match (&hints.pad, &*names) {
        (None, []) => Ok(None),
        (None, [only]) => Ok(Some(only)),
        (None, _) => Err(Refusal::Silent {
            message: format!("the file has {} pads: {}", names.len(), list()),
            help: format!("select one in the bench's device, as `pad = \"{}\"`", shortened(names[0])),
        }),
        (Some(wanted), names) => match names.iter().find(|name| *name == wanted) {
            Some(name) => Ok(Some(name)),
            None if names.is_empty() => {
                Err(Refusal::Contradicted { hint: "pad", message: "the file has no names of pads".into() })
            }
            None => Err(Refusal::Contradicted { hint: "pad", message: format!("the file has the pads {}", list()) }),
        },
    }
}

/// The part of a frame that the lines describe.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// The selected pad, or the whole frame.
    Pad,
    /// Another pad, or a group of sensels.
    Other,
}

struct Reader<'t> {
    lines: Lines<'t>,
    /// The selected pad.
    pad: Option<&'t str>,
    reel: Reel,
    unit: Option<(Unit, f64)>,
    threshold: Option<f64>,
    size: Option<[usize; 2]>,
    pitch: [Option<f64>; 2],
    /// The frame that is being read.
    frame: Option<Begun<'t>>,
    part: Part,
    /// Whether the frames have times.
    has_times: bool,
    /// Time of the midnights since the first frame [ns].
    day: i64,
}

/// A frame that is not complete.
#[derive(Clone, Copy)]
struct Begun<'t> {
    number: u64,
    at: Piece<'t>,
    time: Option<i64>,
    has_cells: bool,
}

impl<'t> Reader<'t> {
    fn read(&mut self) -> Result<(), Flaw> {
        let mut sides = [None; 2];
        while let Some(line) = self.lines.next() {
            let entry = Entry::of(line, separator(line.text));
            match () {
                () if entry.key.text.is_empty() => {}
                () if entry.is("frame") => self.begin(entry.value)?,
                () if entry.is("sensor") => {
                    let is_played = self.pad.is_none_or(|pad| pad == entry.value.text);
                    self.part = if is_played { Part::Pad } else { Part::Other };
                }
                () if entry.is("group") => self.part = Part::Other,
                () if self.part == Part::Other => {}
                () if entry.is("rows") => sides[0] = Some(side(&entry)?),
                () if entry.is("columns") => sides[1] = Some(side(&entry)?),
                () if entry.is("sensels") => self.sensels(sides, entry.key)?,
                () => self.figure(&entry)?,
            }
        }
        self.end(self.lines.end())
    }

    /// Reads a property of the file, of a frame or of a pad.
    fn figure(&mut self, entry: &Entry<'t>) -> Result<(), Flaw> {
        let value = entry.value;
        if entry.is("units") {
            let known = units::unit(value.text).ok_or(());
            let known = known.or_else(|()| flaw(&value, format!("the unit `{}` is unknown", shortened(value.text))))?;
            if self.unit.is_some_and(|unit| unit != known) {
                return flaw(&value, "the unit changes");
            }
            self.unit = Some(known);
        } else if entry.is("threshold") {
            self.threshold = value.decimal("`Threshold`").ok();
        } else if ["time", "timestamp", "frame timestamp", "time (s)"].iter().any(|key| entry.is(key)) {
            self.stamp(value)?;
        } else if let Some(unit) = entry.unit_after("sensel width") {
            self.pitch[0] = Some(length(entry, unit, self.pitch[0])?);
        } else if let Some(unit) = entry.unit_after("sensel height") {
            self.pitch[1] = Some(length(entry, unit, self.pitch[1])?);
        } else if entry.key.text.parse::<f64>().is_ok() {
            return flaw(&entry.key, "unexpected row of cells: the frame is complete, or `SENSELS` is missing");
        }
        Ok(())
    }

    /// Starts the next frame.
    fn begin(&mut self, at: Piece<'t>) -> Result<(), Flaw> {
        self.end(at)?;
        let number = at.count("the frame's number")?;
        if let Some(last) = self.reel.frames.last()
            && last.number >= number
        {
            return flaw(&at, format!("frame {number} comes after frame {}", last.number));
        }
        self.frame = Some(Begun { number, at, time: None, has_cells: false });
        self.part = Part::Pad;
        Ok(())
    }

    /// Ends the current frame, if there is one.
    fn end(&mut self, at: Piece<'t>) -> Result<(), Flaw> {
        let Some(Begun { number, at: begin, time, has_cells }) = self.frame.take() else { return Ok(()) };
        let Some([rows, cols]) = self.size.filter(|_| has_cells) else {
            let of = self.pad.map_or_else(String::new, |pad| format!(" of `{}`", shortened(pad)));
            return flaw(&at, format!("frame {number} ends without the `SENSELS`{of}"));
        };
        if !self.reel.frames.is_empty() && self.has_times != time.is_some() {
            return flaw(&begin, "some frames have a `Time` and some do not");
        }
        self.has_times = time.is_some();
        self.reel.frame(number, time.unwrap_or(0), rows, cols);
        Ok(())
    }

    /// Sets the time of a frame, which keeps counting after midnight.
    fn stamp(&mut self, value: Piece<'t>) -> Result<(), Flaw> {
        let Some(frame) = &mut self.frame else { return Ok(()) };
        let mut time = time_of_day(value)? + self.day;
        if let Some(last) = self.reel.frames.last()
            && last.time > time
        {
            if last.time - time < DAY_NS / 2 || self.day >= MAX_LENGTH_NS {
                return flaw(&value, "the time goes back");
            }
            self.day += DAY_NS;
            time += DAY_NS;
        }
        frame.time = Some(time);
        Ok(())
    }

    /// Reads the rows of cells.
    fn sensels(&mut self, sides: [Option<usize>; 2], at: Piece<'t>) -> Result<(), Flaw> {
        let [Some(rows), Some(cols)] = sides else {
            return flaw(&at, "`SENSELS` comes before its `Rows` and `Columns`");
        };
        if self.size.is_some_and(|size| size != [rows, cols]) {
            return flaw(&at, format!("the size of the pad changes to {rows} rows by {cols} columns"));
        }
        bounded(rows, cols).or_else(|message| flaw(&at, message))?;
        self.size = Some([rows, cols]);
        let factor = self.unit.map_or(1.0, |(_, factor)| factor);
        match &mut self.frame {
            None => return flaw(&at, "`SENSELS` comes before its `FRAME`"),
            Some(frame) if frame.has_cells => {
                return flaw(&at, format!("frame {} has two blocks of cells", frame.number));
            }
            Some(frame) => frame.has_cells = true,
        }
        for row in 0..rows {
            self.row(row, cols, factor)?;
        }
        Ok(())
    }

    fn row(&mut self, row: usize, cols: usize, factor: f64) -> Result<(), Flaw> {
        let is_blank = |line: &Piece<'_>| line.text.trim_matches([',', ';', '\t', ' ']).is_empty();
        let line = self.lines.by_ref().find(|line| !is_blank(line)).unwrap_or_else(|| self.lines.end());
        let mut fields = Fields::new(line, separator_of_cells(line.text));
        for col in 0..cols {
            let cell = fields.next().filter(|cell| !cell.text.is_empty());
            let Some(cell) = cell else {
                return flaw(&line, format!("row {} has {col} cells, but `Columns` is {cols}", row + 1));
            };
            let value = cell.decimal("this cell")? * factor;
            self.reel.cell(row * cols + col, value).or_else(|message| flaw(&cell, message))?;
        }
        match fields.find(|field| !field.text.is_empty()) {
            Some(field) => flaw(&field, format!("row {} has more than {cols} cells", row + 1)),
            None => Ok(()),
        }
    }
}

/// Returns the separator of a row of cells: the one next to a quote, or else a tab, `;` or `,`.
fn separator_of_cells(line: &str) -> char {
    let mut pieces = line.split('"');
    let (before, after) = (pieces.next().unwrap_or(""), pieces.nth(1).unwrap_or(""));
    let mut beside = [after.trim_start().chars().next(), before.trim_end().chars().next_back()].into_iter().flatten();
    let any = || ['\t', ';', ','].into_iter().find(|c| line.contains(*c)).unwrap_or(',');
    let is_quoted = line.contains('"');
    beside.find(|c| is_quoted && matches!(c, '\t' | ';' | ',')).unwrap_or_else(any)
}

fn side(entry: &Entry<'_>) -> Result<usize, Flaw> {
    let what = format!("`{}`", shortened(entry.key.text));
    match usize::try_from(entry.value.count(&what)?) {
        Ok(side @ 1..) => Ok(side),
        _ => flaw(&entry.value, format!("{what} must be at least 1")),
    }
}

/// Parses a length [m], which must be the same in the whole file.
fn length(entry: &Entry<'_>, unit: &str, before: Option<f64>) -> Result<f64, Flaw> {
    let what = format!("`{}`", shortened(entry.key.text));
    let number = entry.value.decimal(&what)?;
    let Some(metres) = units::metres(unit) else {
        return flaw(&entry.key, format!("the unit of {what} is unknown"));
    };
    match number * metres {
        length if length <= 0.0 => flaw(&entry.value, format!("{what} must be greater than 0")),
        length if before.is_some_and(|before| before != length) => flaw(&entry.value, format!("{what} changes")),
        length => Ok(length),
    }
}

/// Parses `08:21:17.982`, `8:21:17 PM` or plain seconds, and returns nanoseconds.
fn time_of_day(value: Piece<'_>) -> Result<i64, Flaw> {
    let lower = value.text.to_ascii_lowercase();
    let (clock, noon) = match (lower.strip_suffix("pm"), lower.strip_suffix("am")) {
        (Some(clock), _) => (clock, Some(12)),
        (_, Some(clock)) => (clock, Some(0)),
        _ => (&*lower, None),
    };
    let parts: Vec<&str> = clock.split(':').map(str::trim).take(4).collect();
    let seconds = |text: &str| text.replacen(',', ".", 1).parse::<f64>().ok().filter(|s| (0.0..1e9).contains(s));
    let count = |text: &str, below: i64| text.parse::<i64>().ok().filter(|count| (0..below).contains(count));
    let whole = match *parts {
        [text] if noon.is_none() => seconds(text).map(|seconds| (0, seconds)),
        [hours, minutes, text] => count(hours, 24)
            .zip(count(minutes, 60))
            .zip(seconds(text).filter(|s| *s < 61.0))
            .map(|((hours, minutes), seconds)| {
                let hours = noon.map_or(hours, |noon| hours % 12 + noon);
                (60 * (60 * hours + minutes), seconds)
            }),
        _ => None,
    };
    match whole {
        Some((whole, seconds)) => Ok(whole * 1_000_000_000 + (seconds * 1e9).round() as i64),
        None => flaw(&value, format!("expected a time as `08:21:17.982`, found `{}`", shortened(value.text))),
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Base;

    use super::super::read;
    use super::super::testing::{check_damages, complaints, count_refused};
    use super::*;

    /// As a spreadsheet saves the export of the insoles: a pair, and a group of sensels.
    const PAIR: &str = "File:,C:\\foot.XSN,,\n,,,\nUnits:,mmHg,,\n,,,\nThreshold:,51.72,,\n,,,\nFRAME,1464,,\n,,,\n\
        Date, 2022 Aug 16,,\nTime, 08:21:17.982,,\n,,,\nSENSOR,LF S0073,,\nRows,2,,\nColumns,3,,\nSensel Width (cm),0.86,,\n\
        Sensel Height (cm),0.85,,\nPeak Pressure (mmHg),300,,\n,,,\nSENSELS,,,\n,,,\n0,100.5,0,\n,,,\n0,200,300,\n,,,\n\
        SENSOR,RF S0073,,\nRows,2,,\nColumns,3,,\nSensel Width (cm),0.86,,\nSensel Height (cm),0.85,,\nSENSELS,,,\n\
        0,1,2,\n3,4,5,\nGROUP,1,,\nName,Left Heel,,\nCells,4,,\nSENSELS,,,\n0,100.5,0,0\n,,,\n\
        FRAME,1466,,\nTime, 08:21:18.008,,\nSENSOR,LF S0073,,\nRows,2,,\nColumns,3,,\nSensel Width (cm),0.86,,\n\
        Sensel Height (cm),0.85,,\nSENSELS,,,\n0,0,0,\n0,0,7.5,\nSENSOR,RF S0073,,\nRows,2,,\nColumns,3,,\nSENSELS,,,\n\
        6,7,8,\n9,10,11,\n";

    /// As the software writes it where a comma is the point.
    const MAT: &str = "File:,\"mat.xsn\"\nUnits:,\"N/cm2\"\nThreshold:,\"0,1\"\n\nFrame:,\"1\"\nDate:,\"2020-03-03\"\n\
        Time:,\"23:59:59,950\"\nSensor:,\"PX100\"\nRows:,\"2\"\nColumns:,\"2\"\nCOP Row:,\"1,2\"\nSensel Width (cm):,\"1,27\"\n\
        Sensel Height (cm):,\"1,27\"\nSensels:\n\"0,35\",\"0,45\"\n\"1\",\"0,25\"\n\nFrame:,\"2\"\nTime:,\"00:00:00,000\"\n\
        Sensor:,\"PX100\"\nRows:,\"2\"\nColumns:,\"2\"\nSensels:\n\"0\",\"0\"\n\"0,5\",\"0\"\n";

    fn left() -> Hints {
        Hints { pad: Some("LF S0073".into()), ..Hints::default() }
    }

    #[test]
    fn one_of_a_pair_is_read_as_the_bench_says() {
        let recording = read(PAIR.as_bytes(), "x.csv", &left()).unwrap();
        let ImageShape { rows, cols, pitch, unit } = recording.shape;
        assert_eq!((recording.format, rows, cols, unit), ("xsensor", 2, 3, Unit::of(Base::Kilopascal)));
        assert!((pitch[0] - 0.0086).abs() < 1e-12 && (pitch[1] - 0.0085).abs() < 1e-12);
        let mercury = recording.cells.iter().map(|kpa| (f64::from(*kpa) / 0.133_322_387 * 10.0).round() / 10.0);
        assert_eq!(mercury.collect::<Vec<_>>(), [0.0, 100.5, 0.0, 0.0, 200.0, 300.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.5]);
        assert!((recording.threshold.unwrap() - 51.72 * 0.133_322_387).abs() < 1e-6);
        assert_eq!((recording.frames[1].number, recording.frames[1].time), (1466, 26_000_000));
        let hints = Hints { pad: Some("RF S0073".into()), ..Hints::default() };
        let right = read(PAIR.as_bytes(), "x.csv", &hints).unwrap();
        assert!((right.cells[11] / 0.133_322_39 - 11.0).abs() < 1e-5);
    }

    #[test]
    fn none_of_a_pair_is_taken_silently() {
        let got = complaints(read(PAIR.as_bytes(), "x.csv", &Hints::default()));
        assert_eq!(got, [(0, "the file has 2 pads: `LF S0073`, `RF S0073`".into())]);
        let hints = Hints { pad: Some("PX100".into()), ..Hints::default() };
        let got = complaints(read(PAIR.as_bytes(), "x.csv", &hints));
        assert_eq!(got, [(0, "the file has the pads `LF S0073`, `RF S0073`".into())]);
    }

    #[test]
    fn quotes_decimal_commas_and_midnight_are_read() {
        let recording = read(MAT.as_bytes(), "", &Hints::default()).unwrap();
        assert_eq!(recording.cells, [3.5, 4.5, 10.0, 2.5, 0.0, 0.0, 5.0, 0.0]);
        assert_eq!((recording.frames[1].time, recording.period), (50_000_000, 0.05));
        assert_eq!(recording.threshold, Some(1.0));
        let semicolons = MAT.replace("\",\"", "\";\"").replace(":,", ":;");
        assert_eq!(read(semicolons.as_bytes(), "", &Hints::default()), Ok(recording.clone()));
        let plain = MAT.replace("\",\"", "\t").replace('"', "").replace(":,", ":\t");
        assert_eq!(read(plain.as_bytes(), "", &Hints::default()), Ok(recording.clone()));
        let nameless = MAT.replace("Sensor:,\"PX100\"\n", "").replace("23:59:59,950", "11:59:59.950 PM");
        assert_eq!(read(nameless.as_bytes(), "", &Hints::default()), Ok(recording));
    }

    #[test]
    fn midnights_without_end_are_no_time() {
        let mut text = MAT.split_once("\nFrame:").unwrap().0.to_owned();
        for i in 1..1000 {
            let time = ["12:00:00", "00:00:00"][i % 2];
            text += &format!(
                "\nFrame:,{i}\nTime:,{time}\nSensor:,PX100\nRows:,2\nColumns:,2\nSensels:\n\"0\",\"0\"\n\"0\",\"0\"\n"
            );
        }
        assert_eq!(complaints(read(text.as_bytes(), "", &Hints::default()))[0].1, "the time goes back");
    }

    #[test]
    fn stamps_that_stand_still_need_a_rate() {
        let still = MAT.replace("00:00:00,000", "23:59:59,950");
        let got = complaints(read(still.as_bytes(), "", &Hints::default()));
        assert_eq!(got, [(0, "the file does not give its frame rate".into())]);
        let hints = Hints { rate_hz: Some(50.0), ..Hints::default() };
        assert_eq!(read(still.as_bytes(), "", &hints).unwrap().frames[1].time, 20_000_000);
    }

    #[test]
    fn a_mistake_has_its_line_and_message() {
        let cases = [
            ("mmHg,,\n,", "stones,,\n,", 3, "the unit `stones` is unknown"),
            ("FRAME,1466", "FRAME,1464", 39, "frame 1464 comes after frame 1464"),
            ("Rows,2", "Rows,0", 13, "`Rows` must be at least 1"),
            ("Columns,3", "Columns,4", 21, "row 1 has 3 cells, but `Columns` is 4"),
            ("Columns,3", "Columns,2", 21, "row 1 has more than 2 cells"),
            ("Rows,2", "Rows,1", 23, "unexpected row of cells: the frame is complete, or `SENSELS` is missing"),
            ("Rows,2", "Rows,999999", 19, "an array of 999999 by 3 has more than 262144 cells"),
            ("(cm),0.86", "(ft),0.86", 15, "the unit of `Sensel Width (ft)` is unknown"),
            ("100.5,0,\n", "x,0,\n", 21, "this cell is not a number: `x`"),
            ("SENSELS,,,\n0,0,0,\n0,0,7.5,\n", "", 51, "frame 1466 ends without the `SENSELS` of `LF S0073`"),
            ("08:21:18.008", "08:21:16.008", 40, "the time goes back"),
            ("08:21:18.008", "later", 40, "expected a time as `08:21:17.982`, found `later`"),
            ("Time, 08:21:18.008,,\n", "", 39, "some frames have a `Time` and some do not"),
        ];
        check_damages(PAIR, "", &left(), &cases);
    }

    #[test]
    fn a_damaged_file_is_refused_or_gives_a_sound_recording() {
        for (good, hints) in [(PAIR, left()), (MAT, Hints::default())] {
            let refused = count_refused(&[good.as_bytes()], "", &hints, 1000);
            assert!((300..1000).contains(&refused), "{refused}");
        }
    }
}
