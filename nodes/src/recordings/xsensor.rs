//! `xsensor`: the CSV export of XSENSOR's software (X3, Pro, Foresight).
//!
//! A line has a key and a value, with a colon after the key in some versions: `Units` and `Threshold` at the top, then
//! for each frame `FRAME`, `Date`, `Time`, and for each pad `SENSOR`, `Rows`, `Columns`, `Sensel Width (cm)`, `Sensel
//! Height (cm)`, figures, and `SENSELS` with a line of cells for each row. Blank lines and lines of commas may be
//! anywhere. Numbers may be in quotes, with a decimal comma. Groups of sensels (`GROUP`) repeat parts of the pads and
//! are ignored. Pressures become kPa. Times are times of the day.
//!
//! A file may have several pads, as the two insoles of a pair: the bench selects one with `pad`. There is no default.

use tactflow_runtime::source::quoted;

use crate::recordings::common::fields::Fields;
use crate::recordings::common::reel::{Properties, Reel, bounded};
use crate::recordings::common::text::{Lines, Piece, shortened};
use crate::recordings::common::{FileFormat, FileHead, Hints, Recording, Refusal, TextError, Window, units};

pub(super) const FORMAT: FileFormat =
    FileFormat::text("xsensor", "the CSV export of XSENSOR's software", recognises, parse);

/// Length of a day [ns].
const DAY_NS: i64 = 86_400_000_000_000;
/// Maximum length of a recording [ns].
const MAX_LENGTH_NS: i64 = 400 * DAY_NS;

/// Maximum number of pads that a message lists.
const MAX_LISTED: usize = 32;

fn recognises(head: &FileHead<'_>) -> bool {
    let has = |wanted: &str| Lines::new(&head.text).any(|line| KeyLine::of(line).is(wanted));
    has("sensels") && has("columns") && (has("rows") || has("units"))
}

/// The first field of a line, and the next field that is not empty.
struct KeyLine<'t> {
    key: Piece<'t>,
    value: Piece<'t>,
}

impl<'t> KeyLine<'t> {
    fn of(line: Piece<'t>) -> Self {
        let separator = line.text.chars().find(|c| matches!(c, ',' | ';' | '\t')).unwrap_or(',');
        let mut fields = Fields::new(line, separator);
        let key = fields.next().unwrap_or(line);
        let key = key.part(key.text.trim_end_matches(':').trim_end());
        let value = fields.find(|field| !field.text.is_empty());
        Self { key, value: value.unwrap_or_else(|| line.part(&line.text[line.text.len()..])) }
    }

    fn is(&self, key: &str) -> bool {
        self.key.text.eq_ignore_ascii_case(key)
    }

    /// Returns the key as a message names it.
    fn title(&self) -> String {
        format!("`{}`", shortened(self.key.text))
    }

    /// Parses a length [m], with its unit in brackets after the key, as in `Sensel Width (cm)`. It must be the same in
    /// the whole file. Returns `None` for another key.
    fn length(&self, key: &str, before: Option<f64>) -> Result<Option<f64>, TextError> {
        let Some(unit) = self.key.after(key) else { return Ok(before) };
        let number = self.value.decimal(&self.title())?;
        let metres = units::metres(unit.text.trim().trim_start_matches('(').trim_end_matches(')'));
        let unknown = || self.key.error(format!("the unit of {} is unknown", self.title()));
        let length = number * metres.ok_or_else(unknown)?;
        self.value.check(length > 0.0, format_args!("{} must be greater than 0", self.title()))?;
        self.value.check(before.is_none_or(|before| before == length), format_args!("{} changes", self.title()))?;
        Ok(Some(length))
    }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let mut reader = XsensorReader { lines: Lines::new(text), pad: choose(text, hints)?, ..XsensorReader::default() };
    reader.read()?;
    let XsensorReader { mut reel, lines, mut found, pitch: [x, y], .. } = reader;
    lines.end().check(!reel.frames.is_empty(), "the file has no frame")?;
    // Stamps of whole seconds are too coarse for the times of the frames.
    reel.forget_equal_times();
    found.pitch = x.zip(y).map(<[f64; 2]>::from);
    found.threshold = found.threshold.map(|threshold| threshold * found.factor());
    reel.finish(FORMAT.name, found, hints)
}

