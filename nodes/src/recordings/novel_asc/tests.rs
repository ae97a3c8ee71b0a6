//! Tests of novel's text: files of a known pressure with the forces as the oracle, and damaged copies.

use std::fmt::Write as _;

use tactflow_runtime::signal::ImageShape;

use super::*;
use crate::recordings::testing::{check_damages, complaints, count_refused};

/// Three moments of a mat of 3 columns and 2 rows, numbered down the columns, in which sensor 6 is missing.
const SMALL: &str = "\
file name: small.mat date/time 17.06.23 15.21
mat type s2160_001
total times [secs]: 44.458 time per frame [secs]: 0.04000 scanning rate [Hz]: 25
pressure values in kPa


electrical:
time[secs]       1       2       3       4       5
    5.80000   0.000  10.000   0.000   0.000   0.000
    5.84000   1.000   2.000   3.000   4.000   5.000
    5.88000   0.000   0.000   0.000   0.000  20.000
        MVP   0.333   4.000   1.000   1.333   8.333
        MPP   1.000  10.000   3.000   4.000  20.000


 time[secs] force[N]   x[cm]   y[cm]

    5.76000    0.000       -       -
    5.80000    0.500   0.250   0.500
    5.84000    0.750   0.817   1.100
    5.88000    1.000   1.250   1.500


sensor        1        2        3        4        5
corner[cm]
x[0]   0.0000   0.0000   0.5000   0.5000   1.0000
y[0]   2.0000   1.0000   2.0000   1.0000   2.0000
x[1]   0.0000   0.0000   0.5000   0.5000   1.0000
y[1]   1.0000   0.0000   1.0000   0.0000   1.0000
x[2]   0.5000   0.5000   1.0000   1.0000   1.5000
y[2]   1.0000   0.0000   1.0000   0.0000   1.0000
x[3]   0.5000   0.5000   1.0000   1.0000   1.5000
y[3]   2.0000   1.0000   2.0000   1.0000   2.0000
x[c]   0.2500   0.2500   0.7500   0.7500   1.2500
y[c]   1.5000   0.5000   1.5000   0.5000   1.5000
area   0.5000   0.5000   0.5000   0.5000   0.5000
";

fn read_hinted(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    crate::recordings::read(text.as_bytes(), "mat.asc", hints)
}

fn parse(text: &str) -> Result<Recording, Refusal> {
    read_hinted(text, &Hints::default())
}

#[test]
fn a_small_mat_in_every_notation() {
    let recording = parse(SMALL).unwrap();
    let ImageShape { rows, cols, pitch, unit } = recording.shape.clone();
    assert_eq!((rows, cols, pitch, unit.to_string().as_str()), (2, 3, [0.005, 0.01], "kPa"));
    assert_eq!(recording.cells[6..12], [2.0, 4.0, 0.0, 1.0, 3.0, 5.0], "row 0 is at the lowest y");
    assert_eq!(recording.dead, [2]);
    let times: Vec<i64> = recording.frames.iter().map(|frame| frame.time / 1000).collect();
    assert_eq!((times.as_slice(), recording.period), ([0, 40_000, 80_000].as_slice(), 0.04));
    let tabs = |line: &str| line.split_whitespace().collect::<Vec<_>>().join("\t") + "\t\n";
    let times = [("5.76000", "5760"), ("5.80000", "5800"), ("5.84000", "5840"), ("5.88000", "5880.0")];
    let milliseconds = times.iter().fold(SMALL.replace("time[secs]", "time[ms]"), |text, (s, ms)| text.replace(s, ms));
    let (head, rest) = SMALL.split_at(SMALL.find("time[secs]  ").unwrap());
    let same = [
        SMALL.replace('\n', "\r\n"),
        SMALL.replace('.', ","),
        SMALL.replace("time per frame [secs]: 0.04000 ", ""),
        SMALL
            .replace("[cm]", "[mm]")
            .replace("0.5000", "5")
            .replace("1.0000", "10")
            .replace("1.5000", "15")
            .replace("2.0000", "20"),
        head.to_owned() + &rest.lines().map(tabs).collect::<String>(),
        SMALL[..SMALL.find("area").unwrap()].into(),
        SMALL[..SMALL.find("x[c]").unwrap()].into(),
        SMALL.replace("0.750", "0.751"),
        milliseconds,
        SMALL.replace("electrical:", "mask definition:\nheel: 1,2").replace("0.750", "0.250"),
    ];
    for text in same {
        assert_eq!(parse(&text).as_ref(), Ok(&recording), "{text}");
    }
}

