//! Tests of Tekscan's format: the shipped recording and damaged copies of it.

use super::*;
use crate::recordings::testing::{check_damages, complaints, count_refused};

const FINGER: &str = include_str!("../../../../graphs/recordings/pressuRe/iscan_test.csv");

/// Two frames of 2 by 3 cells, the corner without a sensel.
const SMALL: &str = "\
DATA_TYPE MOVIE
ROWS 2
COLS 3
ROW_SPACING 0.5 inches
COL_SPACING 4 millimeters
NOISE_THRESHOLD 3
SECONDS_PER_FRAME 0.1
START_FRAME 1
END_FRAME 2
UNITS raw
ASCII_DATA @@

Frame 1, 0,, 12/2/2019 6:21:52.34PM,,,Raw Sum=,,15
B,1,2
3,4,5

Frame 2, 0.1,, 12/2/2019 6:21:52.44PM,,,Raw Sum=,,7
B,0,0
0,0,7
@@
";

fn parse(text: &str) -> Result<Recording, Refusal> {
    FORMAT.read(text.as_bytes(), &Hints::default())
}

fn flaws(bytes: &[u8]) -> Vec<(usize, String)> {
    complaints(crate::recordings::read(bytes, "movie.csv", &Hints::default()))
}

#[test]
fn the_whole_recording_agrees_with_its_own_sums() {
    let movie = parse(FINGER).unwrap();
    let sums: Vec<f64> =
        FINGER.lines().filter_map(|line| line.split("Raw Sum=,,").nth(1)?.trim().parse().ok()).collect();
    assert_eq!((movie.frames.len(), sums.len()), (309, 309));
    for (cells, sum) in movie.cells.chunks(28 * 28).zip(&sums) {
        assert_eq!(cells.iter().map(|cell| f64::from(*cell)).sum::<f64>(), *sum);
    }
    assert!((movie.shape.pitch[0] - 0.00127).abs() < 1e-15 && (movie.shape.pitch[1] - 0.00127).abs() < 1e-15);
    assert_eq!((movie.threshold, movie.period, movie.shape.unit), (Some(3.0), 0.1, Unit::RAW));
    // Two rows and columns of the map at each border have no sensel, and two of each in its middle.
    assert_eq!(movie.dead.len(), 28 * 28 - 22 * 22);
    let one_more = FINGER.replacen("B,B,5,0,0", "B,B,6,0,0", 1);
    assert_eq!(flaws(one_more.as_bytes()), [(28, "`Raw Sum` is 310, but the cells of frame 1 sum to 311".into())]);
}

