//! `tactflow calibrate` as a process, its files as others read them, and what a graph does with them.

use std::fs;
use std::path::Path;

use tactflow_nodes::calibration::{Calibration, file};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::signal::{Freshness, Image, ImageShape, Unit};
use tactflow_tests::{catalogue, workspace};
use tempfile::TempDir;

use crate::tool::{Said, peer, said, tool};

/// A log of a probe on each of four tactels, up and down twice: squashed curves, of which the last is dead.
fn log() -> String {
    let mut text = String::from("time,force,t0_0,t0_1,t1_0,t1_1\n");
    let mut frames = 0;
    let mut frame = |pressed: usize, force: f64| {
        let cells: Vec<String> = (0..4)
            .map(|i| {
                let of = if i == pressed && i < 3 { force } else { 0.0 };
                let (offset, a, b) = (200.0 + 30.0 * i as f64, 3000.0 + 400.0 * i as f64, 2.0 + 0.5 * i as f64);
                format!("{}", (offset + a * of / (of + b)).round())
            })
            .collect();
        text.push_str(&format!("{:.2},{force:.4},{}\n", f64::from(frames) * 0.01, cells.join(",")));
        frames += 1;
    };
    for pressed in 0..4 {
        (0..10).for_each(|_| frame(pressed, 0.0));
        for k in (1..=60).chain((0..60).rev()).chain(1..=60).chain((0..60).rev()) {
            frame(pressed, f64::from(k) / 12.0);
        }
    }
    text
}

/// A log of a bladder on three live tactels and a dead one, up and down twice.
fn bladder() -> String {
    let mut text = String::from("time,force,t0_0,t0_1,t1_0,t1_1\n");
    let forces = std::iter::repeat_n(0, 10).chain((0..2).flat_map(|_| (1..=60).chain((0..60).rev())));
    for (frame, k) in forces.enumerate() {
        let force = f64::from(k) / 12.0;
        let read = |i: f64| (200.0 + (3000.0 + 400.0 * i) * force / (force + 2.0 + 0.5 * i)).round();
        text.push_str(&format!(
            "{:.2},{:.4},{},{},{},200\n",
            frame as f64 * 0.01,
            3.0 * force,
            read(0.0),
            read(1.0),
            read(2.0)
        ));
    }
    text
}

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
    folder
}

fn calibrate(folder: &Path, args: &[&str]) -> Said {
    said(tool(&[&["calibrate"], args].concat()).current_dir(folder))
}

fn read(path: &Path) -> Calibration {
    file::read(&fs::read_to_string(path).unwrap()).unwrap_or_else(|flaws| panic!("{flaws:?}"))
}

#[test]
fn a_log_becomes_a_report_a_file_and_a_picture() {
    let folder = folder(&[("press.csv", &log())]);
    let path = folder.path();
    let only = calibrate(path, &["press.csv"]);
    assert_eq!((only.code, only.err.as_str()), (0, ""));
    for part in
        ["3 of 2 x 2 tactels calibrated, readings in raw", "* rational", "dead         1 do not respond: [1, 1]"]
    {
        assert!(only.out.contains(part), "no {part:?} in\n{}", only.out);
    }
    assert_eq!(fs::read_dir(path).unwrap().count(), 1, "nothing is written unless it is asked for");
    let made = calibrate(path, &["press.csv", "-o", "pad.toml", "--svg", "pad.svg", "--each"]);
    assert_eq!((made.code, made.err.as_str()), (0, ""));
    assert!(made.out.contains("every tactel, rational curve") && made.out.contains("wrote pad.toml"));
    let calibration = read(&path.join("pad.toml"));
    assert_eq!((calibration.rows, calibration.cols, calibration.unit), (2, 2, Unit::NEWTON));
    let tactel = calibration.tactels[2].as_ref().unwrap();
    // It has a = 3800 and b = 3: 2 N are read as 1520 beyond 260.
    let force = tactel.curve.force(260.0 + 1520.0 - tactel.offset);
    assert!((force - 2.0).abs() < 0.01, "{force} N for 2 N");
    assert!(fs::read_to_string(path.join("pad.svg")).unwrap().starts_with("<svg "));
    let again = calibrate(path, &["press.csv", "-o", "pad.toml", "--curve", "piecewise"]);
    assert_eq!(again.code, 0, "a calibration file is replaced: {}", again.err);
    assert_eq!(read(&path.join("pad.toml")).kind, tactflow_nodes::calibration::CurveKind::Piecewise);
}