/// Returns the pad that the bench selects, or the only pad of the first frame; `None` if the file does not name it.
fn choose<'t>(text: &'t str, hints: &Hints) -> Result<Option<&'t str>, Refusal> {
    let mut frames = 0;
    let mut names: Vec<&str> = Vec::new();
    for line in Lines::new(text).map(KeyLine::of) {
        frames += usize::from(line.is("frame"));
        if frames > 1 || names.len() == MAX_LISTED {
            break;
        }
        if line.is("sensor") && !names.contains(&line.value.text) {
            names.push(line.value.text);
        }
    }
    let list = || quoted(names.iter().map(|name| shortened(name)));
    let Some(wanted) = &hints.pad else {
        return match *names {
            [] => Ok(None),
            [only] => Ok(Some(only)),
            [first, ..] => Err(Refusal::Silent {
                message: format!("the file has {} pads: {}", names.len(), list()),
                help: format!(
                    "select one in the bench's device, as `pad = \"{0}\"` (`tactflow features`: add `--pad \"{0}\"`)",
                    shortened(first)
                ),
            }),
        };
    };
    let has_none = || Refusal::Contradicted {
        hint: "pad",
        message: if names.is_empty() {
            "the file does not name its pads: remove `pad`".into()
        } else {
            format!("the file has the pads {}", list())
        },
    };
    names.iter().find(|name| *name == wanted).map(|name| Some(*name)).ok_or_else(has_none)
}

#[derive(Default)]
struct XsensorReader<'t> {
    lines: Lines<'t>,
    /// The selected pad.
    pad: Option<&'t str>,
    reel: Reel,
    /// Size and unit; the threshold, still in the file's unit.
    found: Properties,
    /// Distance of two sensels along x and along y [m].
    pitch: [Option<f64>; 2],
    /// The frame that is being read.
    frame: Option<BegunFrame<'t>>,
    /// Whether the lines describe another pad, or a group of sensels.
    is_other: bool,
    /// Time of the midnights since the first frame [ns].
    day: i64,
}

/// A frame that is not complete.
#[derive(Clone, Copy)]
struct BegunFrame<'t> {
    number: u64,
    at: Piece<'t>,
    time: Option<i64>,
    has_cells: bool,
}

impl<'t> XsensorReader<'t> {
    fn read(&mut self) -> Result<(), TextError> {
        let mut sides = [None; 2];
        while let Some(line) = self.lines.next() {
            let line = KeyLine::of(line);
            match () {
                () if line.key.text.is_empty() => {}
                () if line.is("frame") => self.begin(line.value)?,
                () if line.is("sensor") => self.is_other = self.pad.is_some_and(|pad| pad != line.value.text),
                () if line.is("group") => self.is_other = true,
                () if self.is_other => {}
                () if line.is("rows") => sides[0] = Some(line.value.side(&line.title())?),
                () if line.is("columns") => sides[1] = Some(line.value.side(&line.title())?),
                () if line.is("sensels") => self.sensels(sides, line.key)?,
                () => self.property(&line)?,
            }
        }
        self.end(self.lines.end())
    }

    /// Reads a property of the file, of a frame or of a pad.
    fn property(&mut self, line: &KeyLine<'t>) -> Result<(), TextError> {
        let value = line.value;
        if line.is("units") {
            let unit = units::parse(value)?;
            value.check(self.found.unit.is_none_or(|before| before == unit), "the unit changes")?;
            self.found.unit = Some(unit);
        } else if line.is("threshold") {
            self.found.threshold = value.decimal("`Threshold`").ok();
        } else if ["time", "timestamp", "frame timestamp", "time (s)"].iter().any(|key| line.is(key)) {
            self.stamp(value)?;
        }
        let [x, y] = self.pitch;
        self.pitch = [line.length("sensel width", x)?, line.length("sensel height", y)?];
        let is_row = line.key.text.parse::<f64>().is_ok();
        line.key.check(!is_row, "unexpected row of cells: the frame is complete, or `SENSELS` is missing")
    }

    /// Starts the next frame.
    fn begin(&mut self, at: Piece<'t>) -> Result<(), TextError> {
        self.end(at)?;
        let number = at.count("the frame's number")?;
        if let Some(last) = self.reel.frames.last() {
            at.check(last.number < number, format_args!("frame {number} comes after frame {}", last.number))?;
        }
        self.frame = Some(BegunFrame { number, at, time: None, has_cells: false });
        self.is_other = false;
        Ok(())
    }

    /// Ends the current frame, if there is one.
    fn end(&mut self, at: Piece<'t>) -> Result<(), TextError> {
        let Some(BegunFrame { number, at: begin, time, has_cells }) = self.frame.take() else { return Ok(()) };
        let Some([rows, cols]) = self.found.size.filter(|_| has_cells) else {
            let of = self.pad.map_or_else(String::new, |pad| format!(" of `{}`", shortened(pad)));
            return Err(at.error(format!("frame {number} ends without the `SENSELS`{of}")));
        };
        begin.check(self.reel.is_timed_alike(time.is_some()), "some frames have a `Time` and some do not")?;
        self.reel.frame(number, time, Window::whole(rows, cols));
        Ok(())
    }

