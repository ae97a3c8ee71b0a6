//! `zebris`: the raw data of a Zebris plate or treadmill as text (`RawDataGaitAnalysis`).
//!
//! A file has a header with a table of forces, `Platform {` with the size, the cells' width and height and their unit,
//! and then frames: `Frame 1 {`, `Time, ms`, a line of column names `x1`, `x2`, …, a line `y1`, `y2`, … of cells for each
//! row, `}`. x runs along the plate, so a row is a line along it. Pressures become kPa. The table's forces of the left
//! and the right foot are sums of these cells, not a separate measurement.

use tactflow_runtime::signal::{ImageShape, Unit};

use crate::recordings::common::reel::{Reel, bounded};
use crate::recordings::common::text::{self, Lines, Notation, Piece, Wrong, flaw, shortened};
use crate::recordings::common::{Flaw, Format, Head, Hints, Recording, units};

pub(super) const FORMAT: Format = Format {
    name: "zebris",
    title: "Zebris raw data of a plate or treadmill as text",
    recognises,
    read: |bytes, hints| text::read(bytes, hints, parse),
};

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

fn recognises(head: &Head<'_>) -> bool {
    // The table of forces comes first, and may fill all of the head.
    let has = |words: &[&str]| Lines::new(&head.text).any(|line| is_one_of(line.text.trim(), words));
    has(PLATFORM) || has(&["exercises\t{", "exercises {"]) && head.text.to_lowercase().contains("butterfly.")
}

fn is_one_of(text: &str, names: &[&str]) -> bool {
    text.len() < 64 && names.contains(&&*text.to_lowercase())
}

/// A property with its unit, as `Cell width,mm   8.47`.
struct Entry<'t> {
    name: Piece<'t>,
    unit: &'t str,
    value: Piece<'t>,
}