#[test]
fn two_logs_are_taken_together() {
    let log = log();
    let (head, rest) = log.split_once('\n').unwrap();
    let lines: Vec<&str> = rest.lines().collect();
    let part = |lines: &[&str]| format!("{head}\n{}\n", lines.join("\n"));
    let folder = folder(&[("a.csv", &part(&lines[..500])), ("b.csv", &part(&lines[500..]))]);
    let one = calibrate(folder.path(), &["a.csv"]);
    assert!(one.code == 0 && one.out.contains("2 of 2 x 2 tactels calibrated"), "{}{}", one.out, one.err);
    let both = calibrate(folder.path(), &["a.csv", "b.csv"]);
    assert!(both.code == 0 && both.out.contains("3 of 2 x 2 tactels calibrated"), "{}{}", both.out, both.err);
}

/// The log with the force of each frame beside a frame that came so many earlier.
fn late_by(frames: usize, log: &str) -> String {
    let rows: Vec<Vec<&str>> = log.lines().map(|line| line.splitn(3, ',').collect()).collect();
    let shifted = (1..rows.len() - frames).map(|i| format!("{},{},{}\n", rows[i][0], rows[i][1], rows[i + frames][2]));
    format!("{}\n{}", rows[0].join(","), shifted.collect::<String>())
}

#[test]
fn what_cannot_be_used_is_refused_with_exit_code_2() {
    let log = log();
    let rows = log.lines().map(|line| line.splitn(3, ',').collect::<Vec<_>>());
    let forceless: String = rows.map(|row| format!("{},{}\n", row[0], row[2])).collect();
    let loaded: String =
        log.lines().filter(|line| !line.contains(",0.0000,")).map(|line| format!("{line}\n")).collect();
    let wide = log.replacen("t0_0,t0_1,t1_0,t1_1", "t0_0,t0_1,t0_2,t0_3", 1);
    let torn = log.replacen("0.03,0.0000,", "0.03,x,", 1);
    // The force of each frame stands beside a frame that came 30 earlier.
    let late = late_by(30, &log);
    let bladder = bladder();
    let files = [
        ("press.csv", log.as_str()),
        ("forceless.csv", &forceless),
        ("loaded.csv", &loaded),
        ("wide.csv", &wide),
        ("torn.csv", &torn),
        ("late.csv", &late),
        ("bladder.csv", &bladder),
        ("notes.txt", "do not lose me"),
    ];
    let folder = folder(&files);
    let cases: [(&[&str], &str); 14] = [
        (&["nowhere.csv"], "error: cannot read `nowhere.csv`"),
        (&["forceless.csv"], "error: `forceless.csv` cannot be used: it has no reference force"),
        (&["loaded.csv"], "error: `loaded.csv` cannot be used: only 0 of its frames are unloaded"),
        (&["torn.csv"], "torn.csv:5:"),
        (
            &["press.csv", "wide.csv"],
            "error: all logs must be of one pad, but `wide.csv` has 1 x 4 tactels in raw and `press.csv` has 2 x 2",
        ),
        (
            &["press.csv", "-o", "notes.txt"],
            "error: `notes.txt` exists and is not a calibration file, so it is not replaced: write to another file",
        ),
        (&["press.csv", "-o", "press.csv"], "error: `press.csv` exists and is not a calibration file"),
        (&["press.csv", "--svg", "notes.txt"], "error: `notes.txt` exists and is not an SVG picture"),
        (
            &["press.csv", "--load", "uniform", "-o", "new.toml"],
            "error: no tactel can be calibrated: 1 tactels do not respond",
        ),
        (&["late.csv", "-o", "new.toml"], "% of the range, so no file is written"),
        (&["bladder.csv", "-o", "new.toml"], "most tactels respond equally to most presses"),
        (&["press.csv", "--bearing", "4"], "error: `--bearing` needs `--load uniform`"),
        (&["press.csv", "--curve", "cubic"], "invalid value 'cubic'"),
        (&["press.csv", "--dead-below", "0"], "`0` is not a number greater than 0"),
    ];
    for (args, message) in cases {
        let said = calibrate(folder.path(), args);
        assert_eq!(said.code, 2, "{args:?}: {}{}", said.out, said.err);
        assert!(said.err.contains(message), "{args:?}: {}", said.err);
    }
    for (name, text) in files {
        assert_eq!(fs::read_to_string(folder.path().join(name)).unwrap(), text, "{name} is as it was");
    }
    assert!(!folder.path().join("new.toml").exists());
}

#[test]
fn python_reads_the_file_and_gets_the_same_forces() {
    let folder = folder(&[("press.csv", &log())]);
    for curve in ["linear", "rational", "piecewise"] {
        let said = calibrate(folder.path(), &["press.csv", "-o", "pad.toml", "--curve", curve]);
        assert_eq!(said.code, 0, "{}", said.err);
        let path = folder.path().join("pad.toml");
        let calibration = read(&path);
        for reading in ["0", "250", "900.5", "1700", "4095"] {
            let theirs = peer("calibration.py", &[path.to_str().unwrap(), reading]);
            let ours = calibration.tactels.iter().map(|tactel| {
                tactel
                    .as_ref()
                    .map_or(0.0, |tactel| tactel.curve.force(reading.parse::<f32>().unwrap() - tactel.offset))
            });
            for (theirs, ours) in theirs.split_whitespace().zip(ours) {
                let theirs: f64 = theirs.parse().unwrap();
                assert!((theirs - f64::from(ours)).abs() < 1e-4, "{curve} at {reading}: {theirs} against {ours}");
            }
        }
    }
}

