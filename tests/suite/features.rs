//! `features`: any recording as a table of features, from the command line alone.

use std::fs;

use crate::tool::{peer, said, say, tool};

const PRESS: &str = "graphs/recordings/pressuRe/iscan_test.csv";

#[test]
fn a_recording_becomes_a_table_a_row_a_frame() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("features.csv");
    let path = path.to_str().unwrap();
    let said = say(&["features", PRESS, "-o", path]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let [read, contact] = [0, 1].map(|line| said.out.lines().nth(line).unwrap());
    assert!(read.contains("28 by 28 tactels of 1.27 by 1.27 mm, 309 frames in 31.10 s, in raw"), "{read}");
    assert!(contact.ends_with("at least 4 tactels above 3.0000 raw (from the file)"), "{contact}");
    assert!(peer("rows.py", &[path]).starts_with("309 rows, "));
    let table = fs::read_to_string(path).unwrap();
    let mut rows = table.lines().filter(|line| !line.starts_with('#'));
    let at = rows.next().unwrap().split(',').position(|name| name == "touch.source.sum").unwrap();
    let sums: Vec<f64> = rows.map(|row| row.split(',').nth(at).unwrap().parse().unwrap()).collect();
    let recorded = fs::read_to_string(tactflow_tests::workspace().join(PRESS)).unwrap();
    let vendor: Vec<f64> = recorded.lines().filter_map(|line| line.split("Raw Sum=,,").nth(1)?.parse().ok()).collect();
    assert_eq!(sums, vendor, "the sum of each frame is the vendor's");
}

#[test]
fn every_recording_that_ships_is_read_as_it_is() {
    let cases = [
        ("pressuRe/emed_test.zip", "novel-lst, 95 by 64 tactels of 5 by 5 mm, 106 frames in 1.05 s, in kPa"),
        ("pawlabeling/dog1_sel_1.zip", "footscan, 256 by 63 tactels of 5.08 by 7.62 mm, 249 frames in 1.97 s, in N"),
        ("pawlabeling/zebris_gait.zip", "zebris, 56 by 128 tactels of 8.47 by 8.46 mm, 1472 frames in 14.71 s, in kPa"),
    ];
    for (name, headline) in cases {
        let path = format!("graphs/recordings/{name}");
        let said = say(&["features", &path, "--for", "200ms"]);
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{name}");
        assert_eq!(said.out.lines().next(), Some(&*format!("{path}: {headline}")));
    }
}

#[test]
fn the_graph_behind_it_checks_from_any_folder() {
    let graph = say(&["features", PRESS, "--graph", "--threshold", "5", "--min-area", "6"]);
    assert_eq!((graph.code, graph.err.as_str()), (0, ""));
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("press.toml"), &graph.out).unwrap();
    let run = said(tool(&["run", "press.toml", "--for", "2s"]).current_dir(folder.path()));
    assert_eq!((run.code, run.err.as_str()), (0, ""), "{}", graph.out);
    assert!(graph.out.contains("set.binarize.threshold = 5.0 "), "{}", graph.out);
}

#[test]
fn what_is_wrong_is_told_once_with_a_way_out() {
    let cases: [(&[&str], &str); 9] = [
        (&["features", "nowhere.csv"], "cannot read `nowhere.csv`: No such file"),
        (&["features", "Cargo.toml"], "`Cargo.toml` has an unknown format: it begins with `[workspace]`"),
        (&["features", PRESS, "--pitch-mm", "5"], "expected two numbers, as 5x5"),
        (&["features", PRESS, "--pitch-mm", "0x5"], "expected two numbers greater than 0"),
        (&["features", PRESS, "--rate-hz", "0"], "`0` is not a number greater than 0"),
        (&["features", PRESS, "--for", "-1s"], "`-1` is not a number greater than 0"),
        (&["features", PRESS, "--pitch-mm", "5,5"], "the file has another value: [1.27, 1.27] mm"),
        (&["features", PRESS, "--unit", "pounds"], "`pounds` is not a unit"),
        (&["features", PRESS, "--threshold", "nan"], "expected a number"),
    ];
    for (args, message) in cases {
        let said = say(args);
        assert!(said.out.is_empty(), "{args:?}: {}", said.out);
        assert_eq!(said.code, 2, "{args:?}");
        assert_eq!(said.err.lines().filter(|line| line.starts_with("error")).count(), 1, "{}", said.err);
        assert!(said.err.contains(message), "{args:?}: {}", said.err);
    }
}

