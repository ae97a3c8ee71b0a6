//! The fault matrix: `verify --faults` on a task, and its table in the documentation.

use std::fs;

use serde_json::Value;
use tactflow_runtime::scenario::matrix::described;
use tactflow_tests::workspace;

use crate::tool::say;

/// The smoke part: one task in three phases, and faults of the pad, the commands, the arm and the object.
const PHASES: [&str; 3] = ["approach", "steady", "ramping"];
const SMOKE: [&str; 6] =
    ["dropped frames", "not a number", "gain too low", "lost commands", "hand presses", "object gone"];

#[test]
fn a_task_withstands_faults_of_the_pad_the_commands_the_arm_and_the_object() {
    let only = SMOKE.into_iter().flat_map(|fault| ["--only", fault]);
    let phases = PHASES.into_iter().flat_map(|phase| ["--phase", phase]);
    let args = ["verify", "--faults", "graphs/force.toml", "--json"].into_iter().chain(only).chain(phases);
    let said = say(&args.collect::<Vec<_>>());
    let json: Value = serde_json::from_str(&said.out).unwrap_or_else(|error| panic!("{error}: {}", said.err));
    let cells = json["cells"].as_array().unwrap();
    let broken: Vec<&Value> = cells.iter().filter(|cell| cell["ok"] != true).collect();
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{broken:#?}");
    // The force is controlled at any place, so nothing slides, and its press is too slow for any limit.
    let missing: Vec<&str> =
        json["missing"].as_array().unwrap().iter().filter_map(|one| one["phase"].as_str()).collect();
    assert_eq!(missing, ["sliding", "at a limit"]);
    assert_eq!(cells.len(), SMOKE.len() * PHASES.len());
    let fate = |fault: &str, phase: &str, attack: usize| {
        let cell = cells.iter().find(|cell| cell["fault"] == fault && cell["phase"] == phase).unwrap();
        (cell["attacks"][attack]["fate"].clone(), cell["attacks"][attack]["cause"].clone())
    };
    // A force that a hand adds is there, and an object that is gone is not.
    assert_eq!(fate("object gone", "steady", 0).0, "loses contact");
    assert_eq!(fate("hand presses", "steady", 0).0, "holds");
    let (ends, cause) = fate("not a number", "steady", 0);
    assert!(ends == "fails" && cause.as_str().unwrap().contains("`pad.image` is not a finite number"), "{cause}");
    assert_eq!(fate("hand presses", "ramping", 0).0, "halts");
}

#[test]
fn a_fault_of_the_matrix_comes_again_in_a_scenario() {
    let said =
        say(&["verify", "--faults", "graphs/force.toml", "--json", "--only", "hand presses", "--phase", "steady"]);
    let json: Value = serde_json::from_str(&said.out).unwrap();
    let steady = json["cells"].as_array().unwrap().first().unwrap();
    let attack = &steady["attacks"][1];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("again.toml");
    let graphs = workspace().join("graphs");
    let until = steady["at_s"].as_f64().unwrap() + 3.0;
    let text = format!(
        "[scenario]\ngraph = '{0}/force.toml'\nfor_s = {until}\nseeds = [1]\n[check.force]\nof = 'truth.force'\n\
         after_s = {1}\nnever_above = 50.0\n{2}",
        graphs.display(),
        steady["at_s"],
        attack["inject"].as_str().unwrap()
    );
    fs::write(&path, text).unwrap();
    let said = say(&["verify", path.to_str().unwrap(), "--json"]);
    let again: Value = serde_json::from_str(&said.out).unwrap_or_else(|error| panic!("{error}: {}", said.err));
    let rows = again["scenarios"][0]["rows"].as_array().unwrap();
    let largest = rows.iter().find(|row| row["figure"] == "max").unwrap()["worst"].as_f64().unwrap();
    assert!((largest - attack["force_n"].as_f64().unwrap()).abs() < 1e-9, "{largest} N, {attack}");
}

#[test]
fn what_cannot_be_attacked_says_why() {
    let cases = [
        (&["--faults", "graphs/finger_press.toml"][..], "no pad of this task has a true force"),
        (&["--faults", "graphs/force.toml", "--only", "gremlins"], "there is no fault `gremlins`"),
        (&["--faults", "graphs/force.toml", "--phase", "noon"], "there is no phase `noon`"),
        (&["--faults", "graphs/force.toml", "--seeds", "3"], "cannot be used with"),
        (&["--bench", "graphs/benches/ball.toml"], "--faults"),
    ];
    for (args, why) in cases {
        let said = say(&[&["verify"], args].concat());
        assert!(said.code == 2 && said.err.contains(why), "{args:?}: {}", said.err);
    }
}

#[test]
fn the_page_shows_the_table_of_the_matrix_and_names_tests_that_exist() {
    let page = fs::read_to_string(workspace().join("docs/faults.md")).unwrap();
    let tests: Vec<(&str, &str)> = page.split('`').filter_map(|word| word.split_once(".rs::")).collect();
    assert!(tests.len() > 15);
    for (path, name) in tests {
        let text = fs::read_to_string(workspace().join(format!("{path}.rs"))).unwrap();
        assert!(text.contains(&format!("fn {name}(")), "{path}.rs has no {name}");
    }
    let (_, table) = page.split_once("| fault | severities |").unwrap();
    let shown: Vec<&str> = table.lines().skip(2).take_while(|line| line.starts_with('|')).collect();
    let wanted: Vec<String> = described().iter().map(|cells| format!("| {} |", cells.join(" | "))).collect();
    assert_eq!(shown, wanted, "docs/faults.md");
}