    /// Sets the time of a frame, which keeps counting after midnight.
    fn stamp(&mut self, value: Piece<'t>) -> Result<(), TextError> {
        let Some(frame) = &mut self.frame else { return Ok(()) };
        let mut time = time_of_day(value)? + self.day;
        if let Some(last) = self.reel.frames.last().filter(|last| last.time > time) {
            let is_midnight = last.time - time >= DAY_NS / 2 && self.day < MAX_LENGTH_NS;
            value.check(is_midnight, "the time goes back")?;
            self.day += DAY_NS;
            time += DAY_NS;
        }
        frame.time = Some(time);
        Ok(())
    }

    /// Reads the rows of cells.
    fn sensels(&mut self, sides: [Option<usize>; 2], at: Piece<'t>) -> Result<(), TextError> {
        let [Some(rows), Some(cols)] = sides else {
            return Err(at.error("`SENSELS` comes before its `Rows` and `Columns`"));
        };
        let is_same = self.found.size.is_none_or(|size| size == [rows, cols]);
        at.check(is_same, format_args!("the size of the pad changes to {rows} rows by {cols} columns"))?;
        bounded(rows, cols).map_err(|message| at.error(message))?;
        self.found.size = Some([rows, cols]);
        let frame = self.frame.as_mut().ok_or_else(|| at.error("`SENSELS` comes before its `FRAME`"))?;
        at.check(!frame.has_cells, format_args!("frame {} has two blocks of cells", frame.number))?;
        frame.has_cells = true;
        (1..=rows).try_for_each(|row| self.row(row, cols))
    }

    /// Reads a row of cells; `row` counts from 1.
    fn row(&mut self, row: usize, cols: usize) -> Result<(), TextError> {
        let is_blank = |line: &Piece<'_>| line.text.trim_matches([',', ';', '\t', ' ']).is_empty();
        let line = self.lines.by_ref().find(|line| !is_blank(line)).unwrap_or_else(|| self.lines.end());
        let mut fields = Fields::new(line, separator_of_cells(line.text));
        let factor = self.found.factor();
        let before = self.reel.cells.len();
        let cells = fields.by_ref().take(cols).take_while(|cell| !cell.text.is_empty());
        self.reel.row(cells, |cell| Ok(cell.decimal("this cell")? * factor))?;
        let found = self.reel.cells.len() - before;
        line.check(found == cols, format_args!("row {row} has {found} cells, but `Columns` is {cols}"))?;
        match fields.find(|field| !field.text.is_empty()) {
            Some(field) => Err(field.error(format!("row {row} has more than {cols} cells"))),
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

/// Parses `08:21:17.982`, `8:21:17 PM` or plain seconds, and returns nanoseconds.
fn time_of_day(value: Piece<'_>) -> Result<i64, TextError> {
    let unknown = || value.error(format!("expected a time as `08:21:17.982`, found `{}`", shortened(value.text)));
    let (whole, seconds) = clock(&value.text.to_ascii_lowercase()).ok_or_else(unknown)?;
    Ok(whole * 1_000_000_000 + (seconds * 1e9).round() as i64)
}

/// Returns the seconds of the hours and minutes, and the seconds after them.
fn clock(lower: &str) -> Option<(i64, f64)> {
    let halves = [("am", 0), ("pm", 12)];
    let half = halves.into_iter().find_map(|(half, noon)| Some((lower.strip_suffix(half)?, noon)));
    let parts: Vec<&str> = half.map_or(lower, |(clock, _)| clock).split(':').map(str::trim).take(4).collect();
    let seconds = |text: &str, below| text.replacen(',', ".", 1).parse().ok().filter(|s| (0.0..below).contains(s));
    let count = |text: &str, below| text.parse::<i64>().ok().filter(|count| (0..below).contains(count));
    match *parts {
        [text] if half.is_none() => Some((0, seconds(text, 1e9)?)),
        [hours, minutes, text] => {
            let (hours, minutes) = (count(hours, 24)?, count(minutes, 60)?);
            let hours = half.map_or(hours, |(_, noon)| hours % 12 + noon);
            Some((60 * (60 * hours + minutes), seconds(text, 61.0)?))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::{Base, ImageShape, Unit};

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
