//! Checks of a scenario that are limited to a mode, or that end with an event, and the change of a value.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;
use tactflow_tests::workspace;

use crate::tool::{Said, peer, say};

/// Writes a scenario of the text to a folder. `TESTS` stands for the folder of the tests, and `GRAPHS` for the shipped
/// graphs.
fn written(folder: &Path, text: &str) -> PathBuf {
    let path = |name: &str| workspace().join(name).to_str().unwrap().to_owned();
    let file = folder.join("scenario.toml");
    fs::write(&file, text.replace("TESTS", &path("tests")).replace("GRAPHS", &path("graphs"))).unwrap();
    file
}

/// The rows of the only scenario that was run, and its runs.
fn results(said: &Said) -> (Vec<Value>, Vec<Value>) {
    let mut json: Value = serde_json::from_str(&said.out).unwrap_or_else(|_| panic!("{}{}", said.out, said.err));
    let mut take = |key: &str| match json["scenarios"][0][key].take() {
        Value::Array(list) => list,
        other => panic!("{other}"),
    };
    (take("rows"), take("runs"))
}

/// The value of a figure of a check in the first run.
fn value(rows: &[Value], check: &str, figure: &str) -> f64 {
    let row = rows.iter().find(|row| row["check"] == check && row["figure"] == figure);
    row.and_then(|row| row["values"][0].as_f64()).unwrap_or_else(|| panic!("{figure} of {check}: {rows:#?}"))
}

/// A check of [`figures_equal_those_of_the_recording`]: what the scenario writes, and the arguments of the peer.
struct Limited {
    of: &'static str,
    keys: &'static str,
    column: &'static str,
    during: &'static str,
    until: &'static str,
    after_ms: &'static str,
    visits: usize,
}

/// The modes are `approach` 0 and `servo` 1; the bench has two contacts.
const LIMITED: [Limited; 7] = [
    Limited { of: "touch.x", keys: "", column: "touch.moments.x", during: "-", until: "-", after_ms: "0", visits: 1 },
    Limited {
        of: "move.sensor_pose.z",
        keys: "during = 'servo'",
        column: "move.state.sensor_pose.z",
        during: "1",
        until: "-",
        after_ms: "0",
        visits: 2,
    },
    Limited {
        of: "touch.pressure",
        keys: "during = 'servo'\nafter_s = 0.2",
        column: "touch.pressure.value",
        during: "1",
        until: "-",
        after_ms: "200",
        visits: 2,
    },
    Limited {
        of: "move.sensor_pose.z",
        keys: "during = 'approach'\nafter_s = 0.02",
        column: "move.state.sensor_pose.z",
        during: "0",
        until: "-",
        after_ms: "20",
        visits: 3,
    },
    Limited {
        of: "move.sensor_pose.x",
        keys: "until = 'approach'",
        column: "move.state.sensor_pose.x",
        during: "-",
        until: "0",
        after_ms: "0",
        visits: 1,
    },
    Limited {
        of: "move.sensor_pose.z",
        keys: "until = 'touch.present'\nafter_s = 1.0",
        column: "move.state.sensor_pose.z",
        during: "-",
        until: "touch.label.present",
        after_ms: "1000",
        visits: 1,
    },
    Limited {
        of: "touch.x",
        keys: "during = 'servo'\nuntil = 'approach'",
        column: "touch.moments.x",
        during: "1",
        until: "0",
        after_ms: "0",
        visits: 1,
    },
];