#[test]
fn what_a_file_leaves_open_is_asked_for_by_the_options_of_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pad.csv");
    fs::write(&path, "1,2,3,4\n2,3,4,5\n").unwrap();
    let path = path.to_str().unwrap();
    let size = say(&["features", path]);
    assert!(size.err.contains("`--size 16x16`"), "{}", size.err);
    let rest = say(&["features", path, "--size", "2x2"]);
    for option in ["`--unit kPa`", "`--pitch-mm 5x5`", "`--rate-hz 250`"] {
        assert!(rest.err.contains(option), "{option}: {}", rest.err);
    }
    let whole = say(&["features", path, "--size", "2x2", "--unit", "kPa", "--pitch-mm", "5x5", "--rate-hz", "250"]);
    assert_eq!((whole.code, whole.err.as_str()), (0, ""));
}

/// The columns of a table of features.
fn columns(args: &[&str], names: [&str; 4]) -> Vec<[f64; 4]> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("features.csv");
    let said = say(&[&["features"], args, &["-o", path.to_str().unwrap()]].concat());
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    let text = fs::read_to_string(&path).unwrap();
    let mut rows = text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let at = names.map(|name| header.iter().position(|column| *column == name).expect(name));
    rows.map(|row| at.map(|i| row[i].parse().unwrap_or(f64::NAN))).collect()
}

#[test]
fn a_pressure_becomes_a_force_and_the_whole_pad_has_a_centre_of_pressure() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.csv");
    // Two regions of 2 by 2 tactels: 40 kPa at the left, and 120 kPa at the right.
    let mut row = [0.0; 36];
    for (corner, value) in [(0, 40.0), (4, 120.0)] {
        for i in 0..2 {
            for j in 0..2 {
                row[(i + 2) * 6 + corner + j] = value;
            }
        }
    }
    let row = row.map(|value: f64| value.to_string()).join(",");
    fs::write(&path, format!("{row}\n{row}\n")).unwrap();
    let path = path.to_str().unwrap();
    let args = [path, "--size", "6x6", "--unit", "kPa", "--pitch-mm", "5x4", "--rate-hz", "100", "--threshold", "10"];
    let found = columns(&args, ["touch.moments.force", "whole.force", "whole.x", "touch.moments.x"]);
    // 1 kPa on 5 by 4 mm is 0.02 N. The centres of the regions are at -10 mm and 10 mm. Of two regions of the same area, the
    // contact is the first.
    let [force, whole, centre, contact] = found[1];
    assert!((force - 4.0 * 40.0 * 0.02).abs() < 1e-6 && (whole - 4.0 * 160.0 * 0.02).abs() < 1e-6, "{force} {whole}");
    assert!((centre - 0.005).abs() < 1e-9 && (contact + 0.01).abs() < 1e-9, "{centre} {contact}");
    let said = say(&[&["features"], &args[..]].concat());
    assert!(
        said.out.contains("above 10.0000 kPa (from --threshold)\nforces: in N, of the pressure on 0.2000 cm2"),
        "{}",
        said.out
    );
}

