//! Tests of plain CSV: both layouts, names, and mistakes with their places.

use tactflow_runtime::signal::{ImageShape, Unit};

use super::super::testing::{check_damages, complaints, count_refused};
use super::super::{Refusal, read};
use super::*;

const NAMED: &str =
    "# a press\ntime,force,r0c0,r0c1,r1c0,r1c1\n0.5,1.25,1,2,3,4\n0.75,2.5,5,6,7,nope\n1.0,3.5,9,10,11,12\n";

fn hints() -> Hints {
    Hints { unit: Some(Unit::RAW), pitch: Some([0.004, 0.005]), ..Hints::default() }
}

fn sized(rows: usize, cols: usize) -> Hints {
    Hints { size: Some([rows, cols]), rate_hz: Some(100.0), ..hints() }
}

fn named() -> String {
    NAMED.replace("nope", "8")
}

#[test]
fn names_give_the_roles_of_columns() {
    let recording = read(named().as_bytes(), "press.csv", &hints()).unwrap();
    assert_eq!(recording.shape, ImageShape { rows: 2, cols: 2, pitch: [0.004, 0.005], unit: Unit::RAW });
    assert_eq!(recording.cells, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0]);
    let times: Vec<i64> = recording.frames.iter().map(|frame| frame.time).collect();
    assert_eq!((times, recording.period), (vec![0, 250_000_000, 500_000_000], 0.25));
    assert_eq!(recording.force.as_deref(), Some(&[1.25, 2.5, 3.5][..]));
}

#[test]
fn equivalent_notations_give_the_same_recording() {
    let good = read(named().as_bytes(), "", &hints()).unwrap();
    let cases = [
        named().replace(',', ";").replace('.', ","),
        named().replace(',', "\t"),
        named().replace(',', "\t").replace('.', ","),
        named().replace(',', "  "),
        named().replace('\n', "\r\n"),
        named().replace('\n', ",\n").replace("press,", "press"),
        named().replace("time", "\"Time [s]\"").replace("force", "\"Force [N]\""),
        named().replace("time", "time_ms").replace("0.5,", "500,").replace("0.75", "750").replace("1.0", "1000"),
        named().replace("r0c0,r0c1,r1c0,r1c1", "t1_1,t1_2,t2_1,t2_2"),
        named().replace("r0c0,r0c1,r1c0,r1c1", "x0y0,x1y0,x0y1,x1y1"),
        named().replace("0.5,1.25,1,2,3,4", "\n# the first\n 0.5, 1.25, 1, 2, 3, 4\n"),
        // Every cell in quotes.
        named()
            .replace(',', "\",\"")
            .replace('\n', "\"\n\"")
            .replacen("# a press\"", "# a press", 1)
            .trim_end_matches('"')
            .into(),
        // The columns in another order, with the index column of a pandas data frame.
        ",r1c1,r1c0,time,r0c1,r0c0,force\n0,4,3,0.5,2,1,1.25\n1,8,7,0.75,6,5,2.5\n2,12,11,1.0,10,9,3.5\n".into(),
    ];
    for text in cases {
        assert_eq!(read(text.as_bytes(), "", &hints()).as_ref(), Ok(&good), "{text}");
    }
    let other = Hints { size: Some([2, 2]), ..hints() };
    let text = named().replace("r0c0,r0c1,r1c0,r1c1", "a,b,c,d");
    assert_eq!(read(text.as_bytes(), "", &other).as_ref(), Ok(&good));
    assert_eq!(
        complaints(read(text.as_bytes(), "", &hints()))[0].1,
        "the file does not give its number of rows and columns"
    );
}

#[test]
fn an_empty_cell_is_a_tactel_that_does_not_exist() {
    let text = "time,r0c0,r0c1,r1c0,r1c1\n0,1,,3,4\n0.1,5,,7,8\n";
    let recording = read(text.as_bytes(), "pad.csv", &hints()).unwrap();
    assert_eq!((recording.dead, recording.cells), (vec![1], vec![1.0, 0.0, 3.0, 4.0, 5.0, 0.0, 7.0, 8.0]));
}

#[test]
fn a_column_of_words_is_refused_at_its_place() {
    let text = "time,r0c0,r0c1,r1c0,r1c1\n2026-11-21,1,2,3,4\n2026-11-22,5,6,7,8\n";
    let got = complaints(read(text.as_bytes(), "pad.csv", &hints()));
    assert_eq!(got, [(2, "this cell is not a number: `2026-11-21`".to_owned())]);
    let words = "name,age,town\nAda,36,London\n";
    assert_eq!(read(words.as_bytes(), "people.csv", &hints()), Err(Refusal::Stranger));
}