#[test]
fn figures_equal_those_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut text = "[scenario]\ngraph = 'GRAPHS/hybrid.toml'\nbench = 'GRAPHS/benches/mock.toml'\nfor_s = 4.0\n\
                    from = 'touch.present'\n"
        .to_owned();
    for (i, Limited { of, keys, .. }) in LIMITED.iter().enumerate() {
        let bounds = "never_above = 99\nnever_below = -99\nchanges_by = 0\nwithin = 99\n";
        text += &format!("[check.c{i}]\nof = '{of}'\n{keys}\n{bounds}");
    }
    let out = folder.path().join("out");
    let file = written(folder.path(), &text);
    let said = say(&["verify", file.to_str().unwrap(), "--json", "--out", out.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let (rows, _) = results(&said);
    let record = out.join("scenario.csv");
    let mut args = vec![record.to_str().unwrap()];
    args.extend(
        LIMITED.iter().flat_map(|one| [one.column, "touch.label.present", one.during, one.until, one.after_ms]),
    );
    let expected = peer("windows.py", &args);
    let mut changes = 0;
    for (i, (line, one)) in expected.lines().zip(&LIMITED).enumerate() {
        let found = ["max", "min", "change"].map(|figure| value(&rows, &format!("c{i}"), figure));
        let [max, min, change] = found;
        assert_eq!(line, format!("{max:?} {min:?} {change:?} in {} visits", one.visits), "{}: {}", one.of, one.keys);
        changes += usize::from(change != 0.0);
    }
    assert_eq!((expected.lines().count(), changes), (LIMITED.len(), LIMITED.len()), "each says something: {expected}");
}

/// A task on a contact that slides to the centre from 0.5 s to 2 s, with the truth.
const LET_GO: &str = "[bind]\npad = 'pad'\ntruth = 'pad'\n[devices.pad]\ntype = 'true_pad'\nto_s = 2.0\n";

/// The results of checks on [`LET_GO`].
fn let_go(head: &str, checks: &str) -> (Said, Vec<Value>, Vec<Value>) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bench.toml"), LET_GO).unwrap();
    let head =
        format!("[scenario]\ngraph = 'TESTS/scenarios/tasks/slide.toml'\nbench = 'bench.toml'\nfor_s = 3.0\n{head}");
    let file = written(folder.path(), &format!("{head}\n{checks}"));
    let said = say(&["verify", file.to_str().unwrap(), "--json"]);
    let (rows, runs) = results(&said);
    (said, rows, runs)
}

#[test]
fn figures_in_a_window_equal_the_closed_form() {
    let checks = "[check.until]\nof = 'truth.x'\nuntil = 'wait'\nchanges_by = '-9.97 mm'\nwithin = '0.02 mm'\n\
        [check.returns]\nof = 'truth.x'\nuntil = 'wait'\nafter_s = 0.5\nreturns_within = '1 cm'\n\
        [check.during]\nof = 'touch.present'\nduring = 'feel'\n\
        [check.settles]\nof = 'truth.x'\nduring = 'feel'\nsettles_to = 0.0\nwithin = 0.001\n";
    let (said, rows, _) = let_go("from = 'touch.present'", checks);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    // The last tick with contact is 1.496 s after the first. The contact is at 10 mm exp(-t / 0.25 s).
    let at = |time: f64| 0.01 * libm::exp(-time / 0.25);
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    near(value(&rows, "until", "change"), at(1.496) - at(0.0));
    near(value(&rows, "returns", "return"), at(0.5) - at(1.496));
    // The mode begins one tick after the contact and ends 100 ms after its last tick, so its ticks are those from 4 ms
    // to 1.596 s. The contact is there in the first 374 of these 399.
    near(value(&rows, "during", "mean"), 374.0 / 399.0);
    // The mean of ten samples is in the band at the tick whose time from the contact is `exact` or later. The time in
    // the mode is one period less.
    let sum: f64 = (0..10).map(|k| libm::exp(f64::from(k) * 0.004 / 0.25)).sum::<f64>() / 10.0;
    let exact = 0.25 * libm::log(0.01 * sum / 0.001) - 0.004;
    let response = value(&rows, "settles", "response");
    assert!((0.0..0.004).contains(&(response - exact)), "{response}, not {exact}");
}

