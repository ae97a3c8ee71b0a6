//! Warnings: what counts as a reader of a node, what `[allow]` silences, and that it is listed.

use std::fs;

use tactflow_runtime::graph::{AllowedWarning, Compiled, Request, compile};
use tactflow_runtime::scenario::Scenario;
use tactflow_runtime::source::{Code, Report};
use tactflow_tests::{catalogue, workspace};
use tempfile::TempDir;

use crate::tool::say;

/// The codes of the warnings in a report.
fn codes(report: Option<&Report>) -> Vec<&'static str> {
    report.iter().flat_map(|report| &report.diagnostics).map(|diagnostic| diagnostic.code.name()).collect()
}

fn hybrid(set: &[&str]) -> Compiled {
    let request = Request::file(workspace().join("graphs/hybrid.toml"));
    let request = set.iter().fold(request, |request, assignment| request.set(*assignment));
    compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)))
}

const FIRM: [&str; 2] = ["nodes.firm.type=\"contact_debounce\"", "nodes.firm.in.present=\"touch.present\""];

#[test]
fn a_condition_reads_a_port() {
    let unread = hybrid(&FIRM);
    assert_eq!(codes(unread.warnings().as_ref()), ["unused-node"]);
    let conditions = [
        "modes.servo.done={ when = \"firm.present\", for_ms = 1000 }",
        "modes.servo.on_lost={ of = \"firm.present\", after_ms = 100, to = \"approach\" }",
    ];
    for condition in conditions {
        let read = hybrid(&[FIRM[0], FIRM[1], condition]);
        assert_eq!(codes(read.warnings().as_ref()), [""; 0], "{condition}");
    }
}

#[test]
fn a_check_of_a_scenario_reads_a_port() {
    let folder = TempDir::new().unwrap();
    let graphs = workspace().join("graphs");
    let task = fs::read_to_string(graphs.join("hybrid.toml")).unwrap();
    let task = ["parts/", "benches/"]
        .iter()
        .fold(task, |task, name| task.replace(&format!("\"{name}"), &format!("\"{}/{name}", graphs.display())));
    let firm = "\n[nodes.firm]\ntype = \"contact_debounce\"\nin.present = \"touch.present\"\n";
    let narrow =
        "\n[nodes.narrow]\ntype = \"eccentricity\"\nin.image = \"touch.image\"\nin.region = \"touch.region\"\n";
    fs::write(folder.path().join("task.toml"), task + firm + narrow).unwrap();
    let scenario = folder.path().join("scenario.toml");
    fs::write(&scenario, "[scenario]\ngraph = \"task.toml\"\nfor_s = 1.0\nnever_lost = \"firm.present\"\n").unwrap();
    let loaded = Scenario::load(&catalogue(), &scenario).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let report = loaded[0].warnings().expect("nothing reads `narrow`");
    let messages: Vec<&str> = report.diagnostics.iter().map(|warning| warning.message.as_str()).collect();
    assert_eq!(messages, ["no output of `narrow` is used"]);
}

#[test]
fn a_bench_allows_for_its_tasks() {
    let bench = fs::read_to_string(workspace().join("graphs/benches/mock.toml")).unwrap();
    let bench = bench.replace("\"../", &format!("\"{}/graphs/", workspace().display()));
    let load = |bench: String, box_max: &str| {
        let request = Request::file(workspace().join("graphs/hybrid.toml"));
        let request = Request { bench_text: Some(bench), ..request.set(format!("limits.workspace_max_m={box_max}")) };
        compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)))
    };
    let (outside, inside) = ("[-0.6, 0.4, 0.7]", "[-0.3, 0.4, 0.7]");
    assert_eq!(codes(load(bench.clone(), outside).warnings().as_ref()), ["start-outside"]);
    let allowing = format!("{bench}\n[allow]\nstart-outside = \"it drives in\"\n");
    let allowed = load(allowing.clone(), outside);
    assert!(allowed.warnings().is_none());
    let expected = AllowedWarning { code: Code::StartOutside, reason: "it drives in".into(), count: 1 };
    assert_eq!(allowed.allowed(), [expected]);
    let unneeded = load(allowing, inside);
    assert!(unneeded.warnings().is_none() && unneeded.allowed().is_empty(), "a bench is for several tasks");
}

