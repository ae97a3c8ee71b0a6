//! The Python package: a node alone on a recording or an archive, and what a program says when it fails.

use std::fs;
use std::path::Path;
use std::process::Command;

use tactflow_tests::workspace;

use crate::control_law::rows;
use crate::record::has_python_module;
use crate::tool::{Said, said, tool};

/// The force on a pad.
const PRESS: &str = r#"
import tactflow
from tactflow import Flag, Image, Param, Scalar

@tactflow.node
def press(image: Image["N"], floor: Param["N"] = 0.0) -> {"force": Scalar["N"], "touches": Flag}:
    if image is None:
        return {}
    force = float((image.cells - floor).sum())
    return {"force": force, "touches": force > 0.1}

tactflow.main(press)
"#;

/// Runs a program in a folder, with the package beside it.
fn python(folder: &Path, args: &[&str]) -> Said {
    let package = workspace().join("nodes/python");
    said(Command::new("python3").args(args).current_dir(folder).env("PYTHONPATH", package))
}

/// Runs a node of a folder alone.
fn alone(folder: &Path, file: &str, wires: &[&str]) -> Said {
    let wires = wires.iter().flat_map(|wire| ["--wire", wire]);
    python(folder, &["program.py", "--test", file].into_iter().chain(wires).collect::<Vec<_>>())
}

/// Records the hybrid task as `run.mcap`, `run.npz` and `run.csv`.
fn record(folder: &Path) {
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    let [recording, archive, csv] = ["run.mcap", "run.npz", "run.csv"].map(path);
    let recorded =
        said(&mut tool(&["run", "graphs/hybrid.toml", "--for", "1s", "--record", &recording, "--out", &csv]));
    assert_eq!(recorded.code, 0, "{}", recorded.err);
    let exported = said(&mut tool(&["export", &recording, &archive]));
    assert_eq!(exported.code, 0, "{}", exported.err);
}

/// The recordings that Python can read here.
fn files() -> &'static [&'static str] {
    if has_python_module("mcap") { &["run.npz", "run.mcap"] } else { &["run.npz"] }
}

#[test]
fn a_node_alone_gets_only_what_a_graph_would_wire_to_it() {
    if !has_python_module("numpy") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("program.py"), PRESS).unwrap();
    record(folder.path());
    let forces = "touch.calibrate.image [N], touch.calibrate.repaired [N], truth.image [N]\n";
    for file in files() {
        let takes = "the input `image` takes an image in N: write `--wire image=PORT` with one of";
        for (wires, why) in [
            (&["image=pad.image"][..], format!("has `pad.image`, which is an image in raw, but {takes} {forces}")),
            (&["image=truth.force"], format!("has `truth.force`, which is a scalar in N, but {takes} {forces}")),
            (&["image=nothing"], format!("has no port `nothing`, and {takes} {forces}")),
            // `pad.image` and `touch.source.image` have the name too, and are raw.
            (
                &[],
                "has 2 ports `image` for the input `image`, which takes an image in N: write `--wire image=PORT` with \
                 one of touch.calibrate.image [N], truth.image [N]\n"
                    .to_owned(),
            ),
        ] {
            let refused = alone(folder.path(), file, wires);
            assert_eq!((refused.code, refused.out.as_str()), (1, ""), "{wires:?}");
            assert_eq!(refused.err, format!("{file} {why}"));
        }
        for (wire, why) in [
            ("image", "`--wire image` names no port: write `--wire image=PORT`\n"),
            ("imag=pad.image", "`press` has no input `imag`: its inputs are image\n"),
        ] {
            let refused = alone(folder.path(), file, &[wire]);
            assert_eq!((refused.code, refused.err.as_str()), (1, why));
        }
    }
}

