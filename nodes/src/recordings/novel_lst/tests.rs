//! Tests of novel's listing: the shipped recording with its forces as the oracle, and damaged copies of a small one.

use super::*;
use crate::recordings::testing::{check_damages, complaints, count_refused};
use crate::recordings::text;

const EMED: &[u8] = include_bytes!("../../../../graphs/recordings/pressuRe/emed_test.zip");

/// Two pictures and a summary of an array of 4 columns and 5 rows.
const SMALL: &str = "
\t\t\t\tPage 1

\tFile: C:\\MVP\\2.dat \tMatrix: 4x5 
\tSensor area: 0.25 cm²\tTime/picture:10.0 ms
\tMV over frames
\tSensor size: 0.500x0.500 cm
\tnovel munich/st.paul/london
\tPict-No.: 1  Force[N]=sum*sensor_area in row/column

\t2\t3\tForce
3\t10.00\t0.00\t0.25
4\t5.00\t20.00\t0.63
5\t0.00\t2.50\t0.06
Force\t0.38\t0.56\t0.94
\u{c}

\t\t\t\tPage 2

\tFile: C:\\MVP\\2.dat \tMatrix: 4x5 
\tPict-No.: 2  Force[N]=sum*sensor_area in row/column

\t1\t2\t3\tForce
1\t0.00\t40.00\t0.00\t1.00
Force\t0.00\t1.00\t0.00\t1.00
\u{c}

\t\t\t\tPage 3

\tMVP

\t3\tForce
1\t100.00\t2.50
Force\t2.50\t2.50
\u{c}

\u{c}";

fn parse(text: &str) -> Result<Recording, Refusal> {
    FORMAT.read(text.as_bytes(), &Hints::default())
}

/// Returns the text of the shipped recording.
fn emed() -> String {
    let (bytes, _) = crate::recordings::archive::unpack(EMED, "emed_test.zip", &Hints::default()).unwrap().unwrap();
    text::decode(&bytes).into_owned()
}

fn flaws(text: &str) -> Vec<(usize, String)> {
    complaints(crate::recordings::read(text.as_bytes(), "emed.lst", &Hints::default()))
}

#[test]
fn the_whole_recording_agrees_with_its_own_forces() {
    let recording = crate::recordings::read(EMED, "emed_test.zip", &Hints::default()).unwrap();
    let text = emed();
    let pages: Vec<&str> = text.split('\u{c}').filter(|page| page.contains("Page")).collect();
    assert_eq!((recording.frames.len(), pages.len()), (106, 106));
    assert_eq!((recording.shape.rows, recording.shape.cols, recording.shape.pitch), (95, 64, [0.005; 2]));
    assert_eq!((recording.period, recording.shape.unit.to_string().as_str()), (0.01, "kPa"));
    let mut image = vec![f32::NAN; 95 * 64];
    for (index, page) in pages.iter().enumerate() {
        recording.show(index, &mut image);
        // 0.025 N per kPa on 0.25 cm², printed with two decimals.
        let force = |cells: &[f32]| 0.025 * cells.iter().map(|cell| f64::from(*cell)).sum::<f64>();
        let agrees = |figure: &str, force: f64| (figure.parse::<f64>().unwrap() - force).abs() < 0.005 + 1e-9;
        let rows: Vec<Vec<&str>> = page.lines().map(|line| line.split('\t').collect()).collect();
        let labels = rows.iter().find(|row| row.last() == Some(&"Force")).unwrap();
        let mut checked = 0;
        for row in rows.iter().filter(|row| row.len() == labels.len() && row[0].parse::<usize>().is_ok()) {
            let place = (row[0].parse::<usize>().unwrap() - 1) * 64;
            assert!(agrees(row[row.len() - 1], force(&image[place..place + 64])), "page {}: {row:?}", index + 1);
            checked += 1;
        }
        let last = rows.iter().find(|row| row[0] == "Force").unwrap();
        for (label, figure) in labels.iter().zip(last).filter(|(label, _)| label.parse::<usize>().is_ok()) {
            let column: Vec<f32> =
                image.iter().copied().skip(label.parse::<usize>().unwrap() - 1).step_by(64).collect();
            assert!(agrees(figure, force(&column)), "page {}, column {label}", index + 1);
            checked += 1;
        }
        assert!(agrees(last[last.len() - 1], force(&image)), "page {}", index + 1);
        assert_eq!(checked, 54 + 22);
        assert_eq!(recording.frames[index].time, index as i64 * 10_000_000);
    }
    assert!(recording.cells.iter().any(|cell| *cell > 100.0));
}

