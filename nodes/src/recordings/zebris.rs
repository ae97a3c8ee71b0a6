//! `zebris`: the raw data of a Zebris plate or treadmill as text (`RawDataGaitAnalysis`).
//!
//! A file has a header with a table of forces, `Platform {` with the size, the cells' width and height and their unit,
//! and then frames: `Frame 1 {`, `Time, ms`, a line of column names `x1`, `x2`, …, a line `y1`, `y2`, … of cells for
//! each row, `}`. x runs along the plate, so a row is a line along it. Pressures become kPa. The table's forces of the
//! left and the right foot are sums of these cells, not a separate measurement.

use std::fmt::Display;

use crate::recordings::common::reel::{Properties, Reel, bounded};
use crate::recordings::common::text::{Lines, Notation, Piece, shortened};
use crate::recordings::common::{FileFormat, FileHead, Hints, Recording, Refusal, TextError, Window, units};

pub(super) const FORMAT: FileFormat =
    FileFormat::text("zebris", "Zebris raw data of a plate or treadmill as text", recognises, parse);

/// Maximum number of mistakes in a header that are reported.
const MAX_REPORTED: usize = 20;

/// Keys in lower case, in English and in German.
const PLATFORM: &[&str] = &["platform {", "plattform {", "platform{", "plattform{"];
const COLUMNS: &[&str] = &["columns", "spalten"];
const LINES: &[&str] = &["lines", "rows", "zeilen"];
const WIDTH: &[&str] = &["cell width", "zellenbreite", "zellbreite"];
const HEIGHT: &[&str] = &["cell height", "zellenhöhe", "zellhöhe"];
const UNITS: &[&str] = &["units", "unit", "einheiten", "einheit"];
const COUNT: &[&str] = &["frame count", "frames"];
const FREQUENCY: &[&str] = &["frequency", "frequenz"];
const TIME: &[&str] = &["time", "zeit"];

fn recognises(head: &FileHead<'_>) -> bool {
    // The table of forces comes first, and may fill all of the head.
    let has = |words: &[&str]| Lines::new(&head.text).any(|line| is_one_of(line.text.trim(), words));
    has(PLATFORM) || has(&["exercises\t{", "exercises {"]) && head.text.to_lowercase().contains("butterfly.")
}

fn is_one_of(text: &str, names: &[&str]) -> bool {
    text.len() < 64 && names.contains(&&*text.to_lowercase())
}

/// A property with its unit, as `Cell width,mm   8.47`.
struct Property<'t> {
    name: Piece<'t>,
    unit: &'t str,
    value: Piece<'t>,
}

