//! `footscan`: the text export of an RSscan plate ("Entire Plate Roll Off", often named `.xls` though it is text).
//!
//! A frame is a line `Frame 12 (95.24 ms)` and a line of cells for each row. Blank lines separate the frames, and text
//! before the first frame is ignored. The file gives neither unit nor pitch. The cells are forces: the sum of a frame
//! is the load [N]. The plates of 0.5, 1 and 2 m are 64 sensors wide. Their pitch is 5.08 mm across the plate, which is
//! along a row of the file, and 7.62 mm along it, from row to row. It is the default for up to 64 columns.

use tactflow_runtime::signal::Unit;

use crate::recordings::common::reel::{Properties, Reel, bounded};
use crate::recordings::common::text::{Lines, Notation, Piece};
use crate::recordings::common::{FileFormat, FileHead, Hints, Recording, Refusal, TextError, Window};

pub(super) const FORMAT: FileFormat =
    FileFormat::text("footscan", "RSscan footscan, the whole plate's roll-off as text", recognises, parse);

/// Distance of the plates' sensors along a row and from row to row [m].
const PITCH: [f64; 2] = [0.005_08, 0.007_62];

/// Maximum number of columns of those plates.
const MAX_COLS: usize = 64;

/// Recognises the line of a frame with a row of numbers after it.
fn recognises(head: &FileHead<'_>) -> bool {
    let mut lines = Lines::new(&head.text);
    let has_frame = lines.any(|line| matches!(frame_line(line.trimmed()), Some(Ok(_))));
    let row = lines.next_filled();
    let notation = Notation::of(row.text);
    has_frame && notation.fields(row).next().is_some_and(|cell| notation.number(cell, "").is_ok())
}

/// The content of the line of a frame.
struct FrameLine<'t> {
    number: u64,
    /// Time [ns], and its place.
    time: Option<(f64, Piece<'t>)>,
}

/// Parses `Frame 12 (95.24 ms)`, or returns `None` for another line.
fn frame_line(line: Piece<'_>) -> Option<Result<FrameLine<'_>, TextError>> {
    let rest = line.after("frame").or_else(|| line.after("bild"))?;
    let (number, time) = rest.text.split_once('(').map_or((rest.text, None), |(number, time)| (number, Some(time)));
    let number = rest.part(number).trimmed();
    let is_number = number.text.starts_with(|c: char| c.is_ascii_digit());
    is_number.then(|| {
        let number = number.count("the frame's number")?;
        let time = time.map(|time| nanoseconds(rest.part(time).trimmed())).transpose()?;
        Ok(FrameLine { number, time })
    })
}

/// Parses `95.24 ms)`.
fn nanoseconds(text: Piece<'_>) -> Result<(f64, Piece<'_>), TextError> {
    let Some((inside, "")) = text.text.split_once(')') else {
        return Err(text.error("expected `)` after the frame's time, at the end of the line"));
    };
    let inside = text.part(inside).trimmed();
    let end = inside.text.find(char::is_alphabetic).unwrap_or(inside.text.len());
    let number = inside.part(&inside.text[..end]).trimmed().decimal("the frame's time")?;
    match &*inside.text[end..].to_ascii_lowercase() {
        "ms" => Ok((number * 1e6, inside)),
        "s" | "sec" => Ok((number * 1e9, inside)),
        _ => Err(inside.error("the unit of a frame's time must be `ms` or `s`")),
    }
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let mut reader = FootscanReader::default();
    let mut lines = Lines::new(text);
    let mut next = first_frame(&mut lines)?;
    while let Some(line) = next {
        next = reader.frame(line, &mut lines)?;
    }
    let FootscanReader { reel, size } = reader;
    let [_, cols] = size.ok_or_else(|| lines.end().error("the file has no frame"))?;
    let unit = hints.unit.unwrap_or(Unit::NEWTON);
    let pitch = (cols <= MAX_COLS && hints.pitch.is_none()).then_some(PITCH);
    reel.finish(FORMAT.name, Properties { size, unit: Some((unit, 1.0)), pitch, ..Properties::default() }, hints)
}

/// Skips the text before the first frame, which must not be a row of cells.
fn first_frame<'t>(lines: &mut Lines<'t>) -> Result<Option<Piece<'t>>, TextError> {
    for line in lines.map(Piece::trimmed) {
        if frame_line(line).is_some() {
            return Ok(Some(line));
        }
        let notation = Notation::of(line.text);
        let mut cells = notation.fields(line);
        let is_row = cells.clone().nth(1).is_some() && cells.all(|cell| notation.number(cell, "").is_ok());
        line.check(!is_row, "this row of cells comes before the line of its frame")?;
    }
    Ok(None)
}