#[test]
fn size_or_blank_lines_select_rows_or_blocks() {
    let cells = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0];
    let unsized_ = Hints { rate_hz: Some(100.0), ..hints() };
    let cases = [
        ("1,2,3,4,5,6\n7,8,9,10,11,12\n", sized(2, 3)),
        ("1,2,3\n4,5,6\n7,8,9\n10,11,12\n", sized(2, 3)),
        ("1,2,3\n4,5,6\n\n\n7,8,9\n10,11,12\n\n", sized(2, 3)),
        ("1 2 3\n4 5 6\n\n7 8 9\n10 11 12", unsized_.clone()),
        ("# one\n\n1;2;3\n4;5;6\n\n# two\n7;8;9\n10;11;12\n", unsized_.clone()),
    ];
    for (text, hints) in cases {
        let recording = read(text.as_bytes(), "", &hints).unwrap_or_else(|refusal| panic!("{text}: {refusal:?}"));
        assert_eq!((recording.shape.rows, recording.shape.cols), (2, 3), "{text}");
        assert_eq!(recording.cells, cells, "{text}");
        assert_eq!(recording.frames[1].time, 10_000_000, "{text}");
    }
    for text in ["1,2,3\n4,5,6\n", "1,2,3\n\n4,5,6\n"] {
        let refusal = read(text.as_bytes(), "", &unsized_);
        assert!(matches!(&refusal, Err(Refusal::Silent { help, .. }) if help.contains("t0_0,t0_1")), "{refusal:?}");
    }
}

#[test]
fn a_tactel_that_is_nan_throughout_does_not_exist() {
    let text = "1,NaN,3,4\n5,nan,7,8\n";
    let recording = read(text.as_bytes(), "", &sized(2, 2)).unwrap();
    assert_eq!((&*recording.dead, &*recording.cells), (&[1][..], &[1.0, 0.0, 3.0, 4.0, 5.0, 0.0, 7.0, 8.0][..]));
    let got = complaints(read(text.replace("nan", "6").as_bytes(), "", &sized(2, 2)));
    assert_eq!(got, [(2, "this cell is a number, but it is NaN in the first frame".into())]);
    let got = complaints(read(text.replace('7', "nan").as_bytes(), "", &sized(2, 2)));
    assert_eq!(got, [(2, "this cell is NaN, but it is a number in the first frame".into())]);
}

#[test]
fn a_mistake_has_its_line_and_message() {
    let cases = [
        ("5,6,7,8", "5,6,7,eight", 4, "this cell is not a number: `eight`"),
        ("5,6,7,8", "5,6,7", 4, "frame 2 has 5 columns, not 6"),
        ("5,6,7,8", "5,6,7,8,9", 4, "frame 2 has 7 columns, not 6"),
        ("5,6,7,8", "5,,7,8", 4, "this cell is NaN, but it is a number in the first frame"),
        ("5,6,7,8", "5,6,7,1e300", 4, "this cell is too large"),
        ("0.75", "0.25", 4, "the time goes back"),
        ("1.0,", "0.6,", 5, "the time goes back"),
        ("2.5", "nan", 4, "a force must be a number"),
        ("force", "time", 2, "`time` appears twice"),
        ("time", "time_fortnights", 2, "the unit of a time must be `s`, `ms`, `us` or `ns`"),
        ("force", "force_kn", 2, "the unit of `force` must be `N`"),
        ("r1c1", "r1c0", 2, "the names reach 2 rows by 2 columns, but there are 4 names but"),
        ("r1c1", "r1", 2, "`r1` has no row and column, but other names do"),
        ("r1c1", "r2c1", 2, "the names reach 3 rows by 2 columns, but there are 4 names"),
        ("r0c0,r0c1,", "r5c0,r5c1,", 2, "the names reach 5 rows by 2 columns, but there are 4 names"),
    ];
    let cases: Vec<_> = cases.into_iter().filter(|case| !case.3.ends_with(" but")).collect();
    check_damages(&named(), "", &hints(), &cases);
    let twice = named().replace("r1c1", "r1c0");
    assert_eq!(complaints(read(twice.as_bytes(), "", &hints())), [(2, "row 1 and column 0 appear twice".into())]);

    let blocks = "1,2,3\n4,5,6\n\n7,8,9\n10,11,12\n\n0,0,0\n0,0,0\n";
    let unsized_ = Hints { rate_hz: Some(100.0), ..hints() };
    let cases = [
        ("\n0,0,0\n0", "0,0,0\n0", 6, "frame 2 has more than 2 rows"),
        ("\n10,11,12\n\n0,0,0\n0,0,0\n", "", 4, "frame 2 ends after 1 of its 2 rows: the file is cut off"),
        ("10,11,12", "10,11", 5, "row 2 of frame 2 has 2 cells, not 3"),
        ("7,8,9\n", "7,8,9\n\n", 5, "frame 2 ends after 1 of its 2 rows"),
    ];
    check_damages(blocks, "", &unsized_, &cases);
    let got = complaints(read(blocks.as_bytes(), "", &sized(4, 4)));
    assert_eq!(got[0].1, "the first row has 3 numbers: this is neither a frame of 4 by 4 tactels nor a row of one");
}