#[test]
fn the_centre_of_force_is_where_the_file_says_it_is() {
    let recording = parse(SMALL).unwrap();
    let forces = SMALL.split("y[cm]").nth(1).unwrap().split("sensor").next().unwrap();
    let mut checked = 0;
    for line in forces.lines().filter(|line| line.contains('.') && !line.contains('-')) {
        let figures: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        let mut image = [0.0; 6];
        recording.show(checked, &mut image);
        let sum: f64 = image.iter().map(|cell| f64::from(*cell)).sum();
        let mean =
            |place: &dyn Fn(usize) -> f64| (0..6).map(|cell| f64::from(image[cell]) * place(cell)).sum::<f64>() / sum;
        // Half a square centimetre at 1 kPa is 0.05 N.
        assert!((0.05 * sum - figures[1]).abs() < 5.1e-4, "{line}");
        assert!((mean(&|cell| (cell % 3) as f64 * 0.5 + 0.25) - figures[2]).abs() < 5.1e-4, "{line}");
        assert!((mean(&|cell| (cell / 3) as f64 + 0.5) - figures[3]).abs() < 5.1e-4, "{line}");
        checked += 1;
    }
    assert_eq!(checked, 3);
}

/// A mat of 28 columns and 29 rows whose sensors are numbered as on a large mat: 4 to 32, 36 to 64, …
fn large(pressures: &[(usize, f64)]) -> String {
    let sensors: Vec<(usize, usize)> = (0..28).flat_map(|col| (0..29).map(move |row| (col, row))).collect();
    let mut text = SMALL[..SMALL.find("time[secs]  ").unwrap()].replace("0.04000", "0.04167").replace("25\n", "24\n");
    let line = |text: &mut String, first: &str, value: &dyn Fn(usize) -> String| {
        let fields: Vec<String> = (0..sensors.len()).map(value).collect();
        let _ = writeln!(text, "{first} {}", fields.join(" "));
    };
    line(&mut text, "time[secs]", &|k| (32 * sensors[k].0 + sensors[k].1 + 4).to_string());
    let pressure = |k: usize| pressures.iter().find(|(sensor, _)| *sensor == k).map_or(0.0, |(_, pressure)| *pressure);
    line(&mut text, "5.79167", &|k| format!("{:.3}", pressure(k)));
    let sum: f64 = pressures.iter().map(|(_, pressure)| pressure).sum();
    let _ = writeln!(text, "\n time[secs] force[N] x[cm] y[cm]\n\n 5.79167 {:.3} 0 0\n", sum * 0.0528 * 1.028);
    line(&mut text, "sensor", &|k| (32 * sensors[k].0 + sensors[k].1 + 4).to_string());
    text.push_str("corner[cm]\n");
    for (corner, (right, top)) in [(0, 1), (0, 0), (1, 0), (1, 1)].into_iter().enumerate() {
        line(&mut text, &format!("x[{corner}]"), &|k| format!("{:.4}", 0.528 * (sensors[k].0 + right) as f64));
        line(&mut text, &format!("y[{corner}]"), &|k| format!("{:.4}", 1.028 * (28 - sensors[k].1 + top) as f64));
    }
    line(&mut text, "x[c]", &|k| format!("{:.4}", 0.528 * (sensors[k].0 as f64 + 0.5)));
    line(&mut text, "y[c]", &|k| format!("{:.4}", 1.028 * (28.5 - sensors[k].1 as f64)));
    line(&mut text, "area", &|_| "0.5428".into());
    text
}

#[test]
fn the_corners_give_the_layout_of_a_large_mat() {
    let recording = parse(&large(&[(0, 10.0), (1, 13.333), (29, 55.0), (811, 11.667)])).unwrap();
    assert_eq!((recording.shape.rows, recording.shape.cols, recording.dead.len()), (29, 28, 0));
    assert!((recording.shape.pitch[0] - 0.00528).abs() < 1e-9 && (recording.shape.pitch[1] - 0.01028).abs() < 1e-9);
    let at = |row: usize, col: usize| recording.cells[row * 28 + col];
    assert_eq!((at(28, 0), at(27, 0), at(28, 1), at(0, 27)), (10.0, 13.333, 55.0, 11.667));
    assert!((recording.cells.iter().sum::<f32>() - 90.0).abs() < 1e-4);
}

#[test]
fn a_mat_without_corners_needs_its_size() {
    let text = SMALL.split("\n\n\nsensor").next().unwrap().replace("  0.000  20.000", "  0.000  20.000   7.000");
    let text = text
        .replace("     5\n", "     5     6\n")
        .replace("0.000\n", "0.000   6.000\n")
        .replace("5.000\n", "5.000 0\n");
    let text = text.split("        MVP").next().unwrap();
    assert_eq!(complaints(parse(text)), [(0, "the file does not give its number of rows and columns".into())]);
    let hints = Hints { size: Some([2, 3]), pitch: Some([0.01; 2]), ..Hints::default() };
    assert_eq!(read_hinted(text, &hints).unwrap().cells[6..12], [1.0, 2.0, 3.0, 4.0, 5.0, 0.0]);
    let wrong = Hints { size: Some([2, 4]), ..hints };
    let message = "the file has 6 sensors, not those of 2 rows by 4 columns";
    assert_eq!(complaints(read_hinted(text, &wrong)), [(0, message.into())]);
}