#[derive(Default)]
struct FootscanReader {
    reel: Reel,
    /// Rows and columns of the first frame.
    size: Option<[usize; 2]>,
}

impl FootscanReader {
    /// Reads the frame with the line `line`, and returns the line of the next frame.
    fn frame<'t>(&mut self, line: Piece<'t>, lines: &mut Lines<'t>) -> Result<Option<Piece<'t>>, TextError> {
        let FrameLine { number, time } = frame_line(line).expect("the caller has checked the line")?;
        self.reel.follows(number, line)?;
        line.check(self.reel.is_timed_alike(time.is_some()), "some frames have a time and some do not")?;
        let time = time.map(|(time, at)| self.reel.time(time, at)).transpose()?;
        let ([rows, cols], next) = self.rows(number, lines)?;
        self.reel.frame(number, time, Window::whole(rows, cols));
        Ok(next)
    }

    /// Reads the rows of a frame. Returns its size, and the line of the next frame.
    fn rows<'t>(&mut self, frame: u64, lines: &mut Lines<'t>) -> Result<([usize; 2], Option<Piece<'t>>), TextError> {
        let mut rows = 0;
        let end = loop {
            let line = lines.next_filled();
            if line.text.is_empty() || frame_line(line).is_some() {
                break line;
            }
            self.row(frame, rows, line)?;
            rows += 1;
        };
        let [wanted, cols] = self.size.ok_or_else(|| end.error(format!("frame {frame} has no rows")))?;
        let fits = self.reel.frames.is_empty() || rows == wanted;
        end.check(fits, format_args!("frame {frame} ends after {rows} rows, but the earlier frames have {wanted}"))?;
        self.size = Some([rows, cols]);
        Ok(([rows, cols], (!end.text.is_empty()).then_some(end)))
    }

    fn row(&mut self, frame: u64, row: usize, line: Piece<'_>) -> Result<(), TextError> {
        let notation = Notation::of(line.text);
        let found = notation.fields(line).count();
        let [_, cols] = *self.size.get_or_insert([0, found]);
        let number = row + 1;
        let message = format_args!("row {number} of frame {frame} has {found} cells, but the first has {cols}");
        line.check(found == cols, message)?;
        bounded(number, cols).map_err(|message| line.error(message))?;
        self.reel.row(notation.fields(line), |cell| notation.number(cell, "this cell"))
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::ImageShape;

    use super::super::read;
    use super::super::testing::{check_damages, complaints, count_refused};

    use super::*;

    const GOOD: &str = "Frame 0 (0.00 ms)\r\n0.0\t0.4\t0.0\r\n0.0\t1.1\t2.5\r\n\r\n\
        Frame 1 (7.94 ms)\r\n0.0\t0.7\t0.0\r\n0.4\t1.4\t11.5\r\n\r\n";

    #[test]
    fn a_plate_is_read_with_its_times_and_the_pitch_of_its_sensors() {
        let recording = read(GOOD.as_bytes(), "sel_1 - 3-4-2010 - Entire Plate Roll Off", &Hints::default()).unwrap();
        assert_eq!(recording.shape, ImageShape { rows: 2, cols: 3, pitch: PITCH, unit: Unit::NEWTON });
        assert_eq!(recording.cells, [0.0, 0.4, 0.0, 0.0, 1.1, 2.5, 0.0, 0.7, 0.0, 0.4, 1.4, 11.5]);
        let times: Vec<i64> = recording.frames.iter().map(|frame| frame.time).collect();
        assert_eq!(times, [0, 7_940_000]);
        assert!((recording.period - 0.00794).abs() < 1e-15);
    }

    #[test]
    fn equivalent_notations_give_the_same_recording() {
        let hints = Hints { rate_hz: Some(1000.0 / 7.94), ..Hints::default() };
        let good = read(GOOD.as_bytes(), "", &hints).unwrap();
        let body = |text: &str| text.replace("\r\n", "\n");
        let cases = [
            body(GOOD),
            body(GOOD).replace("\n\n", "\n\n\n"),
            body(GOOD).replace("\n\n", "\n").replace("ms", "MS"),
            GOOD.trim_end().to_owned(),
            body(GOOD).replace("\t0.0\n", "\t0.0\t\n"),
            body(GOOD).replace('.', ",").replace('\t', "\t "),
            body(GOOD).replace('.', ",").replace('\t', ";"),
            body(GOOD).replace('\t', ","),
            body(GOOD).replace('\t', "  "),
            body(GOOD).replace("(7.94 ms)", "( 0.00794 s )").replace("Frame", "FRAME"),
            body(GOOD).replace(" (0.00 ms)", "").replace(" (7.94 ms)", ""),
            body(GOOD).replace("(0.00 ms)", "(8.00 ms)").replace("(7.94", "(15.94"),
            body(GOOD).replace("Frame 1", "Frame 2").replace("Frame 0", "Frame 1"),
            format!("footscan 7 gait\r\nSelma\t3-4-2010\r\n\r\n{GOOD}"),
            format!("\u{feff}{GOOD}"),
        ];
        for text in cases {
            let mut got = read(text.as_bytes(), "", &hints).unwrap_or_else(|refusal| panic!("{text}: {refusal:?}"));
            got.frames.iter_mut().zip(&good.frames).for_each(|(frame, good)| frame.number = good.number);
            got.period = good.period;
            assert_eq!(got, good, "{text}");
        }
    }

    #[test]
    fn a_mistake_has_its_line_and_message() {
        let good = GOOD.replace("\r\n", "\n");
        let cases = [
            ("Frame 0", "Fram 0", 2, "this row of cells comes before the line of its frame"),
            ("Frame 1", "Frame 3", 5, "frame 3 comes after frame 0"),
            ("7.94", "-7.94", 5, "the frame's time is not from 0 to 1e9 s"),
            ("0.00 ms", "8.00 ms", 5, "the time goes back"),
            ("7.94 ms)", "7.94 ms", 5, "expected `)` after the frame's time, at the end of the line"),
            ("7.94 ms", "7.94 h", 5, "the unit of a frame's time must be `ms` or `s`"),
            (" (7.94 ms)", "", 5, "some frames have a time and some do not"),
            ("0.4\t1.4\t11.5", "0.4\t1.4", 7, "row 2 of frame 1 has 2 cells, but the first has 3"),
            ("0.4\t1.4\t11.5\n", "", 6, "frame 1 ends after 1 rows, but the earlier frames have 2"),
            ("0.0\t1.1\t2.5\n", "", 6, "frame 1 ends after 2 rows, but the earlier frames have 1"),
            ("11.5", "eleven", 7, "this cell is not a number: `eleven`"),
            ("11.5", "1e39", 7, "this cell is too large"),
        ];
        check_damages(&good, "", &Hints::default(), &cases);
        let forced = Hints { format: Some("footscan".into()), ..Hints::default() };
        let got = complaints(read(b"Frame 0 (0 ms)\n", "", &forced));
        assert_eq!(got, [(1, "frame 0 has no rows".into())]);
        assert_eq!(complaints(read(b"hello", "", &forced)), [(1, "the file has no frame".into())]);
    }

    #[test]
    fn a_wide_array_needs_its_pitch_from_the_bench() {
        let row = vec!["1.0"; 65].join("\t");
        let text = format!("Frame 0 (0 ms)\n{row}\n\nFrame 1 (8 ms)\n{row}\n");
        let refusal = read(text.as_bytes(), "", &Hints::default());
        assert_eq!(complaints(refusal), [(0, "the file does not give the pitch of its tactels".into())]);
        let hints = Hints { pitch: Some([0.001, 0.002]), ..Hints::default() };
        assert_eq!(read(text.as_bytes(), "", &hints).unwrap().shape.pitch, [0.001, 0.002]);
    }

    #[test]
    fn a_damaged_file_is_refused_or_gives_a_sound_recording() {
        let refused = count_refused(&[GOOD.as_bytes()], "", &Hints::default(), 2000);
        assert!((1000..2000).contains(&refused), "{refused}");
    }
}