fn property(line: Piece<'_>) -> Property<'_> {
    let split = line.text.split_once(['\t', ';']).or_else(|| line.text.rsplit_once(','));
    let (key, value) = split.unwrap_or((line.text, &line.text[line.text.len()..]));
    let (name, unit) = key.split_once(',').unwrap_or((key, ""));
    Property { name: line.part(name).trimmed(), unit: unit.trim(), value: line.part(value).trimmed() }
}

/// Properties of the plate.
#[derive(Default)]
struct Platform<'t> {
    cols: Option<usize>,
    rows: Option<(usize, Piece<'t>)>,
    width: Option<f64>,
    height: Option<f64>,
    count: Option<(u64, Piece<'t>)>,
    /// Unit, and time between two frames.
    found: Properties,
}

impl<'t> Platform<'t> {
    fn read(&mut self, line: Piece<'t>) -> Result<(), TextError> {
        let Property { name, unit, value } = property(line);
        let is = |names| is_one_of(name.text, names);
        let what = format!("`{}`", shortened(name.text));
        let length = || {
            let unknown = || line.error(format!("the unit of {what} is unknown:  `{}`", shortened(unit)));
            Ok::<f64, TextError>(value.positive(&what)? * units::metres(unit).ok_or_else(unknown)?)
        };
        match () {
            () if is(COLUMNS) => self.cols = Some(value.side(&what)?),
            () if is(LINES) => self.rows = Some((value.side(&what)?, value)),
            () if is(WIDTH) => self.width = Some(length()?),
            () if is(HEIGHT) => self.height = Some(length()?),
            () if is(COUNT) => self.count = Some((value.count(&what)?, value)),
            () if is(FREQUENCY) => self.found.period = Some(value.positive(&what)?.recip()),
            () if is(UNITS) => self.found.unit = Some(units::parse(value)?),
            () => {}
        }
        Ok(())
    }

    /// Returns the number of rows and of columns.
    fn size(&self, end: Piece<'_>) -> Result<[usize; 2], TextError> {
        let (rows, at) = self.rows.ok_or_else(|| end.error("`Lines` is missing in `Platform`"))?;
        let cols = self.cols.ok_or_else(|| end.error("`Columns` is missing in `Platform`"))?;
        bounded(rows, cols).map_err(|message| at.error(message))?;
        Ok([rows, cols])
    }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let mut lines = Lines::new(text);
    let (platform, first) = platform(&mut lines)?;
    let size = platform.size(first)?;
    let pitch = platform.width.zip(platform.height).map(<[f64; 2]>::from);
    let found = Properties { size: Some(size), pitch, ..platform.found };
    let mut reader = ZebrisReader { reel: Reel::default(), size, factor: found.factor(), lines };
    let mut next = Some(first);
    while let Some(line) = next {
        reader.frame(line)?;
        next = reader.next_frame()?;
    }
    let ZebrisReader { reel, lines, .. } = reader;
    let frames = reel.frames.len() as u64;
    if let Some((count, at)) = platform.count {
        let at = if frames < count { lines.end() } else { at };
        at.check(count == frames, format_args!("`Frame count` is {count}, but the file has {frames} frames"))?;
    }
    reel.finish(FORMAT.name, found, hints)
}

/// Reads the header up to the line of the first frame, which is returned too.
fn platform<'t>(lines: &mut Lines<'t>) -> Result<(Platform<'t>, Piece<'t>), Refusal> {
    let is_begun = lines.any(|line| is_one_of(line.text.trim(), PLATFORM));
    lines.end().check(is_begun, "the file ends without `Platform {`")?;
    let mut platform = Platform::default();
    let mut flaws = Vec::new();
    for line in lines.by_ref().map(Piece::trimmed) {
        if frame_number(line).is_some() {
            return if flaws.is_empty() { Ok((platform, line)) } else { Err(flaws.into()) };
        }
        let flaw = platform.read(line).err();
        flaws.extend(flaw.filter(|_| flaws.len() < MAX_REPORTED));
    }
    flaws.push(lines.end().error("the file ends without a frame"));
    Err(flaws.into())
}

/// Returns the number in `Frame 12 {`, or `None` for another line.
fn frame_number(line: Piece<'_>) -> Option<Piece<'_>> {
    let rest = line.after("frame ").or_else(|| line.after("bild "))?;
    rest.text.strip_suffix('{').map(|number| rest.part(number).trimmed())
}

struct ZebrisReader<'t> {
    reel: Reel,
    /// Rows and columns.
    size: [usize; 2],
    /// Factor from the file's unit to that of the cells.
    factor: f64,
    lines: Lines<'t>,
}

impl<'t> ZebrisReader<'t> {
    /// Reads the frame with the first line `line`, up to its `}`.
    fn frame(&mut self, line: Piece<'t>) -> Result<(), TextError> {
        let at = frame_number(line).expect("the caller has checked the line");
        let number = at.count("the frame's number")?;
        self.reel.follows(number, at)?;
        let time = self.head(number)?;
        let [rows, cols] = self.size;
        for row in 1..=rows {
            self.row(number, row)?;
        }
        let end = self.lines.next_filled();
        end.check(end.text == "}", format_args!("expected `}}` after the {rows} rows of frame {number}"))?;
        self.reel.frame(number, Some(time), Window::whole(rows, cols));
        Ok(())
    }

    /// Reads the lines before the rows, up to the names of the columns, and returns the time [ns].
    fn head(&mut self, frame: u64) -> Result<i64, TextError> {
        let [_, cols] = self.size;
        let mut time = None;
        loop {
            let line = self.lines.next_filled();
            let names = line.text.split(|c: char| c.is_whitespace() || c == ';' || c == ',');
            let mut names = names.filter(|name| !name.is_empty()).peekable();
            if names.peek().is_some_and(|name| name.eq_ignore_ascii_case("x1")) {
                let found = names.count();
                let message = format_args!("frame {frame} has {found} names of columns, but `Columns` is {cols}");
                line.check(found == cols, message)?;
                let (time, at) = time.ok_or_else(|| line.error(format!("frame {frame} has no `Time`")))?;
                return self.reel.time(time, at);
            }
            let is_end = line.text.is_empty() || line.text == "}";
            let is_late = is_end || line.after("y1").is_some() || frame_number(line).is_some();
            line.check(!is_late, format_args!("frame {frame} ends without its columns"))?;
            let Property { name, unit, value } = property(line);
            if is_one_of(name.text, TIME) {
                let is_second = ["s", "sec"].iter().any(|second| unit.eq_ignore_ascii_case(second));
                let number = value.decimal("the frame's time")?;
                time = Some((number * if is_second { 1e9 } else { 1e6 }, value));
            }
        }
    }

    /// Reads a row of cells; `row` counts from 1.
    fn row(&mut self, frame: u64, row: usize) -> Result<(), TextError> {
        let [_, cols] = self.size;
        let line = self.lines.next_filled();
        let notation = Notation::of(line.text);
        let mut fields = notation.fields(line);
        let is_row =
            |name: Piece<'_>| name.text.strip_prefix(['y', 'Y']).is_some_and(|number| number.parse() == Ok(row));
        line.check(fields.next().is_some_and(is_row), format_args!("expected row `y{row}` of frame {frame}"))?;
        let before = self.reel.cells.len();
        self.reel.row(fields.take(cols + 1), |cell| Ok(notation.number(cell, "this cell")? * self.factor))?;
        let found = self.reel.cells.len() - before;
        let count: &dyn Display = if found > cols { &"more" } else { &found };
        let message = format_args!("row `y{row}` of frame {frame} has {count} cells, but `Columns` is {cols}");
        line.check(found == cols, message)
    }

    /// Returns the line of the next frame, or `None` at the end of the file.
    fn next_frame(&mut self) -> Result<Option<Piece<'t>>, TextError> {
        loop {
            let line = self.lines.next_filled();
            if line.text.is_empty() || frame_number(line).is_some() {
                return Ok((!line.text.is_empty()).then_some(line));
            }
            line.check(line.text == "}", format_args!("expected a frame, found `{}`", shortened(line.text)))?;
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::{Base, ImageShape, Unit};

    use super::super::read;
    use super::super::testing::{check_damages, count_refused};
    use super::*;

    const GOOD: &str = "Person\tnor, mal
Record\t4 km/h barfuß
Exercises\t{
#\tName\tStart,sec\tLength,sec\tStart time
1\tGait\t0.00\t0.02
}

Frequency,Hz\t100.000
Count\t2

Time,ms\tPosition,m\tLi Kraft,N\tRe Kraft,N\tButterfly.force,N\tButterfly.x,mm\tButterfly.y,mm
Calibr\t\t\t\t

0\t0.011\t0.0\t0.0\t0.00\tNaN\tNaN
10\t0.022\t0.0\t0.0\t0.00\tNaN\tNaN


Platform {
Columns\t3
Lines\t2
Cell width,mm\t8.47
Cell height,mm\t8.46
Units\tN/cm^2
Frame count\t2
Frequency\t100.00

Frame 1 {
Exercise1
Time, ms\t0.00
Center of force\t(x2,y2)

\tx1\tx2\tx3
y1\t0.00\t0.50\t0.00
y2\t0.25\t34.50\t0.00
}
Frame 2 {
Exercise1
Time, ms\t10.00
Center of force\t(x2,y1)

\tx1\tx2\tx3
y1\t0.00\t1.50\t0.00
y2\t0.00\t0.00\t0.00
}
";

    #[test]
    fn a_treadmill_is_read_with_its_own_pitch_unit_and_times() {
        let recording = read(GOOD.as_bytes(), "RawDataGaitAnalysis.txt", &Hints::default()).unwrap();
        let ImageShape { rows, cols, pitch, unit } = recording.shape;
        assert_eq!((recording.format, rows, cols, unit), ("zebris", 2, 3, Unit::of(Base::Kilopascal)));
        assert!((pitch[0] - 0.00847).abs() < 1e-12 && (pitch[1] - 0.00846).abs() < 1e-12);
        assert_eq!(recording.cells, [0.0, 5.0, 0.0, 2.5, 345.0, 0.0, 0.0, 15.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!((recording.frames[1].number, recording.frames[1].time, recording.period), (2, 10_000_000, 0.01));
    }

    #[test]
    fn equivalent_notations_give_the_same_recording() {
        let good = read(GOOD.as_bytes(), "", &Hints::default()).unwrap();
        let latin = |text: &str| text.chars().map(|c| c as u8).collect::<Vec<u8>>();
        let wide = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
        let cases = [
            latin(GOOD),
            latin(&GOOD.replace('\t', ";")),
            latin(&GOOD.replace('\t', ";").replace("0.50", "0,50").replace("34.50", "34,50")),
            latin(&GOOD.replace('\t', ",")),
            latin(&GOOD.replace('\t', "\t ").to_uppercase().replace("MM", "mm").replace("TIME, MS", "Time, ms")),
            latin(&GOOD.replace('\n', "\r\n")),
            wide(GOOD),
            latin(&GOOD.replace("0.00", "0,00").replace("0.50", "0,50").replace("8.47", "8,47")),
            latin(&GOOD.replace("Columns", "Spalten").replace("Lines", "Zeilen").replace("Platform", "Plattform")),
            latin(&GOOD.replace("Time, ms\t10.00", "Zeit,s\t0,01").replace("Units", "Einheit")),
            latin(&GOOD[GOOD.find("Platform").unwrap()..]),
            latin(&format!("{GOOD}}}\n\n")),
            latin(&GOOD.replace("Frame count\t2\n", "").replace("8.46", "8.46\nSerial\t12")),
        ];
        for bytes in cases {
            let text = String::from_utf8_lossy(&bytes).into_owned();
            assert_eq!(read(&bytes, "", &Hints::default()).as_ref(), Ok(&good), "{text}");
        }
    }

    #[test]
    fn a_mistake_has_its_line_and_message() {
        let cases = [
            ("Lines\t2", "Lines\t0", 20, "`Lines` must be at least 1"),
            ("Lines\t2", "Lines\t99999", 20, "an array of 99999 by 3 has more than 262144 cells"),
            ("Columns\t3\n", "", 26, "`Columns` is missing in `Platform`"),
            ("8.47", "-1", 21, "`Cell width` must be greater than 0"),
            ("width,mm", "width,ells", 21, "the unit of `Cell width` is unknown:  `ells`"),
            ("N/cm^2", "stone", 23, "the unit `stone` is unknown"),
            ("Frame count\t2", "Frame count\t3", 44, "`Frame count` is 3, but the file has 2 frames"),
            ("Frame count\t2", "Frame count\t1", 24, "`Frame count` is 1, but the file has 2 frames"),
            ("Frame 2", "Frame 4", 36, "frame 4 comes after frame 1"),
            ("Time, ms\t10.00\n", "", 40, "frame 2 has no `Time`"),
            ("Time, ms\t0.00", "Time, ms\t20.00", 38, "the time goes back"),
            ("x1\tx2\tx3", "x1\tx2", 32, "frame 1 has 2 names of columns, but `Columns` is 3"),
            ("y2\t0.25\t34.50\t0.00\n", "", 34, "expected row `y2` of frame 1"),
            ("34.50\t0.00", "34.50", 34, "row `y2` of frame 1 has 2 cells, but `Columns` is 3"),
            ("34.50", "34.50\t1", 34, "row `y2` of frame 1 has more cells, but `Columns` is 3"),
            ("34.50", "NaN", 34, "this cell is not finite: `NaN`"),
            ("}\nFrame 2", "y3\nFrame 2", 35, "expected `}` after the 2 rows of frame 1"),
            ("}\nFrame 2", "}\nFrames\nFrame 2", 36, "expected a frame, found `Frames`"),
            (
                "y1\t0.00\t1.50\t0.00\ny2\t0.00\t0.00\t0.00\n}\n",
                "y1\t0.00",
                42,
                "row `y1` of frame 2 has 1 cells, but `Columns` is 3",
            ),
        ];
        check_damages(GOOD, "", &Hints::default(), &cases);
    }

    #[test]
    fn a_damaged_file_is_refused_or_gives_a_sound_recording() {
        let refused = count_refused(&[GOOD.as_bytes()], "", &Hints::default(), 2000);
        assert!((1000..2000).contains(&refused), "{refused}");
    }
}
