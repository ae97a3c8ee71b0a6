//! The self-test of a pad before any motion: what a pad that is not perfect still does, and what a pad that must not be
//! used does not do. The faults are injected into the images of a simulated pad.

use std::fs;
use std::path::{Path, PathBuf};

use tactflow_tests::workspace;

use crate::tool::{Said, say};

/// What is wrong with the pad of every task: 3 dead tactels, one that is stuck at full scale, repeated and missing
/// frames, and one frame of garbage in the self-test and one in the contact.
const FAULTS: &str = "
[[inject]]
role = \"pad\"
fault = \"dead\"
cells = 3
[[inject]]
role = \"pad\"
fault = \"stuck\"
cells = 1
reading = 4095
[[inject]]
role = \"pad\"
fault = \"repeat\"
rate = 0.05
[[inject]]
role = \"pad\"
fault = \"missing\"
rate = 0.02
[[inject]]
role = \"pad\"
fault = \"garbage\"
reading = 4095
frames = 1
from_s = 0.05
[[inject]]
role = \"pad\"
fault = \"garbage\"
reading = 4095
frames = 1
from_s = 3.0
";

/// Writes a scenario of a shipped task into `folder`, and returns its path.
fn scenario(folder: &Path, task: &str, bench: &Path, keys: &str) -> String {
    let graph = workspace().join(format!("graphs/{task}.toml"));
    let text = format!("[scenario]\ngraph = '{}'\nbench = '{}'\n{keys}", graph.display(), bench.display());
    let path = folder.join(format!("{task}_with_faults.toml"));
    fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// The path of a shipped bench.
fn shipped(bench: &str) -> PathBuf {
    workspace().join(format!("graphs/benches/{bench}.toml"))
}

#[test]
fn every_task_that_touches_holds_its_contact_on_a_pad_with_faults() {
    let folder = tempfile::tempdir().unwrap();
    // The pressure is held within a band that is 1.6 times as wide as without faults: tactels of the contact are filled.
    let pressure =
        "[check.p]\nof = \"touch.pressure\"\nunit = { p = 0.1 }\nafter_s = 4.0\nnever_above = 1.6\nnever_below = 0.5\n";
    let force = "[check.force]\nof = \"truth.force\"\nafter_s = 2.0\nnever_above = 12.0\nnever_below = 0.05\n";
    let servo = "stays_in = \"servo\"\n";
    let tasks = [
        ("force", "ball", servo, [pressure, force]),
        ("position", "ball", servo, ["", force]),
        ("hybrid", "ball", servo, [pressure, force]),
        ("rolling", "moved_ball", servo, [pressure, force]),
        ("edge", "edge", servo, [pressure, force]),
        ("cable", "cable", servo, [pressure, force]),
        ("explore", "object", "", [pressure, force]),
    ];
    let mut paths = Vec::new();
    for (task, bench, mode, checks) in tasks {
        let keys = format!("for_s = 10.0\nseeds = 2\nfrom = \"touch.present\"\n{mode}{}{FAULTS}", checks.concat());
        paths.push(scenario(folder.path(), task, &shipped(bench), &keys));
    }
    let words: Vec<&str> = ["verify"].into_iter().chain(paths.iter().map(String::as_str)).collect();
    let Said { code, out, err } = say(&words);
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
}

/// Runs a task on a changed bench to its fault. Returns the fault, after a check that no command was sent.
fn refused(change: impl Fn(&str) -> String, faults: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let bench = change(&fs::read_to_string(shipped("ball")).unwrap());
    let bench = bench.replace("\"../", &format!("\"{}/", workspace().join("graphs").display()));
    let own = folder.path().join("own.toml");
    fs::write(&own, bench).unwrap();
    let keys = format!("for_s = 2.0\n[check.p]\nof = \"touch.pressure\"\n{faults}");
    let path = scenario(folder.path(), "force", &own, &keys);
    let records = folder.path().join("records");
    let Said { code, out, err } = say(&["verify", &path, "--out", &records.display().to_string()]);
    assert_eq!(code, 1, "{out}{err}");
    let mut runs = 0;
    for entry in fs::read_dir(&records).unwrap_or_else(|error| panic!("{error}: {out}{err}")) {
        let text = fs::read_to_string(entry.unwrap().path()).unwrap();
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
        let is_command = |name: &&str| name.starts_with("move.joints.velocity.");
        assert!(names.iter().any(is_command), "{names:?}");
        for line in lines {
            for (name, value) in names.iter().zip(line.split(',')).filter(|(name, _)| is_command(name)) {
                assert!(value.is_empty() || value.parse() == Ok(0.0), "{name} is {value}");
            }
        }
        runs += 1;
    }
    assert_eq!(runs, 1, "{out}{err}");
    err
}

#[test]
fn a_pad_that_must_not_be_used_moves_nothing_and_is_named() {
    let same = |bench: &str| bench.to_owned();
    let inject = |fault: &str| format!("[[inject]]\nrole = \"pad\"\n{fault}\n");
    let cases = [
        (
            "touched",
            refused(|bench: &str| bench.replace("at = [0.010, -0.010, 0.046]", "at = [0.010, -0.010, 0.036]"), ""),
            "`touch.calibrate` has found a fault: something touches the pad: before any motion,",
        ),
        (
            "another pad",
            refused(|bench: &str| bench.replace("for_s = 22.0", "for_s = 22.0\nelectronics = { serial = 2 }"), ""),
            "`touch.calibrate` has found a fault: the calibration does not fit the pad: at rest,",
        ),
        (
            "side by side",
            refused(same, &inject("fault = \"dead\"\ncells = [[3, 4], [3, 5]]")),
            "the bad tactels [3, 4] and [3, 5] are side by side, so a contact there is not felt",
        ),
        (
            "too many",
            refused(same, &inject("fault = \"dead\"\ncells = 9")),
            "9 tactels are bad, but at most 6 may be: ",
        ),
        (
            "a whole pad that warms up",
            refused(same, &inject("fault = \"drift\"\nreading_per_s = 200")),
            "256 tactels are bad, but at most 6 may be: ",
        ),
    ];
    for (what, fault, expected) in cases {
        assert!(fault.contains(expected), "{what}: {fault}");
    }
}

#[test]
fn a_pin_on_one_tactel_stops_the_approach_although_it_looks_like_a_stuck_one() {
    let folder = tempfile::tempdir().unwrap();
    let pin = "[[inject]]\nrole = \"pad\"\nfault = \"stuck\"\ncells = [[4, 11]]\nreading = 4095\nfrom_s = 0.4\n";
    let checks = "[check.peak]\nof = \"move.contact.peak\"\nafter_s = 0.42\nnever_above = 1e-5\n\
                  [check.force]\nof = \"truth.force\"\nnever_above = 0.05\n";
    let path = scenario(folder.path(), "force", &shipped("ball"), &format!("for_s = 3.0\n{checks}{pin}"));
    let Said { code, out, err } = say(&["verify", &path]);
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
}

#[test]
fn what_was_found_stands_in_the_summary_and_a_bench_can_leave_the_test_out() {
    let graphs = workspace().join("graphs");
    let task = graphs.join("force.toml").display().to_string();
    let Said { code, out, err } = say(&["run", &task, "--for", "1s"]);
    assert_eq!(code, 0, "{out}{err}");
    let line = out.lines().find(|line| line.starts_with("`touch.calibrate`: self-test: noise "));
    let line = line.unwrap_or_else(|| panic!("{out}{err}"));
    assert!(line.contains(" raw, zeros off by at most ") && line.ends_with(", no bad tactel"), "{line}");
    let Said { code, out, err } = say(&["run", &task, "--for", "1s", "--set", "devices.bench.rest_frames=0"]);
    assert_eq!(code, 0, "{out}{err}");
    assert!(!out.contains("self-test"), "{out}");
}