fn entry(line: Piece<'_>) -> Entry<'_> {
    let split = line.text.split_once(['\t', ';']).or_else(|| line.text.rsplit_once(','));
    let (key, value) = split.unwrap_or((line.text, &line.text[line.text.len()..]));
    let (name, unit) = key.split_once(',').unwrap_or((key, ""));
    Entry { name: line.part(name).trimmed(), unit: unit.trim(), value: line.part(value).trimmed() }
}

/// Properties of the plate.
#[derive(Default)]
struct Platform<'t> {
    cols: Option<(usize, Piece<'t>)>,
    rows: Option<(usize, Piece<'t>)>,
    width: Option<f64>,
    height: Option<f64>,
    unit: Option<(Unit, f64)>,
    count: Option<(u64, Piece<'t>)>,
    rate: Option<f64>,
}

impl<'t> Platform<'t> {
    fn read(&mut self, line: Piece<'t>) -> Result<(), Flaw> {
        let Entry { name, unit, value } = entry(line);
        let is = |names| is_one_of(name.text, names);
        let what = format!("`{}`", shortened(name.text));
        let length = || {
            positive(value, &what).and_then(|number| match units::metres(unit) {
                Some(metres) => Ok(number * metres),
                None => flaw(&line, format!("the unit of {what} is unknown:  `{}`", shortened(unit))),
            })
        };
        let count = || match usize::try_from(value.count(&what)?) {
            Ok(count @ 1..) => Ok((count, value)),
            _ => flaw(&value, format!("{what} must be at least 1")),
        };
        match () {
            () if is(COLUMNS) => self.cols = Some(count()?),
            () if is(LINES) => self.rows = Some(count()?),
            () if is(WIDTH) => self.width = Some(length()?),
            () if is(HEIGHT) => self.height = Some(length()?),
            () if is(COUNT) => self.count = Some((value.count(&what)?, value)),
            () if is(FREQUENCY) => self.rate = Some(positive(value, &what)?),
            () if is(UNITS) => match units::unit(value.text) {
                Some(unit) => self.unit = Some(unit),
                None => return flaw(&value, format!("the unit `{}` is unknown", shortened(value.text))),
            },
            () => {}
        }
        Ok(())
    }

    /// Rows and columns.
    fn size(&self, end: Piece<'_>) -> Result<(usize, usize), Flaw> {
        let Some((rows, at)) = self.rows else { return flaw(&end, "`Lines` is missing in `Platform`") };
        let Some((cols, _)) = self.cols else { return flaw(&end, "`Columns` is missing in `Platform`") };
        bounded(rows, cols).or_else(|message| flaw(&at, message))?;
        Ok((rows, cols))
    }
}

fn positive(value: Piece<'_>, what: &str) -> Result<f64, Flaw> {
    let number = value.decimal(what)?;
    if number > 0.0 { Ok(number) } else { flaw(&value, format!("{what} must be greater than 0")) }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let mut lines = Lines::new(text);
    let (platform, first) = platform(&mut lines)?;
    let (rows, cols) = platform.size(first)?;
    let (unit, factor) = platform.unit.unzip();
    let reel = Reel::default();
    let mut reader = Reader { reel, rows, cols, factor: factor.unwrap_or(1.0), lines };
    let mut next = Some(first);
    while let Some(line) = next {
        reader.frame(line)?;
        next = reader.next_frame()?;
    }
    let Reader { mut reel, lines, .. } = reader;
    if let Some((count, at)) = platform.count
        && count != reel.frames.len() as u64
    {
        let found = reel.frames.len();
        let message = format!("`Frame count` is {count}, but the file has {found} frames");
        let at = if (found as u64) < count { lines.end() } else { at };
        return flaw(&at, message).map_err(Wrong::from);
    }
    reel.start_at_zero();
    hints.size(Some([rows, cols]))?;
    let pitch = platform.width.zip(platform.height).map(|(width, height)| [width, height]);
    let period = platform.rate.map(|rate| 1.0 / rate).or_else(|| reel.mean_step());
    let (unit, pitch, period) = hints.complete(unit, pitch, period)?;
    let shape = ImageShape { rows, cols, pitch, unit };
    let Reel { frames, cells, dead } = reel;
    Ok(Recording { format: FORMAT.name, shape, frames, cells, dead, threshold: None, period, force: None })
}

/// Reads the header up to the line of the first frame, which is returned too.
fn platform<'t>(lines: &mut Lines<'t>) -> Result<(Platform<'t>, Piece<'t>), Vec<Flaw>> {
    let mut platform = Platform::default();
    let mut flaws = Vec::new();
    if !lines.any(|line| is_one_of(line.text.trim(), PLATFORM)) {
        flaws.push(Flaw { span: lines.end().span(), message: "the file ends without `Platform {`".into() });
        return Err(flaws);
    }
    for line in lines.by_ref().map(Piece::trimmed) {
        if frame_number(line).is_some() {
            return if flaws.is_empty() { Ok((platform, line)) } else { Err(flaws) };
        }
        if let Err(flaw) = platform.read(line)
            && flaws.len() < 20
        {
            flaws.push(flaw);
        }
    }
    flaws.push(Flaw { span: lines.end().span(), message: "the file ends without a frame".into() });
    Err(flaws)
}

/// Returns the number in `Frame 12 {`, or `None` for another line.
fn frame_number(line: Piece<'_>) -> Option<Piece<'_>> {
    let rest = line.after("frame ").or_else(|| line.after("bild "))?;
    rest.text.strip_suffix('{').map(|number| rest.part(number).trimmed())
}

struct Reader<'t> {
    reel: Reel,
    rows: usize,
    cols: usize,
    /// Factor from the file's unit to that of the cells.
    factor: f64,
    lines: Lines<'t>,
}

impl<'t> Reader<'t> {
    /// Reads the frame with the first line `line`, up to its `}`.
    fn frame(&mut self, line: Piece<'t>) -> Result<(), Flaw> {
        let at = frame_number(line).expect("the caller has checked the line");
        let number = at.count("the frame's number")?;
        let last = self.reel.frames.last().copied();
        if let Some(last) = last
            && last.number.checked_add(1) != Some(number)
        {
            return flaw(&at, format!("frame {number} comes after frame {}", last.number));
        }
        let (time, at) = self.head(number)?;
        if last.is_some_and(|last| last.time > time) {
            return flaw(&at, "the time goes back");
        }
        for row in 0..self.rows {
            self.row(number, row)?;
        }
        let end = self.line();
        if end.text != "}" {
            return flaw(&end, format!("expected `}}` after the {} rows of frame {number}", self.rows));
        }
        self.reel.frame(number, time, self.rows, self.cols);
        Ok(())
    }

    /// Returns the next line that is not blank, or the end of the file.
    fn line(&mut self) -> Piece<'t> {
        let line = self.lines.by_ref().map(Piece::trimmed).find(|line| !line.text.is_empty());
        line.unwrap_or_else(|| self.lines.end())
    }

    /// Reads the lines before the rows, up to the names of the columns, and returns the time [ns].
    fn head(&mut self, frame: u64) -> Result<(i64, Piece<'t>), Flaw> {
        let mut found = None;
        loop {
            let line = self.line();
            let names =
                line.text.split(|c: char| c.is_whitespace() || c == ';' || c == ',').filter(|name| !name.is_empty());
            if names.clone().next().is_some_and(|name| name.eq_ignore_ascii_case("x1")) {
                let names = names.count();
                if names != self.cols {
                    let message = format!("frame {frame} has {names} names of columns, but `Columns` is {}", self.cols);
                    return flaw(&line, message);
                }
                return found.map_or_else(|| flaw(&line, format!("frame {frame} has no `Time`")), Ok);
            }
            if line.text.is_empty() || line.text == "}" || line.after("y1").is_some() || frame_number(line).is_some() {
                return flaw(&line, format!("frame {frame} ends without its columns"));
            }
            let Entry { name, unit, value } = entry(line);
            if is_one_of(name.text, TIME) {
                found = Some((nanoseconds(value, unit)?, value));
            }
        }
    }

    fn row(&mut self, frame: u64, row: usize) -> Result<(), Flaw> {
        let line = self.line();
        let notation = Notation::of(line.text);
        let mut fields = notation.fields(line);
        let name =
            fields.next().filter(|name| name.text.strip_prefix(['y', 'Y']).is_some_and(|n| n.parse() == Ok(row + 1)));
        if name.is_none() {
            return flaw(&line, format!("expected row `y{}` of frame {frame}", row + 1));
        }
        let before = self.reel.cells.len();
        for (col, cell) in fields.take(self.cols + 1).enumerate() {
            let value = notation.number(cell, "this cell")? * self.factor;
            self.reel.cell(row * self.cols + col, value).or_else(|message| flaw(&cell, message))?;
        }
        let (found, cols) = (self.reel.cells.len() - before, self.cols);
        if found == cols {
            return Ok(());
        }
        let found = if found > cols { "more".to_owned() } else { found.to_string() };
        flaw(&line, format!("row `y{}` of frame {frame} has {found} cells, but `Columns` is {cols}", row + 1))
    }

    /// Returns the line of the next frame, or `None` at the end of the file.
    fn next_frame(&mut self) -> Result<Option<Piece<'t>>, Flaw> {
        loop {
            let line = self.line();
            if line.text.is_empty() {
                return Ok(None);
            }
            if frame_number(line).is_some() {
                return Ok(Some(line));
            }
            if line.text != "}" {
                return flaw(&line, format!("expected a frame, found `{}`", shortened(line.text)));
            }
        }
    }
}

fn nanoseconds(value: Piece<'_>, unit: &str) -> Result<i64, Flaw> {
    let number = value.decimal("the frame's time")?;
    let nanoseconds =
        number * if unit.eq_ignore_ascii_case("s") || unit.eq_ignore_ascii_case("sec") { 1e9 } else { 1e6 };
    if (0.0..1e18).contains(&nanoseconds) {
        Ok(nanoseconds.round() as i64)
    } else {
        flaw(&value, "the frame's time is not from 0 to 1e9 s")
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Base;

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