#[test]
fn an_insole_is_refused_with_a_reason() {
    let twice: String = (1..=198).map(|k| format!("\t{:>7}", (k - 1) % 99 + 1)).collect();
    let head = &SMALL[..SMALL.find("electrical").unwrap()];
    let message = "an insole of pedar has no rows and columns: its sensors follow the sole and have different sizes";
    for text in [
        format!("{head}mask definition: \nleft insole: 1,2,3,\nright insole: 1,2,3,\n\ntime[secs]\t1\t2\t1\t2\n"),
        format!("{head}time[secs]    {twice}\t\n"),
    ] {
        assert_eq!(complaints(parse(&text)), [(0, message.into())]);
    }
    let forces = format!("{head}time[secs]    force[N]   x[mm]\n");
    let message = "the file has forces over time, but not the pressures of the sensors";
    assert_eq!(complaints(parse(&forces)), [(7, message.into())]);
}

#[test]
fn a_damaged_file_has_its_line_and_message() {
    let cases: &[(&str, &str, usize, &str)] = &[
        ("0.04000", "0", 3, "`time per frame [secs]:` must be greater than 0"),
        ("0.04000", "x", 3, "`time per frame [secs]:` is not a number: `x`"),
        ("kPa", "stone", 4, "the unit `stone` is unknown"),
        ("pressure values in kPa", "", 0, "the file does not give the unit of its values"),
        ("       4       5\n", "       4       4\n", 8, "a sensor appears twice in this line"),
        ("       4       5\n", "       4       x\n", 8, "the number of this sensor is not a whole number: `x`"),
        ("time[secs]       1", "secs 1", 16, "the file has forces over time, but not the pressures of the sensors"),
        ("5.84000   1.000", "5.80000   1.000", 10, "the time does not increase"),
        ("5.80000   0", "1e30   0", 9, "the time is not from 0 to 1e9 s: `1e30`"),
        ("  4.000   5.000", "  4.000", 10, "this line has 4 pressures, but there are 5 sensors"),
        ("  4.000   5.000", "  4.000   B", 10, "this pressure is not a number: `B`"),
        ("  4.000   5.000", "  4.000   1e39", 10, "this pressure is too large: `1e39`"),
        ("  4.000   5.000", "  4.000   5.100", 20, "the total force is 0.75 N, but the pressures sum to 0.755 N"),
        ("5.84000    0.750   0.817   1.100", "5.84000", 20, "the force at this time is missing"),
        ("sensor        1", "sensor        9", 24, "these sensors differ from those of the pressures"),
        ("corner[cm]", "corner[ft]", 25, "the unit of the corners must be `cm` or `mm`"),
        ("x[1]   0.0000   0.0000", "x[1]   0.0000", 28, "this line has 4 numbers, but there are 5 sensors"),
        ("x[1]   0.0000", "x[1]   0.0x00", 28, "this figure is not a number: `0.0x00`"),
        ("x[1]   0.0000", "x[1]   -1.000", 36, "the sensors do not form rows and columns of one size"),
        (
            "x[1]   0.0000",
            "z[1]   0.0000",
            36,
            "a sensor has 4 corners, but there are 3 lines of x and 4 of y: it is truncated",
        ),
    ];
    check_damages(SMALL, "mat.asc", &Hints::default(), cases);
    let moved = SMALL.replace("1.0000\ny[0]", "0.5000\ny[0]").replace("1.0000\ny[1]", "0.5000\ny[1]");
    let moved = moved.replace("1.5000\n", "1.0000\n");
    assert_eq!(complaints(parse(&moved)), [(36, "two sensors have the same place".into())]);
    let end = SMALL.find("\nx[c]").unwrap();
    for cut in 0..end {
        // The last number, 2.0000, has the same value from its first digit on.
        let is_number = cut + 6 > end;
        assert!(is_number || !complaints(parse(&SMALL[..cut])).is_empty(), "cut after {cut} bytes");
    }
}

#[test]
fn no_damage_causes_a_panic() {
    let large = large(&[(0, 10.0), (400, 20.0)]);
    let refused = count_refused(&[SMALL.as_bytes(), large.as_bytes()], "mat.asc", &Hints::default(), 4000);
    assert!(refused > 1500, "{refused} of 4000 were seen to be damaged");
}