/// The block of docs/calibration.md that is fenced with exactly `fence`.
fn block(fence: &str) -> String {
    let page = fs::read_to_string(workspace().join("docs/calibration.md")).unwrap();
    let (_, rest) = page.split_once(&format!("\n```{fence}\n")).unwrap_or_else(|| panic!("no block of {fence}"));
    rest.split_once("\n```").unwrap().0.to_owned() + "\n"
}

#[test]
fn the_page_says_what_is_so() {
    let calibration = file::read(&block("toml")).unwrap_or_else(|flaws| panic!("{flaws:?}"));
    let tactel = calibration.tactels[0].as_ref().unwrap();
    assert!((tactel.curve.force(1460.0 - tactel.offset) - 1.364).abs() < 5e-4);
    let folder = folder(&[("pad.toml", &block("toml")), ("log.csv", &block("csv")), ("press.csv", &log())]);
    let request = Request { text: Some(block("toml graph")), ..Request::file(folder.path().join("graph.toml")) };
    compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    // The few rows that are shown are read: they are only too few.
    let said = calibrate(folder.path(), &["log.csv"]);
    assert!(said.code == 2 && said.err.contains("only 1 of its frames are unloaded"), "{}", said.err);
    let command = block("sh");
    let words: Vec<&str> = command.split_whitespace().skip(2).collect();
    let said = calibrate(folder.path(), &words);
    assert_eq!(said.code, 0, "{}", said.err);
}

#[test]
fn a_mistake_in_the_file_is_shown_in_the_file_and_where_the_graph_names_it() {
    let damaged = block("toml").replacen("gain = 0.0009", "gain = 0", 1);
    let folder = folder(&[("pad.toml", &damaged), ("graph.toml", &block("toml graph"))]);
    let said = said(tool(&["check", "graph.toml"]).current_dir(folder.path()));
    assert_eq!(said.code, 2);
    for part in ["error[bad-data]: a `gain` of 0 gives no force", "pad.toml:12:41", "graph.toml:23:8"] {
        assert!(said.err.contains(part), "no {part:?} in\n{}", said.err);
    }
}

/// The page's graph on a pad that is fed by hand, in a graph four times as fast as the pad.
fn rig(folder: &TempDir) -> GraphRig {
    let text = block("toml graph")
        .replace("clock = \"pad\"", "rate_hz = 1000")
        .replace("tare_at_start = true", "tare_at_start = true\ntare_window = 5");
    let text = text.replace("[bind]\npad = \"pad\"\n", "");
    let (head, tail) = text.split_once("[devices.pad]").unwrap();
    let text = format!("{head}{}", &tail[tail.find("[nodes.source]").unwrap()..]);
    let text = text.replace("\"pad.toml\"", &format!("'{}'", folder.path().join("pad.toml").display()));
    let shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::RAW };
    let pad = FedRole::new("pad", "tactile_pad", 4.0).output("image", shape);
    GraphRig::new(catalogue(), &text, vec![pad]).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

#[test]
fn a_tare_through_the_loop_uses_each_frame_once_and_allocates_nothing() {
    let folder = folder(&[("pad.toml", &block("toml"))]);
    let mut rig = rig(&folder);
    for ms in 0..60 {
        if ms % 4 == 0 {
            // The zero of the first tactel has drifted from 210 to 230, which is 0.015 N.
            rig.feed("pad.image", f64::from(ms), Image::from_cells(2, &[230.0, 305.0, 250.0, 9.0]));
        }
        let now = i64::from(ms) * 1_000_000;
        rig.engine.exchange(now).unwrap();
        let counted = allocation_counter::measure(|| rig.engine.step().unwrap());
        assert_eq!(counted.count_total, 0, "at {ms} ms");
        let expected = if ms % 4 == 0 { Freshness::New } else { Freshness::Held };
        assert_eq!(rig.freshness("calibrate.image"), expected, "at {ms} ms: a loop does not wake itself");
        assert_eq!(rig.age_ms("calibrate.image"), f64::from(ms % 4), "at {ms} ms: nor does it hold its stamp back");
        let first = rig.get::<Image>("calibrate.image").unwrap().cells()[0];
        // Five frames, at 0 to 16 ms, are the zero; it holds from the next.
        assert_eq!(first == 0.0, ms >= 20, "{first} N at {ms} ms");
    }
}