#[test]
fn a_node_alone_prints_a_table_with_times_and_units() {
    if !has_python_module("numpy") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("program.py"), PRESS).unwrap();
    record(folder.path());
    let rows = rows(folder.path().join("run.csv").to_str().unwrap());
    for file in files() {
        let tried = alone(folder.path(), file, &["image=truth.image"]);
        assert_eq!((tried.code, tried.err.as_str()), (0, ""), "{}", tried.out);
        let lines: Vec<&str> = tried.out.lines().collect();
        assert!(lines[0].starts_with("image = truth.image [N], 16x16 tactels, pitch 5 mm by 5 mm"), "{}", lines[0]);
        assert_eq!(lines[1], "time [s]  force [N]    touches");
        let table = &lines[2..lines.len() - 1];
        assert!(table.len() > 200 && lines[lines.len() - 1].starts_with(&format!("{} frames; ", table.len())));
        for line in table {
            let [time, force, touches] = line.split_whitespace().collect::<Vec<_>>()[..] else { panic!("{line}") };
            let time: f64 = time.parse().unwrap();
            let row = rows.iter().find(|row| (row["time"] - time).abs() < 1e-6).unwrap();
            // The sum of the tactels is the force that the simulator states.
            let (force, expected): (f64, f64) = (force.parse().unwrap(), row["truth.force"]);
            assert!((force - expected).abs() < 1e-4 * (1.0 + expected), "{file}: {line}, and {expected} N");
            assert_eq!(touches, if force > 0.1 { "true" } else { "false" });
        }
    }
    // The calibration has no image in the first ticks: an export has NaN there, and the node gets None.
    let tried = alone(folder.path(), "run.npz", &["image=touch.calibrate.image"]);
    assert_eq!((tried.code, tried.err.as_str()), (0, ""), "{}", tried.out);
    assert_eq!(tried.out.lines().nth(2), Some("0.0000    -            -"));
}

#[test]
fn an_archive_without_units_is_taken_in_those_of_the_node_and_says_so() {
    if !has_python_module("numpy") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("program.py"), PRESS).unwrap();
    let write = "import numpy as np; np.savez('frames.npz', skin=np.ones((3, 2, 4)), force=np.ones(3))";
    assert_eq!(python(folder.path(), &["-c", write]).code, 0);
    let refused = alone(folder.path(), "frames.npz", &[]);
    let note = "frames.npz states no units: its values are taken in the units of the inputs, image [N]\n";
    let why = "frames.npz has no array `image`, and the input `image` takes an image in N: write `--wire image=ARRAY` \
               with one of skin\n";
    assert_eq!((refused.code, refused.err), (1, format!("{note}{why}")));
    let tried = alone(folder.path(), "frames.npz", &["image=skin"]);
    assert_eq!((tried.code, tried.err.as_str()), (0, note), "{}", tried.out);
    let lines: Vec<&str> = tried.out.lines().collect();
    assert_eq!(lines[0], "image = skin [N], 2x4 tactels, pitch 5 mm by 5 mm (`--pitch`)");
    assert_eq!(lines[1..3], ["frame  force [N]    touches", "0      8            true"]);
    let missing = alone(folder.path(), "none.npz", &[]);
    assert!(missing.err.starts_with("cannot read none.npz: ") && missing.err.lines().count() == 1, "{}", missing.err);
}

#[test]
fn outputs_that_are_not_finite_are_named_once_and_the_exit_code_is_1() {
    if !has_python_module("numpy") {
        return;
    }
    let program = r#"
import tactflow
from tactflow import Features, Image, Scalar

@tactflow.node
def ratio(force: Scalar["N"]) -> {"x": Scalar["1"], "parts": Features(a="N", b="N"), "map": Image("N", 1, 2, (1, 1))}:
    nan = float("nan")
    return {"x": nan if force > 1 else force, "parts": {"a": force, "b": nan if force > 0 else None}, "map": [[0, 1]]}

tactflow.main(ratio)
"#;
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("program.py"), program).unwrap();
    let write = "import numpy as np; np.savez('a.npz', force=np.arange(4.0)); np.savez('zero.npz', force=np.zeros(4))";
    assert_eq!(python(folder.path(), &["-c", write]).code, 0);
    let tried = alone(folder.path(), "a.npz", &[]);
    assert_eq!(tried.code, 1, "{}", tried.out);
    let warnings: Vec<&str> = tried.err.lines().skip(1).collect();
    let why = "return None for an absent value; in a graph, the policy `not_finite` ends the run by default";
    assert_eq!(
        warnings,
        [
            format!("output `parts.b` is not finite in frame 1 (nan): {why}"),
            format!("output `x` is not finite in frame 2 (nan): {why}"),
        ]
    );
    let lines: Vec<&str> = tried.out.lines().skip(1).collect();
    assert_eq!(lines[0], "frame  x [1]        parts.a [N]  parts.b [N]  map [N]");
    assert_eq!(lines[1], "0      0            0            -            0 to 1");
    assert_eq!(lines[4], "3      nan          3            nan          0 to 1");
    assert_eq!(alone(folder.path(), "zero.npz", &[]).code, 0);
}