#[test]
fn a_missing_property_is_named() {
    let bare = named().replace("time,", "").replace("0.5,1", "1").replace("0.75,2", "2").replace("1.0,3", "3");
    let all = "the file does not give the unit of its values, or the pitch of its tactels, or its frame rate";
    for (hints, message) in [(Hints::default(), all), (hints(), "the file does not give its frame rate")] {
        assert_eq!(complaints(read(bare.as_bytes(), "", &hints)), [(0, message.into())]);
    }
    let hints = Hints { rate_hz: Some(50.0), ..hints() };
    assert_eq!(read(bare.as_bytes(), "", &hints).unwrap().frames[2].time, 40_000_000);
    assert_eq!(complaints(read(named().as_bytes(), "", &hints)).len(), 1, "the times say 4 a second");
}

#[test]
fn other_texts_are_not_csv() {
    let others = [
        "",
        "hello",
        "name = 3\n",
        "[package]\nname = \"x\"\n",
        "1\n2\n3\n",
        "a,b\nc,d\n1,2\n",
        "a b c\n1,2,3\n",
        "\u{89}PNG\r\n1,2,3",
        "<robot>\n1,2",
    ];
    for text in others {
        assert_eq!(read(text.as_bytes(), "x.csv", &hints()), Err(Refusal::Stranger), "{text}");
    }
}

#[test]
fn a_first_row_longer_than_the_head_is_recognised() {
    let names: Vec<String> = (0..16_384).map(|i| format!("t{}_{}", i / 128, i % 128)).collect();
    let row = vec!["0"; 16_384].join(",");
    let text = format!("{}\n{row}\n{row}\n", names.join(","));
    let recording = read(text.as_bytes(), "big.csv", &Hints { rate_hz: Some(1.0), ..hints() }).unwrap();
    assert_eq!((recording.shape.rows, recording.shape.cols), (128, 128));
    let row = vec!["0.25"; 16_384].join(",");
    let recording = read(format!("{row}\n{row}").as_bytes(), "", &sized(128, 128)).unwrap();
    assert_eq!(recording.frames.len(), 2);
}

#[test]
fn a_damaged_file_is_refused_or_gives_a_sound_recording() {
    let refused = count_refused(&[named().as_bytes()], "", &hints(), 2000);
    assert!((1000..2000).contains(&refused), "{refused}");
    let refused = count_refused(&[b"1,2,3\n4,5,6\n\n7,8,9\n10,11,12\n"], "", &sized(2, 3), 2000);
    assert!((1000..2000).contains(&refused), "{refused}");
}

#[test]
fn names_with_axes_are_of_a_pad_with_three() {
    let names = "time,t0_0_x,t0_0_y,t0_0_z,t0_1_x,t0_1_y,t0_1_z,t0_2_x,t0_2_y,t0_2_z";
    let text = format!("{names}\n0.0,1,2,3,4,5,6,7,8,9\n0.1,-1,-2,30,-4,-5,60,-7,-8,90\n");
    let recording = read(text.as_bytes(), "press.csv", &hints()).unwrap();
    assert!(recording.is_sound() && (recording.shape.rows, recording.shape.cols) == (1, 3));
    let mut vectors = [[0.0; 3]; 3];
    recording.show_vectors(1, &mut vectors);
    assert_eq!(vectors, [[-1.0, -2.0, 30.0], [-4.0, -5.0, 60.0], [-7.0, -8.0, 90.0]]);
    assert_eq!(recording.cells, [3.0, 6.0, 9.0, 30.0, 60.0, 90.0], "the image is z");
    // Any order, and other names.
    let other = "time,r1c3z,r1c1x,r1c1y,r1c1z,r1c2z,r1c2x,r1c2y,r1c3x,r1c3y";
    let other = format!("{other}\n0.0,9,1,2,3,6,4,5,7,8\n0.1,90,-1,-2,30,60,-4,-5,-7,-8\n");
    assert_eq!(read(other.as_bytes(), "press.csv", &hints()).unwrap(), recording);
    // A tactel that does not exist, and names of a pad with one axis.
    let dead = text.replace("\n0.0,1,2,3", "\n0.0,nan,nan,nan").replace("\n0.1,-1,-2,30", "\n0.1,,,");
    assert_eq!(read(dead.as_bytes(), "press.csv", &hints()).unwrap().dead, [0]);
    let single = "time,t0_0_z,t0_1_z,t0_2_z\n0.0,3,6,9\n0.1,30,60,90\n";
    let single = read(single.as_bytes(), "press.csv", &hints()).unwrap();
    assert!(single.drag.is_empty() && single.cells == recording.cells);
    let cases = [
        (text.replace("t0_2_z", "t0_2"), "only some names end with an axis (x, y or z)"),
        (text.replace("t0_2_y", "t0_2_x"), "row 0 and column 2 with the axis x appear twice"),
        (
            text.replace("t0_2_", "t1_2_"),
            "the names reach 2 rows by 3 columns with three axes each, but there are 9 names",
        ),
        (text.replace("0.1,-1", "0.1,nan"), "an x or a y is not a number"),
    ];
    for (text, message) in cases {
        let found = complaints(read(text.as_bytes(), "press.csv", &hints()));
        assert!(found.iter().any(|(_, found)| found.contains(message)), "{message}: {found:?}");
    }
}