#[test]
fn a_small_listing_in_every_notation() {
    let recording = parse(SMALL).unwrap();
    let mut image = [f32::NAN; 20];
    recording.show(0, &mut image);
    let first = [[0.0; 4], [0.0; 4], [0.0, 10.0, 0.0, 0.0], [0.0, 5.0, 20.0, 0.0], [0.0, 0.0, 2.5, 0.0]];
    assert_eq!(image, *first.as_flattened(), "five rows of four");
    recording.show(1, &mut image);
    assert_eq!((image[1], image.iter().sum::<f32>()), (40.0, 40.0));
    assert_eq!(recording.frames.len(), 2, "a mean over time is not a picture");
    let latin: Vec<u8> = SMALL.chars().map(|c| c as u8).collect();
    let same = [
        latin,
        SMALL.replace('\n', "\r\n").into(),
        SMALL.replace('.', ",").replace("No,:", "No.:").replace("2,dat", "2.dat").into(),
        SMALL.replace("\u{c}\n", "\u{c}").into(),
        SMALL.replace("10.0 ms", "0.010 s").replace("0.500x0.500 cm", "5.00 x 5.00 mm").into(),
        SMALL.replace("Page", "\tPage").replace("0.00", "0").into(),
        SMALL.replace("\n3\t10.00\t0.00", "\n3\t10.00\t").into(),
        SMALL.replace("\tSensor area: 0.25 cm²\t", "\t").into(),
        SMALL.trim_end().into(),
    ];
    for text in same {
        let read = crate::recordings::read(&text, "", &Hints::default());
        assert_eq!(read.as_ref(), Ok(&recording), "{}", String::from_utf8_lossy(&text));
    }
    let blanks = parse(&SMALL.replace('\t', " ")).unwrap();
    assert_eq!((blanks.frames, blanks.cells), (recording.frames.clone(), recording.cells.clone()));
    let below = [("\t2\t3\tForce", "\t2\t3"), ("\t0.25\n", "\n"), ("\t0.63\n", "\n"), ("\t0.06\n", "\n")];
    let below = below.iter().fold(SMALL.to_owned(), |text, (from, to)| text.replacen(from, to, 1));
    assert_eq!(parse(&below).as_ref(), Ok(&recording), "with the forces of columns alone");
    assert_eq!(parse(&below.replace("\t0.94\n", "\n")).as_ref(), Ok(&recording), "and without the total");
    let columns: [(&str, &str); 10] = [
        ("\t2\t3\tForce", "\t2\t3"),
        ("\t0.25\n", "\n"),
        ("\t0.63\n", "\n"),
        ("\t0.06\n", "\n"),
        ("Force\t0.38\t0.56\t0.94\n", ""),
        ("\t3\tForce\n1\t0", "\t3\n1\t0"),
        ("\t0.00\t1.00\n", "\t0.00\n"),
        ("Force\t0.00\t1.00\t0.00\t1.00\n", ""),
        ("\t3\tForce", "\t3"),
        ("\t2.50\nForce\t2.50\t2.50", ""),
    ];
    let bare = columns.iter().fold(SMALL.to_owned(), |text, (from, to)| text.replacen(from, to, 1));
    assert_eq!(parse(&bare).as_ref(), Ok(&recording), "without forces: {bare}");
}

#[test]
fn the_forces_show_newtons_per_square_centimetre() {
    let forces = [("\t0.25\n", "\t2.50\n"), ("\t0.63\n", "\t6.25\n"), ("\t0.06\n", "\t0.63\n")];
    let more = [
        ("0.38\t0.56\t0.94", "3.75\t5.63\t9.38"),
        ("\t1.00\n", "\t10.00\n"),
        ("\t1.00\t0.00\t1.00", "\t10.0\t0.0\t10.0"),
    ];
    let text = forces.iter().chain(&more).fold(SMALL.to_owned(), |text, (from, to)| text.replacen(from, to, 1));
    let text = text.replace("100.00\t2.50\nForce\t2.50\t2.50", "10.00\t2.50\nForce\t2.50\t2.50");
    let recording = parse(&text).unwrap();
    assert_eq!((recording.cells[0], recording.shape.unit.to_string().as_str()), (100.0, "kPa"));
}

#[test]
fn a_second_measurement_continues_the_count() {
    let again = SMALL.replace("Page 1", "Page 4").replace("Page 2", "Page 5").replace("Page 3", "Page 6");
    let recording = parse(&format!("{SMALL}{again}")).unwrap();
    let frames: Vec<_> = recording.frames.iter().map(|frame| (frame.number, frame.time / 1_000_000)).collect();
    assert_eq!(frames, [(1, 0), (2, 10), (3, 20), (4, 30)]);
}