#[test]
fn a_small_movie_in_every_notation() {
    let movie = parse(SMALL).unwrap();
    assert_eq!(movie.cells, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0]);
    let frames: Vec<_> = movie.frames.iter().map(|frame| (frame.number, frame.time, frame.start)).collect();
    assert_eq!(frames, [(1, 0, 0), (2, 100_000_000, 6)]);
    assert_eq!((movie.dead.as_slice(), movie.shape.rows, movie.shape.cols), ([0].as_slice(), 2, 3));
    assert_eq!(movie.shape.pitch, [0.004, 0.0127], "x runs along the columns");
    let spreadsheet = |text: &str| text.lines().map(|line| format!("{line},,,,,,\n")).collect::<String>();
    let wide: String = SMALL.encode_utf16().flat_map(|unit| unit.to_le_bytes()).map(char::from).collect();
    assert_eq!(FORMAT.read(&wide.chars().map(|c| c as u8).collect::<Vec<_>>(), &Hints::default()).as_ref(), Ok(&movie));
    let semicolons = SMALL.replace(',', ";").replace("0.1", "0,1").replace("0.5", "0,5").replace("1;2", "1,0;2,00");
    let same = [
        SMALL.replace('\n', "\r\n"),
        SMALL.replace('\n', "\r"),
        format!("\u{feff}{SMALL}"),
        format!("\n{SMALL}\n\n"),
        SMALL.trim_end().into(),
        SMALL.replace("1,2\n", " 1 , 2 \n"),
        SMALL.replace("START_FRAME 1\nEND_FRAME 2\n", ""),
        SMALL.replace("START_FRAME 1\nEND_FRAME 2\n", "START_FRAME 11\nEND_FRAME 12\n"),
        SMALL.replace("SECONDS_PER_FRAME 0.1\n", ""),
        SMALL.replace("SECONDS_PER_FRAME 0.1\n", "SECONDS_PER_FRAME 0\nMICRO_SECOND 100000\n"),
        SMALL.replace(" 0.1,,", " 0.0,,"),
        SMALL.replace(" 0,,", " 7.5,,").replace(" 0.1,,", " 7.6,,"),
        SMALL.replace(", 0,,", ",,,").replace(", 0.1,,", ",,,"),
        SMALL.replace(", 0,, 12/2/2019 6:21:52.34PM,,,Raw Sum=,,15", "").replace("2, 0.1,, 12", "2\t12"),
        SMALL.replace("0.5 inches", "12.7 millimetres").replace("4 millimeters", "4mm"),
        SMALL.replace("4 millimeters", "4e-003 meters"),
        SMALL.replace("ROWS 2", "rows 2").replace("MOVIE", "movie").replace("raw", "Raw"),
        SMALL.replace("UNITS raw", "UNITS raw\nMAP_INDEX 0\nMAP_INDEX 1"),
        SMALL.replace("UNITS raw", "COMMENTS:\nFrame by frame,\n\nROWS of teeth\nunits are raw\nUNITS raw"),
        SMALL.replace("Sum=,,15", "Sum= 15").replace("Sum=,,7", "Sum=7.4"),
        SMALL.replace("@@\n\n", "%%\n\n").replace("\n@@\n", "\n%%\n"),
        SMALL.replace("B,1,2", "B 1 2").replace("3,4,5", "3 4  5").replace("B,0,0", "B 0 0").replace("0,0,7", "0 0 7"),
        SMALL
            .replace("B,1,2", "B\t1\t2\t")
            .replace("3,4,5", "3\t4\t5")
            .replace("B,0,0", "b\t0\t0")
            .replace("0,0,7", "0\t0\t7"),
        spreadsheet(SMALL),
        spreadsheet(SMALL).replace("DATA_TYPE MOVIE", "\"DATA_TYPE MOVIE\""),
        semicolons,
    ];
    for text in same {
        assert_eq!(parse(&text).as_ref(), Ok(&movie), "{text}");
    }
}

#[test]
fn an_insole_with_numbers_but_no_times() {
    let text = SMALL.replace(", 0,, 12/2/2019 6:21:52.34PM,,,Raw Sum=,,15", "");
    let text = text.replace(", 0.1,, 12/2/2019 6:21:52.44PM,,,Raw Sum=,,7", "").replace("UNITS raw", "UNITS KPa");
    let movie = parse(&text.replace("FRAME 0.1", "FRAME 0.032")).unwrap();
    assert_eq!((movie.frames[1].time, movie.period), (32_000_000, 0.032));
    assert_eq!(movie.threshold, None, "the filter counts and knows no kPa");
    let silent = text.replace("SECONDS_PER_FRAME 0.1\n", "");
    assert_eq!(flaws(silent.as_bytes()), [(0, "the file does not give its frame rate".into())]);
    let hinted = FORMAT.read(silent.as_bytes(), &Hints { rate_hz: Some(50.0), ..Hints::default() }).unwrap();
    assert_eq!((hinted.frames[1].time, hinted.period), (20_000_000, 0.02));
}