#[test]
fn without_the_package_that_reads_recordings_one_line_says_what_to_install() {
    if !has_python_module("numpy") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("program.py"), PRESS).unwrap();
    // It stands before an installed one.
    fs::write(folder.path().join("mcap.py"), "raise ImportError('no such package')\n").unwrap();
    let refused = alone(folder.path(), "run.mcap", &[]);
    let why = "a recording needs the package `mcap`: install it with `pip install mcap`\n";
    assert_eq!((refused.code, refused.err.as_str()), (1, why));
}

/// A program that fails as its argument says, beside the module `helper.py`.
const FAILS: &str = r#"
import sys
import tactflow
from tactflow import Image, Scalar
from helper import divide

@tactflow.node
def fails(image: Image["N"]) -> {"x": Scalar["m"], "y": Scalar["m"]}:
    if sys.argv[1] == "raises":
        raise KeyError("no such object")
    if sys.argv[1] == "helper":
        return {"x": divide(1.0, 0.0)}
    if sys.argv[1] == "library":
        return {"x": image.cells.reshape(7, 7, 7)}
    if sys.argv[1] == "long":
        raise ValueError("a" * 400)
    return {"z": 1.0} if sys.argv[1] == "strange" else (1.0, 2.0)

def frames():
    yield [[0.0, 1.0]]
    raise RuntimeError("the cable is out")

if sys.argv[1] == "pad":
    tactflow.pad(frames(), "skin", unit="N", rows=1, cols=2, pitch=(0.004, 0.004))
else:
    tactflow.main(fails, [])
"#;

#[test]
fn the_message_of_an_exception_names_the_line_of_the_program() {
    if !has_python_module("numpy") {
        return;
    }
    let (folder, package) = (tempfile::tempdir().unwrap(), workspace().join("nodes/python"));
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    fs::write(path("program.py"), FAILS).unwrap();
    fs::write(path("helper.py"), "def divide(a, b):\n    return a / b\n").unwrap();
    let long = format!("it said `ValueError: {}... (program.py, line 16)`", "a".repeat(300 - 12 - 3 - 22));
    for (how, why) in [
        ("raises", "it said `KeyError: 'no such object' (program.py, line 10)`"),
        ("helper", "it said `ZeroDivisionError: float division by zero (helper.py, line 2)`"),
        ("library", "into shape (7,7,7) (program.py, line 14)`"),
        ("strange", "it said `ValueError: it returns ['z'], and its outputs are ['x', 'y'] (program.py, line 7)`"),
        (
            "tuple",
            "it said `ValueError: it returns a tuple: return a dictionary with its outputs ['x', 'y'] (program.py, \
             line 7)`",
        ),
        ("long", &long),
        ("pad", "it said `RuntimeError: the cable is out (program.py, line 21)`"),
    ] {
        let signature = ["signature", "--out", &path("program.node.toml"), "--", "python3", "program.py", how];
        let stated = said(tool(&signature).env("PYTHONPATH", &package));
        assert_eq!((stated.code, stated.err.as_str()), (0, ""), "{how}: {}", stated.out);
        let program = format!(
            "type = 'process'\nsignature = 'program.node.toml'\ncommand = ['python3', 'program.py', '{how}']\n"
        );
        let rest = match how {
            "pad" => format!("[devices.pad]\n{program}"),
            _ => format!("in.image = 'pad.image'\n{program}[devices.pad]\ntype = 'mock_pad'\nfor_s = 0.2\n"),
        };
        let node = if how == "pad" { "" } else { "[nodes.fails]\n" };
        let graph = format!("graph.clock = 'pad'\nroles.pad = 'tactile_pad'\nbind.pad = 'pad'\n{node}{rest}");
        fs::write(path("graph.toml"), graph).unwrap();
        let failed = said(tool(&["run", &path("graph.toml"), "--for", "2s"]).env("PYTHONPATH", &package));
        assert_eq!(failed.code, 1, "{how}: {}{}", failed.out, failed.err);
        assert!(failed.err.contains(why), "{how}: {}", failed.err);
    }
}