#[test]
fn a_window_without_a_tick_fails_and_says_why() {
    let never = "of = 'truth.force'\nnever_above = 9.0\n";
    let cases = [
        ("", "during = 'feel'\nuntil = 'feel'", "the run is never in mode `feel` after time 0 and before `feel`"),
        ("", "during = 'wait'\nafter_s = 1.0", "no visit of mode `wait` lasts longer than `after_s`"),
        ("from = 'touch.present'", "until = 'wait'\nafter_s = 2.0", "`after_s` is later than `wait`"),
        (
            "from = 'touch.present'",
            "until = 'touch.present'",
            "`touch.present` never becomes true after time 0 (being true at time 0 does not count)",
        ),
    ];
    for (from, keys, why) in cases {
        let checks = format!("[check.limited]\n{keys}\n{never}[check.whole]\n{never}");
        let (said, rows, runs) = let_go(from, &checks);
        assert_eq!((said.code, said.err), (1, format!("error: scenario: check `limited`: {why}\n")), "{keys}");
        assert_eq!(runs[0]["not_checked"], serde_json::json!([{ "check": "limited", "why": why }]));
        assert_eq!(rows[0]["mark"], "failed");
        assert_eq!(rows[0]["values"], serde_json::json!([null]), "{keys}");
        assert_eq!(rows[1]["mark"], "passed", "the other checks are measured");
    }
}

#[test]
fn a_mode_that_is_never_reached_fails_a_check_without_a_bound_too() {
    let folder = tempfile::tempdir().unwrap();
    let text = "[scenario]\ngraph = 'TESTS/scenarios/tasks/slide.toml'\nseeds = [3, 4]\nfor_s = 0.4\n\
                [check.force]\nof = 'touch.present'\nduring = 'feel'\n\
                [check.until]\nof = 'touch.present'\nuntil = 'feel'\nnever_above = 1.0\n";
    let file = written(folder.path(), text);
    let Said { code, out, err } = say(&["verify", file.to_str().unwrap()]);
    let said = |seed: u64| {
        format!(
            "error: scenario, seed {seed}: check `force`: the run is never in mode `feel` after time 0\n\
             error: scenario, seed {seed}: check `until`: the run never enters mode `feel` after time 0\n"
        )
    };
    assert_eq!((code, err), (1, said(3) + &said(4)));
    for row in ["mean during feel", "std during feel", "max until feel"] {
        let line = out.lines().find(|line| line.contains(row)).unwrap_or_else(|| panic!("no {row}:\n{out}"));
        assert!(line.ends_with("FAILED"), "{line}");
    }
    assert!(out.ends_with("\n0 passed, 3 failed, 0 informational, in 2 runs\n"), "{out}");
}

#[test]
fn the_json_says_what_limits_a_check_and_what_it_expects() {
    let checks = "[check.x]\nof = 'truth.x'\nduring = 'feel'\nuntil = 'wait'\nchanges_by = '-8 mm'\nwithin = '1 mm'\n\
                  [check.whole]\nof = 'truth.force'\nnever_above = 3.0\n";
    let (said, rows, runs) = let_go("from = 'touch.present'", checks);
    assert_eq!(said.code, 1, "{}", said.out);
    let of =
        |row: &Value| ["during", "until", "figure", "bound", "target", "judged", "mark"].map(|key| row[key].clone());
    let strings = |list: [&str; 3]| list.map(Value::from);
    let [during, until, figure] = strings(["feel", "wait", "change"]);
    let [judged, failed, _] = strings(["every", "failed", ""]);
    assert_eq!(of(&rows[0]), [during, until, figure, 0.001.into(), (-0.008).into(), judged.clone(), failed]);
    let [passed, max, _] = strings(["passed", "max", ""]);
    assert_eq!(of(&rows[1]), [Value::Null, Value::Null, max, 3.0.into(), Value::Null, judged, passed]);
    assert_eq!(runs[0]["not_checked"], serde_json::json!([]));
}