#[test]
fn pressures_become_kpa_and_forces_newtons() {
    let cases =
        [("PSI", "kPa", 6.894_757), ("N/cm²", "kPa", 10.0), ("mmHg", "kPa", 0.133_322_4), ("lbs", "N", 4.448_222)];
    for (name, ours, factor) in cases {
        let latin: Vec<u8> = SMALL.replace("UNITS raw", &format!("UNITS {name}")).chars().map(|c| c as u8).collect();
        let movie = FORMAT.read(&latin, &Hints::default()).expect(name);
        assert_eq!(movie.shape.unit.to_string(), ours);
        assert!((f64::from(movie.cells[5]) / 5.0 / factor - 1.0).abs() < 1e-6, "{name}: {:?}", movie.cells);
    }
}

#[test]
fn hints_fill_gaps_and_must_agree() {
    let unsaid = SMALL.replace("UNITS raw\n", "").replace("COL_SPACING 4 millimeters\n", "");
    let hints = Hints { unit: Some(Unit::RAW), pitch: Some([0.004, 0.0127]), ..Hints::default() };
    assert_eq!(FORMAT.read(unsaid.as_bytes(), &hints), parse(SMALL));
    let cases = [
        (Hints { unit: Some(Unit::NEWTON), ..Hints::default() }, "the file has another value: raw"),
        (Hints { pitch: Some([0.004, 0.004]), ..Hints::default() }, "the file has another value: [4, 12.7] mm"),
        (Hints { rate_hz: Some(50.0), ..Hints::default() }, "the file has another value: 10 frames a second"),
        (Hints { size: Some([3, 2]), ..Hints::default() }, "the file has another value: 2 rows by 3 columns"),
    ];
    for (hints, message) in cases {
        assert_eq!(complaints(FORMAT.read(SMALL.as_bytes(), &hints)), [(0, message.into())]);
    }
}