#[test]
fn the_node_of_the_page_prints_what_is_shown() {
    if !has_python_module("numpy") {
        return;
    }
    let page = fs::read_to_string(workspace().join("docs/processes.md")).unwrap();
    let (_, node) = page.split_once("```python\n").unwrap();
    let (node, _) = node.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("program.py"), node).unwrap();
    record(folder.path());
    for file in files() {
        let tried = alone(folder.path(), file, &["image=touch.calibrate.repaired"]);
        assert_eq!((tried.code, tried.err.as_str()), (0, ""), "{}", tried.out);
        let head: Vec<&str> = tried.out.lines().take(2).map(|line| line.trim_end_matches(" (`--pitch`)")).collect();
        assert!(page.contains(&format!("```text\n{}\n", head.join("\n"))), "{head:?}");
    }
    let out = folder.path().join("my_feature.node.toml");
    fs::rename(folder.path().join("program.py"), folder.path().join("my_feature.py")).unwrap();
    let mut stated = tool(&["signature", "--out", out.to_str().unwrap(), "--", "python3", "my_feature.py"]);
    let stated = said(stated.env("PYTHONPATH", workspace().join("nodes/python")));
    assert_eq!((stated.code, stated.err.as_str()), (0, ""), "{}", stated.out);
    let (_, block) = stated.out.split_once("use it with\n\n").unwrap();
    assert!(page.contains(&format!("```text\n{}\n```", block.trim_end())), "{block}");
}

#[test]
fn a_node_alone_gets_no_mask_of_a_contact_that_is_over() {
    if !has_python_module("numpy") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let program = r#"
import tactflow
from tactflow import Image, Mask, Scalar

@tactflow.node
def area(image: Image["N"], region: Mask) -> {"area": Scalar["tactel"]}:
    return None if region is None else float(region.sum())

tactflow.main(area)
"#;
    fs::write(folder.path().join("program.py"), program).unwrap();
    let graph = "graph.clock = 'pad'\nroles.pad = 'tactile_pad'\nbind.pad = 'pad'\n\
        [devices.pad]\ntype = 'mock_pad'\nfor_s = 0.5\n\
        press = [{ from_s = 0.1, to_s = 0.2 }, { from_s = 0.3, to_s = 0.4 }]\n\
        [parts.touch]\nfile = 'builtin:parts/touch.toml'\nin.image = 'pad.image'\n";
    fs::write(folder.path().join("graph.toml"), graph).unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for args in [
        &["run", &path("graph.toml"), "--record", &path("run.mcap")][..],
        &["export", &path("run.mcap"), &path("run.npz")],
    ] {
        let done = said(&mut tool(args));
        assert_eq!(done.code, 0, "{}{}", done.out, done.err);
    }
    for file in files() {
        let tried = alone(folder.path(), file, &["image=pad.image", "region=touch.label.region"]);
        assert_eq!((tried.code, tried.err.as_str()), (0, ""), "{}", tried.out);
        let rows: Vec<Vec<&str>> = tried.out.lines().skip(3).map(|line| line.split_whitespace().collect()).collect();
        let is_there = |from: f64, to: f64| -> Vec<bool> {
            let timed = rows[..rows.len() - 1].iter().map(|row| (row[0].parse::<f64>().unwrap(), row[1]));
            timed.filter(|(time, _)| (from..to).contains(time)).map(|(_, area)| area != "-").collect()
        };
        for (from, to, expected) in [(0.11, 0.2, true), (0.21, 0.3, false), (0.31, 0.4, true), (0.41, 0.5, false)] {
            let found = is_there(from, to);
            assert!(found.len() > 15 && found.iter().all(|is| *is == expected), "{file} from {from} s: {}", tried.out);
        }
    }
}
