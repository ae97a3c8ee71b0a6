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
