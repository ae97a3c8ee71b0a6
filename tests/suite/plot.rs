//! What is made of a recorded run: figures of its ports, and the recording of its pad.

use std::fs;

use crate::cli::in_new_folder;
use crate::tool::{peer, say};

/// Records a run of the hybrid task as .mcap, .csv and .ndjson. Returns the folder and the paths.
fn recorded() -> (tempfile::TempDir, [String; 3]) {
    let (folder, mcap) = in_new_folder("run.mcap");
    let [csv, ndjson] = ["csv", "ndjson"].map(|ending| mcap.replace("mcap", ending));
    for (out, more) in [(&csv, vec!["--record", &mcap]), (&ndjson, vec![])] {
        let args = [&["run", "graphs/hybrid.toml", "--for", "2s", "--quiet", "--out", out], &more[..]].concat();
        let said = say(&args);
        assert_eq!((said.code, said.err.as_str()), (0, ""));
    }
    (folder, [mcap, csv, ndjson])
}

const PORTS: [&str; 3] = ["touch.moments.x", "touch.moments.y", "pid.control"];

#[test]
fn a_figure_is_the_same_from_every_file_of_a_run() {
    let (_folder, files) = recorded();
    let figures = files.each_ref().map(|file| {
        let out = format!("{file}.svg");
        let said = say(&[&["plot", file, "--out", &out], &PORTS[..]].concat());
        assert_eq!((said.code, said.err.as_str()), (0, ""));
        assert!(said.out.ends_with(": 5 curves over 501 ticks\n"), "{}", said.out);
        fs::read_to_string(out).unwrap().replace(file.as_str(), "FILE")
    });
    assert!(figures[0] == figures[1] && figures[1] == figures[2]);
    let figure = &figures[0];
    // Three units are three panels, each with the names of the modes and the band of the second.
    for (text, count) in [(">approach<", 3), (">servo<", 3), ("class=\"band\"", 3), (">time [s]<", 1)] {
        assert_eq!(figure.matches(text).count(), count, "{text}");
    }
    for unit in ["[m]", "[m/s]", "[N/tactel/s]"] {
        assert_eq!(figure.matches(&format!(">{unit}<")).count(), 1, "{unit}");
    }
}

#[test]
fn a_part_of_a_run_is_drawn_and_mistakes_are_told() {
    let (_folder, [mcap, csv, _]) = recorded();
    let out = csv.replace(".csv", ".svg");
    let part = say(&["plot", &csv, "pid.control.x", "--from", "1s", "--for", "500ms", "--out", &out]);
    assert!(part.out.ends_with(": 1 curve over 126 ticks\n"), "{}{}", part.out, part.err);
    let png = out.replace(".svg", ".png");
    let cases: [(&[&str], &str); 6] = [
        (&[&csv, "pid.contrl", "--out", &out], "the file has no column `pid.contrl`: "),
        (&[&csv, "zebra.stripes", "--out", &out], "columns are of `mode`, `halted`, `arm`"),
        (&[&csv, "pid.control", "--out", &png], "does not end in .svg: write `--out "),
        (&[&csv, "pid.control", "--out", &csv], "does not end in .svg"),
        (&[&mcap, "pid.control", "--from", "9s", "--out", &out], "there is nothing to draw: "),
        (&["graphs/hybrid.toml", "pid.control", "--out", &out], "is no recorded run: give a .mcap"),
    ];
    for (args, message) in cases {
        let said = say(&[&["plot"], args].concat());
        assert_eq!(said.code, 2, "{args:?}");
        assert!(said.err.contains(message) && said.out.is_empty(), "{args:?}: {}", said.err);
    }
    fs::write(&out, "do not lose me").unwrap();
    let other = say(&["plot", &csv, "pid.control", "--out", &out]);
    assert!(other.code == 2 && other.err.contains("exists and is not an SVG picture"), "{}", other.err);
}

/// The values of a column, without empty cells.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let text = fs::read_to_string(csv).unwrap();
    let mut rows = text.lines().filter(|line| !line.starts_with('#'));
    let at = rows.next().unwrap().split(',').position(|own| own == name).expect(name);
    rows.filter_map(|row| row.split(',').nth(at).unwrap().parse().ok()).collect()
}

#[test]
fn the_pad_of_a_run_is_a_recording() {
    let (folder, [mcap, csv, _]) = recorded();
    let features = folder.path().join("features.csv");
    let features = features.to_str().unwrap();
    let said = say(&["features", &mcap, "-o", features]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(said.out.contains("mcap, 16 by 16 tactels of 5 by 5 mm, "), "{}", said.out);
    // The sum of each image is the one of the run: each image was read to the last bit.
    let mut ran = column(&csv, "touch.source.sum");
    let mut read = column(features, "touch.source.sum");
    ran.dedup();
    read.dedup();
    assert!(ran.len() > 300 && ran == read, "{} and {}", ran.len(), read.len());
    // Another graph runs on it.
    let bench = folder.path().join("yesterday.toml");
    fs::write(&bench, format!("[bind]\npad = \"file\"\n[devices.file]\ntype = \"recording\"\nfile = \"{mcap}\"\n"))
        .unwrap();
    let graph = folder.path().join("look.toml");
    let text = "[graph]\nclock = \"pad\"\n[roles]\npad = \"tactile_pad\"\n[parts.touch]\nfile = \"builtin:parts/touch.toml\"\n\
                in.image = \"pad.image\"\nset.binarize.threshold = 0.02\n";
    fs::write(&graph, text).unwrap();
    let out = folder.path().join("look.csv");
    let [graph, bench, out] = [&graph, &bench, &out].map(|path| path.to_str().unwrap());
    let run = say(&["run", graph, "--bench", bench, "--out", out]);
    assert_eq!(run.code, 0, "{}", run.err);
    let mut seen = column(out, "touch.source.sum");
    seen.dedup();
    assert_eq!(seen, ran);
    assert!(peer("rows.py", &[out]).contains(" rows, "));
}

#[test]
fn a_recording_that_cannot_be_a_pad_is_told() {
    let (folder, [mcap, ..]) = recorded();
    let bare = folder.path().join("bare.mcap");
    let bare = bare.to_str().unwrap();
    let set = ["--set", "record.images=false", "--record", bare];
    assert_eq!(say(&[&["run", "graphs/hybrid.toml", "--for", "1s", "--quiet"], &set[..]].concat()).code, 0);
    let cut = folder.path().join("cut.mcap");
    fs::write(&cut, &fs::read(&mcap).unwrap()[..20_000]).unwrap();
    let cut = cut.to_str().unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&["features", bare], "the recording has no images of a pad"),
        (&["features", &mcap, "--pad", "left"], "the recording has images of `pad`"),
        (&["features", &mcap, "--unit", "kPa"], "the file has another value: "),
        (&["calibrate", &mcap], "it has no reference force: name the port that measured it, as `--force truth.force`"),
        (&["calibrate", &mcap, "--force", "truth.farce"], "the recording has no port `truth.farce`"),
        (&["replay", cut], "was cut before its first tick: it has files of the graph, but nothing of the run"),
    ];
    for (args, message) in cases {
        let said = say(args);
        assert_eq!(said.code, 2, "{args:?}: {}", said.out);
        assert!(said.err.contains(message), "{args:?}: {}", said.err);
    }
}