#[test]
fn every_region_has_its_columns_and_the_picture_shows_the_way() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.csv");
    // Two regions, of 2 by 3 and of 2 by 2 tactels; the second is lifted in the last frame.
    let frame = |second: u32| {
        let cell = |i: usize| match (i / 8, i % 8) {
            (1 | 2, 0..=2) => 10,
            (1 | 2, 5 | 6) => second,
            _ => 0,
        };
        (0..32).map(|i| cell(i).to_string()).collect::<Vec<_>>().join(",")
    };
    fs::write(&path, format!("{}\n{}\n{}\n", frame(30), frame(30), frame(0))).unwrap();
    let svg = folder.path().join("two.svg");
    let (path, svg) = (path.to_str().unwrap(), svg.to_str().unwrap());
    let args = [path, "--size", "4x8", "--unit", "N", "--pitch-mm", "5x5", "--rate-hz", "100", "--threshold", "1"];
    let all = [&args[..], &["--regions", "all", "--svg", svg]].concat();
    let found = columns(&all, ["regions.count", "region1.force", "region2.force", "region2.x"]);
    assert_eq!(found[1], [2.0, 60.0, 120.0, 0.010]);
    assert!(found[2][..2] == [1.0, 60.0] && found[2][2].is_nan(), "{found:?}");
    let picture = fs::read_to_string(svg).unwrap();
    for text in [">force [N]<", ">x [mm]<", ">y [mm]<", ">time [s]<", "class=\"first\"", "class=\"last\""] {
        assert!(picture.contains(text), "{text}");
    }
    // Without a table, the picture is the only file, and the same.
    let alone = folder.path().join("alone.svg");
    let alone = alone.to_str().unwrap();
    let said = say(&[&["features"], &args[..], &["--regions", "all", "--svg", alone]].concat());
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(!said.out.contains("rows.csv") && said.out.ends_with(&format!("wrote {alone}\n")), "{}", said.out);
    assert_eq!(fs::read_to_string(alone).unwrap(), picture);
    let noisy = say(&[&["features"], &args[..], &["-o", "-", "--svg", alone]].concat());
    assert!(noisy.code == 2 && noisy.err.contains("write `-o features.csv`"), "{}", noisy.err);
}

#[test]
fn a_table_states_the_threshold() {
    let folder = tempfile::tempdir().unwrap();
    for ending in ["csv", "ndjson"] {
        let path = folder.path().join(format!("features.{ending}"));
        assert_eq!(say(&["features", PRESS, "--for", "1s", "-o", path.to_str().unwrap()]).code, 0);
        let text = fs::read_to_string(path).unwrap();
        assert!(text.contains("at least 4 tactels above 3.0000 raw (from the file)"), "{ending}");
    }
}

#[test]
fn times_without_a_unit_that_can_hardly_be_seconds_are_asked_about() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("times.csv");
    let name = path.to_str().unwrap();
    let args = ["features", name, "--unit", "N", "--pitch-mm", "5x5", "--threshold", "1"];
    let write = |name: &str, times: [&str; 2]| {
        let rows = times.map(|time| format!("{time},1,2,3,4\n"));
        fs::write(&path, format!("{name},t0_0,t0_1,t1_0,t1_1\n{}", rows.concat())).unwrap();
    };
    for (times, unit, headline) in [
        (["0", "10"], "ms", "2 frames in 0.01 s"),
        (["1764000000000000000", "1764000000020000000"], "ns", "2 frames in 0.02 s"),
        (["0", "5"], "s", "2 frames in 5.00 s"),
    ] {
        write("timestamp", times);
        let asked = say(&args);
        assert_eq!(asked.code, 2, "{times:?}");
        let message = "`timestamp` has no unit, and can hardly be in seconds: ";
        assert!(asked.err.contains(message) && asked.err.contains("`--time-unit ms`"), "{}", asked.err);
        let said = say(&[&args[..], &["--time-unit", unit]].concat());
        assert!(said.code == 0 && said.out.contains(headline), "{times:?}: {}{}", said.out, said.err);
    }
    write("time", ["0", "0.5"]);
    assert_eq!(say(&args).code, 0, "half a second can be seconds");
    write("time_ms", ["0", "10"]);
    let other = say(&[&args[..], &["--time-unit", "s"]].concat());
    assert!(other.code == 2 && other.err.contains("the name of the column gives another unit"), "{}", other.err);
    let table = say(&["features", PRESS, "--time-unit", "s"]);
    assert!(table.err.contains("only a `csv` file can have times without a unit"), "{}", table.err);
}

#[test]
fn one_of_several_pads_is_selected() {
    let file = "tests/data/recordings/xsensor_insoles.csv";
    let asked = say(&["features", file]);
    assert!(
        asked.code == 2 && asked.err.contains("`tactflow features`: add `--pad \"HX210.11.31.M11-DFM-LF S0073\"`"),
        "{}",
        asked.err
    );
    let [left, right] = ["HX210.11.31.M11-DFM-LF S0073", "HX210.11.31.M11-DFM-RF S0073"]
        .map(|pad| say(&["features", file, "--pad", pad]));
    assert!(left.code == 0 && right.code == 0 && left.out != right.out, "{}{}", left.err, right.err);
}