#[test]
fn what_is_allowed_is_listed_with_its_reason() {
    let graph = "tests/errors/unused_allow.toml";
    let line = "allowed: 1 warning of `unused-node`: `narrow` is for a task that is not written yet";
    for args in [&["check", graph][..], &["run", graph, "--for", "10ms"]] {
        let said = say(args);
        assert_eq!(said.code, 0, "{}", said.err);
        assert!(said.out.lines().any(|one| one == line), "{}", said.out);
    }
    let json = say(&["check", graph, "--format", "json"]);
    let allowed = "\"allowed\":[{\"code\":\"unused-node\",\"count\":1,\"reason\":\"`narrow` is for a task";
    let compact: String = json.out.split_whitespace().collect();
    assert!(compact.contains(&allowed.split_whitespace().collect::<String>()), "{}", json.out);
}

#[test]
fn a_mode_that_waits_at_rest_is_no_approach() {
    let none = [""; 0];
    let still = "modes.approach.set.reach.twist=[0, 0, 0, 0, 0, 0]";
    assert_eq!(codes(hybrid(&[still]).warnings().as_ref()), ["no-approach"]);
    let away = "modes.approach.set.reach.twist=[0, 0, -0.015, 0, 0, 0]";
    assert_eq!(codes(hybrid(&[away]).warnings().as_ref()), ["no-approach"]);
    let aside = "modes.approach.set.reach.twist=[0.01, 0, -0.001, 0, 0, 0]";
    assert_eq!(codes(hybrid(&[aside]).warnings().as_ref()), none);
    let wait = ["graph.start=\"wait\"", "modes.wait.go={ to = \"servo\", when = \"touch.present\", for_ms = 40 }"];
    let lost = "modes.servo.on_lost={ of = \"touch.present\", after_ms = 100, to = \"approach\" }";
    let moved = "modes.approach.go={ to = \"servo\", when = \"touch.present\", for_ms = 40 }";
    assert_eq!(codes(hybrid(&[wait[0], wait[1], lost, moved]).warnings().as_ref()), none, "`wait` is at rest");
    let settled = [
        "modes.approach.go={ to = \"settle\", when = \"touch.present\", for_ms = 40 }",
        "modes.settle.go={ to = \"servo\", after_ms = 500 }",
        "modes.servo.set.reach.twist=[0, 0, 0, 0, 0, 0]",
        "modes.servo.done={ when = \"touch.pressure\", above = 0.12, for_ms = 500 }",
    ];
    assert_eq!(codes(hybrid(&settled).warnings().as_ref()), none, "`servo` begins with the contact of `settle`");
}

#[test]
fn a_time_is_compared_with_the_samples_that_its_node_reads() {
    // The pad has 10 Hz and is the clock, the arm has 250 Hz.
    let press = |set: &str| {
        let request = Request::file(workspace().join("graphs/finger_press.toml")).set(set);
        let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
        codes(plan.warnings().as_ref())
    };
    let cases: [(&str, &[&str]); 6] = [
        ("nodes.error.in.x={ from = \"touch.x\", max_age_ms = 50 }", &["short-time"]),
        ("nodes.error.in.x={ from = \"touch.x\", max_age_ms = 100 }", &[]),
        ("parts.move.in.position={ from = \"arm.position\", max_age_ms = 20 }", &[]),
        ("parts.move.set.workspace.max_age_ms=20", &[]),
        ("parts.move.set.workspace.max_age_ms=2", &["short-time"]),
        ("policy.roles={ arm = { max_age_ms = 20 }, pad = { max_age_ms = 90 } }", &["short-time"]),
    ];
    for (set, expected) in cases {
        assert_eq!(press(set), expected, "{set}");
    }
}