#[test]
fn a_damaged_file_has_its_line_and_message() {
    let cases: &[(&str, &str, usize, &str)] = &[
        ("Matrix: 4x5", "Matrix: 2x5", 11, "column 3 is outside the array of 5 rows and 2 columns"),
        ("Matrix: 4x5", "Matrix: 4 by 5", 4, "expected `columns x rows` after `Matrix:`, found `4 by 5`"),
        ("Matrix: 4x5", "Matrix: 0x5", 4, "the number of this column must be from 1 to 100000, not 0"),
        ("Matrix: 4x5", "Matrix: 90000x90000", 0, "an array of 90000 by 90000 has more than 262144 cells"),
        ("10.0 ms", "10.0 h", 5, "the unit of `Time/picture:` must be `ms` or `s`, not `h`"),
        ("10.0 ms", "0 ms", 5, "`Time/picture:` must be greater than 0"),
        ("10.0 ms", "9e9", 5, "the unit of `Time/picture:` must be `ms` or `s`, not `e9`"),
        (
            "0.500x0.500 cm",
            "0.500x0.500 feet",
            7,
            "the unit of `Sensor size:` must be `cm` or `mm`, not `0.500x0.500 feet`",
        ),
        ("Time/picture:10.0 ms", "", 0, "the file does not give its frame rate"),
        ("Page 2", "Page 3", 18, "page 3 comes after page 1"),
        ("Page 2", "Page two", 18, "the number of this page is not a whole number: `two`"),
        ("Pict-No.: 2 ", "Pict-No.: 0 ", 21, "picture 0 comes after picture 1"),
        (
            "Pict-No.: 2 ",
            "Pict-No.: 99999999999 ",
            21,
            "the number of a picture must be at most 1000000000, not 99999999999",
        ),
        ("Pict-No.: 2 ", "", 23, "`Pict-No.:` is missing on this page"),
        ("\t2\t3\tForce", "\t2\t4\tForce", 11, "column 4 comes after column 2"),
        ("\t2\t3\tForce", "\t0\t1\tForce", 11, "the number of this column must be from 1 to 100000, not 0"),
        ("4\t5.00\t20.00", "5\t5.00\t20.00", 13, "row 5 comes after row 3"),
        ("4\t5.00\t20.00", "x\t5.00\t20.00", 13, "the number of this row is not a whole number: `x`"),
        ("5.00\t20.00\t0.63", "5.00\t20.00", 13, "row 4 has 2 numbers, but the header of its page has 3"),
        ("5.00\t20.00", "5.00\t2o.00", 13, "this cell is not a number: `2o.00`"),
        ("5.00\t20.00", "5.00\tinf", 13, "this cell is not finite: `inf`"),
        ("5.00\t20.00", "5.00\t1e38", 13, "this cell is too large: `1e38`"),
        ("5.00\t20.00", "5.00\t23.00", 13, "the force of this row is 0.63 N, but its cells sum to 0.7 N"),
        (
            "0.38\t0.56\t0.94",
            "0.38\t0.66\t0.94",
            15,
            "the force of this column is 0.66 N, but its cells sum to 0.5625 N",
        ),
        ("0.38\t0.56\t0.94", "0.38\t0.56\t0.84", 15, "the force of this page is 0.84 N, but its cells sum to 0.9375 N"),
        ("0.38\t0.56\t0.94", "0.38\t0.56", 15, "the row `Force` has 2 numbers, but the header of its page has 3"),
        ("Force\t0.38\t0.56\t0.94\n", "", 15, "the page ends after 3 rows: it is truncated"),
    ];
    check_damages(SMALL, "emed.lst", &Hints::default(), cases);
    let whole = SMALL.find("\u{c}\n\n\t\t\t\tPage 3").unwrap();
    let ends: Vec<usize> = SMALL.match_indices("\u{c}").map(|(at, _)| at).collect();
    for cut in (0..whole).filter(|cut| SMALL.is_char_boundary(*cut)) {
        // After the last digit of a page no cell is missing, and a listing does not give its number of pages.
        let is_end = ends.iter().any(|end| (end - 4..=end + 7).contains(&cut));
        assert!(is_end || !flaws(&SMALL[..cut]).is_empty(), "cut after {cut} bytes");
    }
}

#[test]
fn no_damage_causes_a_panic() {
    let text = emed();
    let three = text.find("\t\t\t\tPage 4").unwrap();
    let part: Vec<u8> = text[..three].trim_end().chars().map(|c| c as u8).collect();
    let refused = count_refused(&[SMALL.as_bytes(), &part], "emed.lst", &Hints::default(), 4000);
    assert!(refused > 1500, "{refused} of 4000 were seen to be damaged");
}