#[test]
fn a_damaged_file_has_its_line_and_message() {
    let huge = "9".repeat(30);
    let cases: &[(&str, &str, usize, &str)] = &[
        ("ROWS 2\n", "", 10, "the header has no `ROWS`"),
        ("UNITS raw\n", "", 10, "the header has no `UNITS`"),
        ("COL_SPACING 4 millimeters\n", "", 10, "the header has no `COL_SPACING`"),
        ("MOVIE", "FRAME", 1, "the file is a `FRAME`, not a `MOVIE`"),
        ("ROWS 2", "ROWS two", 2, "`ROWS` is not a whole number: `two`"),
        ("ROWS 2", "ROWS 0", 2, "`ROWS` must be at least 1"),
        ("ROWS 2", "ROWS -2", 2, "`ROWS` is not a whole number: `-2`"),
        ("ROWS 2", "ROWS 4000000000", 2, "a frame of 4000000000 by 3 cells is more than the file holds"),
        (
            "COLS 3",
            "COLS 18446744073709551615",
            2,
            "a frame of 2 by 18446744073709551615 cells is more than the file holds",
        ),
        ("COLS 3", &format!("COLS {huge}"), 3, &format!("`COLS` is not a whole number: `{huge}`")),
        ("COLS 3", "COLS 3\nROWS 3", 4, "`ROWS` is given twice"),
        (
            "0.5 inches",
            "0.5 feet",
            4,
            "the unit of `ROW_SPACING` must be `centimeters`, `millimeters` or `inches`, not `feet`",
        ),
        ("4 millimeters", "0 millimeters", 5, "`COL_SPACING` must be greater than 0"),
        ("THRESHOLD 3", "THRESHOLD none", 6, "`NOISE_THRESHOLD` is not a number: `none`"),
        ("FRAME 0.1", "FRAME -0.1", 7, "`SECONDS_PER_FRAME` must be greater than 0"),
        ("START_FRAME 1", "START_FRAME 5", 13, "the first frame is 1, but `START_FRAME` is 5"),
        ("END_FRAME 2", "END_FRAME 3", 9, "`END_FRAME` is 3, but the last frame is 2"),
        (
            "UNITS raw",
            "UNITS stone",
            10,
            "the unit `stone` is unknown; known are `raw`, pressures (`kPa`, `N/cm2`, `PSI`, `mmHg`, …) and \
             forces (`N`, `lbs`, `kg`, …)",
        ),
        ("ASCII_DATA @@\n", "", 12, "the header has no last line `ASCII_DATA @@`"),
        ("Frame 1,", "Frame one,", 13, "the frame's number is not a whole number: `one`"),
        (" 0.1,,", " ,,", 17, "the frame's time is not a number: ``"),
        (" 0.1,,", " 1e30,,", 17, "the frame's time is not from 0 to 1e9 s: `1e30`"),
        ("1, 0,,", "1, 0.2,,", 17, "the time goes back"),
        ("Frame 2,", "Frame 3,", 17, "frame 3 comes after frame 1"),
        ("=,,15", "=,,", 13, "`Raw Sum=` has no number: the line is cut off"),
        ("=,,15", "=,,16", 13, "`Raw Sum` is 16, but the cells of frame 1 sum to 15"),
        ("3,4,5", "3,4.,x", 15, "this cell is not a number: `x`"),
        ("3,4,5", "3,NaN,5", 15, "this cell is not finite: `NaN`"),
        ("3,4,5", "3,-inf,5", 15, "this cell is not finite: `-inf`"),
        ("3,4,5", "3,1e39,5", 15, "this cell is too large: `1e39`"),
        ("3,4,5", "3,4", 15, "row 2 of frame 1 has 2 cells, but `COLS` is 3"),
        ("3,4,5", "3,4,5,6", 15, "row 2 of frame 1 has 4 cells, but `COLS` is 3"),
        ("3,4,5\n", "", 15, "frame 1 ends after 1 of its 2 rows"),
        ("3,4,5\n\n", "", 15, "frame 1 ends after 1 of its 2 rows"),
        ("0,0,7\n", "", 19, "frame 2 ends after 1 of its 2 rows"),
        ("0,0,7\n@@\n", "0,0", 19, "row 2 of frame 2 has 2 cells, but `COLS` is 3: the file ends in the middle of it"),
        ("0,0,7\n@@\n", "", 18, "frame 2 ends after 1 of its 2 rows"),
        ("0,0,7\n@@\n", "0,0,7\n", 19, "the file ends after frame 2 without `@@`: it is truncated"),
        ("B,0,0", "0,0,0", 18, "this cell has a sensel, but it is `B` in the first frame"),
        ("B,0,0", "B,B,0", 18, "this cell is `B`, but it has a sensel in the first frame"),
        ("\nFrame 2", "\nhello\nFrame 2", 17, "expected a frame or `@@`, found `hello`"),
        ("@@\n\nFrame 1", "@@\n@@\nFrame 1", 12, "the file has no frame"),
        ("7\n@@\n", "7\n@@\nmore", 21, "unexpected text after `@@`, the end of the movie"),
    ];
    check_damages(SMALL, "movie.csv", &Hints::default(), cases);
    assert_eq!(flaws(b""), [(0, "stranger".into())]);
    assert_eq!(flaws(b"\x89PNG\r\n"), [(0, "stranger".into())]);
    for cut in 0..SMALL.trim_end().len() {
        assert_ne!(flaws(&SMALL.as_bytes()[..cut]), [], "cut after {cut} bytes");
    }
    let several = flaws(SMALL.replace("ROWS 2\n", "").replace("UNITS raw", "UNITS x").as_bytes());
    assert_eq!(several.len(), 2, "every mistake of the header at once: {several:?}");
}

#[test]
fn no_damage_causes_a_panic() {
    let start = FINGER.find("\nFrame 4,").unwrap();
    let movie = format!("{}@@\n", &FINGER[..start]).replace("END_FRAME 309", "END_FRAME 3");
    assert_eq!(parse(&movie).unwrap().frames.len(), 3);
    let refused = count_refused(&[SMALL.as_bytes(), movie.as_bytes()], "movie.csv", &Hints::default(), 6000);
    assert!(refused > 4000, "{refused} of 6000 were seen to be damaged");
}
