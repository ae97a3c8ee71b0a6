//! `tactflow verify`: checks that pass and fail, runs that fail and files that do not load, on a pad whose truth is
//! known.

use std::fs;
use std::path::Path;

use tactflow_runtime::scenario::figure::Figure;
use tactflow_runtime::scenario::judge::{FigureRow, Verdict};
use tactflow_runtime::scenario::{Scenario, Trial};
use tactflow_tests::{catalogue, workspace};

use crate::cli::Running;
use crate::tool::{Said, peer, say};

const SLIDE: &str = "tests/scenarios/slide.toml";
const MISSED: &str = "tests/scenarios/missed.toml";
const FAULT: &str = "tests/scenarios/fault.toml";
const MOCK: &str = "tests/scenarios/mock.toml";
const NEVER: &str = "tests/scenarios/never.toml";

/// The cells of the rows of the table: those that two blanks or more lie between.
fn rows(text: &str) -> Vec<Vec<&str>> {
    let lines = text.lines().take_while(|line| !line.is_empty());
    lines.map(|line| line.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect()).collect()
}

/// The row of a figure of a check.
fn row<'t>(text: &'t str, check: &str, figure: &str) -> Vec<&'t str> {
    let found = rows(text).into_iter().find(|row| row.windows(2).any(|pair| pair == [check, figure]));
    found.unwrap_or_else(|| panic!("no row has `{figure}` of `{check}`:\n{text}"))
}

#[test]
fn what_is_met_ends_with_0_and_prints_figure_bound_paper_and_mark() {
    let Said { code, out, err } = say(&["verify", SLIDE]);
    assert_eq!((code, err.as_str()), (0, ""), "{out}");
    assert_eq!(row(&out, "x", "response")[..6], ["slide", "x", "response", "s", "0.48000", "≤ 0.52000"]);
    assert_eq!(row(&out, "x", "response")[6], "0.90000", "the paper's");
    assert!(rows(&out)[1..].iter().all(|row| *row.last().unwrap() == "passed" || row.len() < 9), "{out}");
    assert!(out.contains("slide: 6 seeds of 4 s, pad.noise = 0.002, devices.pad.tau_s = 0.25\n"), "{out}");
    assert!(out.ends_with("\n13 passed, 0 failed, 4 informational, in 6 runs\n"), "{out}");
}

#[test]
fn what_is_missed_ends_with_1_and_is_printed_all_the_same() {
    let Said { code, out, err } = say(&["verify", MISSED]);
    assert_eq!((code, err.as_str()), (1, ""));
    let marks = [
        ("x", "response", "FAILED"),
        ("x", "error", "FAILED"),
        ("reach", "max", "FAILED"),
        ("reach", "min", "passed"),
        ("never_lost", "lost", "FAILED"),
        ("stays_in", "away", "FAILED"),
        ("ends_in", "ends", "FAILED"),
    ];
    for (check, figure, mark) in marks {
        assert_eq!(row(&out, check, figure).last(), Some(&mark), "{figure} of {check}:\n{out}");
    }
    // The contact is there for 1.5 s of the 2.5 s after it came, one tick every 4 ms; the last of them is at 2.5 s.
    assert_eq!(row(&out, "never_lost", "lost")[3], "1.004");
    assert!(out.ends_with("\n1 passed, 6 failed, 1 informational, in 1 run\n"), "{out}");
}

#[test]
fn a_goal_that_is_missed_is_printed_with_its_reason_and_fails_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (file, tests) = (folder.path().join("goals.toml"), workspace().join("tests/scenarios"));
    let text = |checks: &str| {
        format!(
            "[scenario]\ngraph = '{0}/tasks/slide.toml'\nbench = '{0}/benches/slide.toml'\nseeds = 2\nfor_s = 4.0\n\
             from = 'touch.present'\n[check.x]\nof = 'error.error.x'\nunit = {{ tactel = 0.005 }}\n\
             settles_to = 0.0\nwithin = 0.3\nsteady_s = 2.0\n{checks}",
            tests.display()
        )
    };
    let verified = |checks: &str, more: &[&str]| {
        fs::write(&file, text(checks)).unwrap();
        let Said { code, out, err } = say(&[&["verify", file.to_str().unwrap()], more].concat());
        assert_eq!((code, err.as_str()), (0, ""), "{out}");
        out
    };
    let out = verified("goal = { response_s = 0.4, error = 0.02 }\nmissed = 'The pad is slow.'", &[]);
    let line = "  response of x misses its goal: 0.48000 s instead of 0.40000 s. The pad is slow.\n";
    assert!(out.contains(line), "{out}");
    assert_eq!(row(&out, "x", "response").last(), Some(&"passed (goal missed)"), "{out}");
    assert!(out.ends_with("\n1 passed, 0 failed, 2 informational, 1 goal missed, in 2 runs\n"), "{out}");
    let out = verified("goal = { response_s = 0.4 }", &[]);
    assert!(out.contains("instead of 0.40000 s. no reason is given: add `missed` to the check\n"), "{out}");
    let out = verified("goal = { response_s = 0.5 }\nmissed = 'The pad is slow.'", &[]);
    assert!(out.contains("  x reaches its goals: remove `missed` from the check\n"), "{out}");
    let out = verified("goal = { response_s = 0.4, error = 0.02 }", &["--json"]);
    let rows = &serde_json::from_str::<serde_json::Value>(&out).unwrap()["scenarios"][0]["rows"];
    let goals =
        rows.as_array().unwrap().iter().map(|row| (row["goal"].as_f64(), row["misses_goal"].as_bool().unwrap()));
    assert_eq!(goals.collect::<Vec<_>>(), [(Some(0.4), true), (Some(0.02), false), (None, false)]);
}

#[test]
fn a_fault_is_a_row_and_the_others_run() {
    let Said { code, out, err } = say(&["verify", FAULT, NEVER, MOCK]);
    assert_eq!(code, 1);
    let fault = "`pad` failed: its plug is out in tick 376 at 1.500 s (tests/scenarios/benches/unplugged.toml:4:10)";
    let never = "error: never: `touch.present` was never set, so the figures have no time 0";
    let lines = [format!("error: fault, seed 3: device {fault}"), format!("error: fault, seed 7: device {fault}")];
    assert_eq!(err.lines().collect::<Vec<_>>(), [&lines[0], &lines[1], never]);
    let remarks: Vec<_> = rows(&out).into_iter().filter(|row| row.last() == Some(&"FAILED")).collect();
    assert_eq!(
        remarks,
        [["fault", "2 of 2 runs ended in an error", "FAILED"], ["never", "1 of 1 runs ended in an error", "FAILED"]]
    );
    assert_eq!(row(&out, "pressure", "max").last(), Some(&"passed"), "{out}");
}

#[test]
fn what_does_not_load_ends_with_2_and_the_others_run() {
    let cases = [
        ("tests/errors/scenarios/names.toml", "error[unknown-port]: there is no port `error.error.z`"),
        ("tests/errors/scenarios/seeds.toml", "error[unknown-key]: no device of this bench has a `seed`"),
        ("graphs/hybrid.toml", "error[wrong-file]: this is a graph, not a scenario"),
        ("tests/nowhere.toml", "error[unreadable]: cannot read `tests/nowhere.toml`"),
    ];
    for (file, message) in cases {
        let Said { code, out, err } = say(&["verify", file, MOCK]);
        assert_eq!(code, 2, "{file}: {err}");
        assert!(err.contains(message), "{file}: {err}");
        assert!(
            out.contains("does not load") && row(&out, "pressure", "max").last() == Some(&"passed"),
            "{file}: {out}"
        );
    }
    let empty = tempfile::tempdir().unwrap();
    let folder = empty.path().to_str().unwrap();
    let Said { code, err, .. } = say(&["verify", folder]);
    assert_eq!((code, err), (2, format!("error: no scenario in folder `{folder}`\n")));
}

#[test]
fn the_json_is_json_and_does_not_depend_on_the_number_of_jobs() {
    let folder = "tests/scenarios";
    let said = say(&["verify", folder, "--json", "--jobs", "1"]);
    for args in [["--json", "--jobs", "5"], ["--format", "json", "-j3"]] {
        let other = say(&[&["verify", folder], &args[..]].concat());
        assert_eq!((other.code, &other.out), (said.code, &said.out), "{args:?}");
    }
    assert_eq!(said.code, 1);
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), &said.out).unwrap();
    let expected = "fault: not ok, 2 runs, 2 failed, informational informational\n\
        missed: not ok, 1 runs, 0 failed, failed failed informational failed passed failed failed failed\n\
        mock: ok, 1 runs, 0 failed, passed informational informational passed\n\
        never: not ok, 1 runs, 1 failed, informational informational\n\
        slide: ok, 6 runs, 0 failed, passed passed passed passed informational informational passed passed passed passed informational \
         informational passed passed passed passed passed\n";
    assert_eq!(peer("verified.py", &[file.path().to_str().unwrap()]), expected);
}

#[test]
fn seeds_can_be_overridden_and_each_run_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("records");
    let said = say(&["verify", SLIDE, MOCK, "--seeds", "3", "--out", path.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    let mut names: Vec<String> =
        fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(names, ["mock.csv", "slide-1.csv", "slide-2.csv", "slide-3.csv"]);
    let [first, second] = ["slide-1.csv", "slide-2.csv"].map(|name| fs::read_to_string(path.join(name)).unwrap());
    assert!(first.contains("truth.x") && first != second, "another seed is other noise");
    let alone = folder.path().join("alone.csv");
    say(&[
        "run",
        "graphs/hybrid.toml",
        "--bench=graphs/benches/mock.toml",
        "--for=4s",
        "--out",
        alone.to_str().unwrap(),
    ]);
    // The request of a scenario has another hash, which stands above the rows.
    let rows = |path: &Path| fs::read_to_string(path).unwrap().split_once("\ntime,").unwrap().1.to_owned();
    assert!(rows(&alone) == rows(&path.join("mock.csv")), "a run is a run");
    assert_eq!(row(&said.out, "x", "response").len(), 9, "three seeds have no interval: {}", said.out);
}

/// The figure of a check in each run.
fn values(scenario: &Scenario, trials: &[Trial], check: &str, figure: Figure) -> Vec<f64> {
    let rows = scenario.rows(trials);
    let row = rows.iter().find(|row| row.check == check && row.figure == figure).expect("it is asked");
    row.values.iter().map(|value| value.expect("it is measured")).collect()
}

#[test]
fn figures_of_the_truth_are_those_of_the_closed_form_whatever_the_seed() {
    let scenario = loaded(&workspace().join(SLIDE)).unwrap_or_else(|why| panic!("{why}"));
    let run = |seed| scenario.run(&catalogue(), seed, None, &|| false).expect("nobody interrupts it");
    let trials: Vec<Trial> = scenario.runs().into_iter().map(run).collect();
    // Ten samples of 2 exp(-t/tau), each 4 ms, have the mean of the last times a geometric sum.
    let (tau, period) = (0.25, 0.004);
    let sum: f64 = (0..10).map(|k| libm::exp(f64::from(k) * period / tau)).sum::<f64>() / 10.0;
    let exact = tau * libm::log(2.0 * sum / 0.3);
    for response in values(&scenario, &trials, "true_x", Figure::Response) {
        assert!((0.0..period).contains(&(response - exact)), "{response}, not {exact}");
    }
    let measured = values(&scenario, &trials, "x", Figure::Error);
    assert!(measured.iter().any(|error| *error != measured[0]), "a seed is noise: {measured:?}");
    // White noise of 2 mN a tactel moves the centre of a contact of 3 N by some hundredths of a tactel.
    assert!(values(&scenario, &trials, "noise", Figure::Std).iter().all(|std| (1e-3..1e-2).contains(std)));
}

/// A scenario of a text in a folder of its own; `TESTS` stands for the folder of the tests.
fn written(files: &[(&str, &str)]) -> Result<Scenario, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let text = text.replace("TESTS", workspace().join("tests").to_str().unwrap());
        fs::write(folder.path().join(name), text).unwrap();
    }
    let (name, _) = files[0];
    loaded(&folder.path().join(name))
}

/// Loads a scenario with one bench.
fn loaded(path: &Path) -> Result<Scenario, String> {
    let mut scenarios = Scenario::load(&catalogue(), path).map_err(|report| report.render(false))?;
    assert_eq!(scenarios.len(), 1, "one bench");
    Ok(scenarios.remove(0))
}

#[test]
fn a_value_that_is_held_is_no_sample_of_the_mean() {
    // A tick each 2 ms, but a sample each 4 ms: ten of them are there after 36 ms, and no sooner.
    let task = "graph = { rate_hz = 500, bench = 'TESTS/scenarios/benches/slide.toml' }\nroles.pad = 'tactile_pad'\n\
        [parts.touch]\nfile = 'TESTS/../graphs/parts/touch.toml'\nin.image = 'pad.image'\n\
        [nodes.error]\ntype = 'feature_error'\nin.x = 'touch.x'\nsetpoint.x = 0.0\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("task.toml");
    fs::write(&path, task.replace("TESTS", workspace().join("tests").to_str().unwrap())).unwrap();
    let scenario = format!(
        "[scenario]\ngraph = {path:?}\nfor_s = 2.0\nfrom = 'touch.present'\n\
         [check.scalar]\nof = 'truth.force'\nsettles_to = 3.0\nwithin = 0.1\n\
         [check.feature]\nof = 'error.error.x'\nsettles_to = 0.0\nwithin = 1.0\n"
    );
    let scenario = written(&[("held.toml", &scenario)]).unwrap();
    let trial = scenario.run(&catalogue(), None, None, &|| false).unwrap();
    for check in ["scalar", "feature"] {
        let [response] = values(&scenario, std::slice::from_ref(&trial), check, Figure::Response)[..] else { panic!() };
        assert!((response - 0.036).abs() < 1e-9, "{check}: {response}");
    }
}

#[test]
fn a_run_may_be_done_early_but_samples_may_not_end_early() {
    let task = |modes: &str, pad: &str| {
        format!(
            "graph.clock = 'pad'\nroles.pad = 'tactile_pad'\nbind = {{ pad = 'pad', truth = 'pad' }}\n\
             [devices.pad]\ntype = 'true_pad'\n{pad}\n\
             [nodes.source]\ntype = 'tactile_source'\nin.image = 'pad.image'\n{modes}\n"
        )
    };
    let run = |task: &str, asks: &str| {
        let folder = tempfile::tempdir().unwrap();
        let [graph, scenario] = ["task.toml", "scenario.toml"].map(|name| folder.path().join(name));
        fs::write(&graph, task).unwrap();
        let text = format!("[scenario]\ngraph = 'task.toml'\nfor_s = 2.0\n{asks}\n[check.x]\nof = 'truth.force'\n");
        fs::write(&scenario, text).unwrap();
        let loaded = loaded(&scenario).unwrap_or_else(|why| panic!("{why}"));
        let trial = loaded.run(&catalogue(), None, None, &|| false).unwrap();
        let marks: Vec<Verdict> = loaded.rows(std::slice::from_ref(&trial)).iter().map(FigureRow::verdict).collect();
        (trial, marks)
    };
    let modes = "[modes.feel]\ndone = { after_ms = 1000 }\n[modes.other]\ngo = { to = 'feel', after_ms = 10 }\n";
    let with_modes = task(modes, "").replace("graph.clock = 'pad'", "graph = { clock = 'pad', start = 'other' }");
    let (trial, marks) = run(&with_modes, "ends_in = 'done'\nstays_in = 'feel'");
    assert_eq!((trial.failure, &marks[2..]), (None, &[Verdict::Passed; 2][..]));
    assert!((trial.time - 1.012).abs() < 0.01, "{}", trial.time);
    let only = with_modes.replace("to = 'feel', after_ms = 10", "to = 'feel', after_ms = 9000");
    let (trial, marks) = run(&only, "ends_in = 'other'\nstays_in = 'feel'");
    assert_eq!(
        (trial.failure, &marks[2..]),
        (None, &[Verdict::Failed, Verdict::Passed][..]),
        "a mode never reached, and the end"
    );
    // The last of two seconds of samples is a period before their end.
    let (trial, _) = run(&task("", "for_s = 2.0"), "");
    assert_eq!((trial.failure, (trial.time * 1e3).round()), (None, 1996.0));
    let (trial, _) = run(&task("", "for_s = 1.9"), "");
    assert_eq!(trial.failure.as_deref(), Some("a device has no more samples after 1.896 s, before `for_s` is over"));
    assert_eq!(trial.figures, [None, None]);
}

#[test]
fn colours_are_for_those_who_ask() {
    let [plain, asked] = ["never", "always"].map(|when| say(&["verify", MISSED, "--color", when]).out);
    assert!(!plain.contains('\u{1b}'));
    assert!(asked.contains("\u{1b}[1;31mFAILED\u{1b}[0m") && asked.contains("\u{1b}[32mpassed\u{1b}[0m"));
    let stripped = asked.replace("\u{1b}[1;31m", "").replace("\u{1b}[32m", "").replace("\u{1b}[0m", "");
    assert_eq!(stripped, plain, "colours take no room");
}

#[test]
fn what_cannot_be_a_scenario_is_told() {
    let cases = [
        ("[check.x]\nof = 'touch.x'\n", "error[missing-key]: the scenario has no section [scenario]"),
        ("scenario = 3\n", "error[bad-value]: expected a table, found 3"),
        ("check = 3\n[scenario]\n", "error[bad-value]: expected a table of checks, found 3"),
        ("[scenario]\ngraph = 'x'\n[scenario]\n", "error[syntax]"),
        (
            "[scenario]\ngraph = 'live.toml'\nfor_s = 1.0\n[check.x]\nof = 'length.value'\n",
            "error[wrong-role]: a device of this bench runs in real time, but scenarios run in virtual time",
        ),
        (
            "[scenario]\ngraph = 'TESTS/../graphs/hybrid.toml'\nbench = 'TESTS/scenarios/benches/slide.toml'\nfor_s = 1.0\n",
            "error[unbound-role]: the bench does not bind the role `arm`",
        ),
        (
            "[scenario]\ngraph = 'TESTS/scenarios/tasks/slide.toml'\nbench = 'no_device.toml'\nfor_s = 1.0\n",
            "error[unknown-device]: the bench has no device `pda`",
        ),
        (
            "[scenario]\ngraph = 'TESTS/scenarios/tasks/slide.toml'\nbench = 'live.toml'\nfor_s = 1.0\n",
            "error[unbound-role]: the bench does not bind the role `pad`",
        ),
    ];
    let live = "graph.rate_hz = 100\nroles.length = 'length'\nbind.length = 'length'\n\
        [devices.length]\ntype = 'line_length'\naddress = '127.0.0.1:9'\n";
    let no_device = "bind.pad = 'pda'\ndevices.pad.type = 'true_pad'\n";
    for (text, message) in cases {
        let files = [("scenario.toml", text), ("live.toml", live), ("no_device.toml", no_device)];
        let said = written(&files).expect_err(text);
        assert!(said.contains(message), "{text}: {said}");
    }
}

#[test]
fn check_knows_a_scenario_and_run_says_what_it_is() {
    let good = say(&["check", SLIDE]);
    let expected = format!("{SLIDE}: ok, a scenario of 6 runs, 4 s each; run it with `tactflow verify`\n");
    assert_eq!((good.code, good.err.as_str(), good.out), (0, "", expected));
    let bad = say(&["check", "tests/errors/scenarios/names.toml", "--format", "json"]);
    assert!(bad.code == 2 && bad.out.contains("\"code\": \"unknown-mode\""), "{}", bad.out);
    let set = say(&["check", SLIDE, "--set", "nodes.error.setpoint.x=1"]);
    assert!(
        set.code == 2 && set.err.contains("is a scenario, which names its own bench: remove `--bench` and `--set`"),
        "{}",
        set.err
    );
    let run = say(&["run", SLIDE]);
    assert!(run.code == 2 && run.err.contains("this is a scenario, not a graph"), "{}", run.err);
    assert!(run.err.contains("help: run it with `tactflow verify`"), "{}", run.err);
}

#[test]
fn ctrl_c_ends_it_cleanly_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let endless = folder.path().join("endless.toml");
    let tests = workspace().join("tests/scenarios/tasks/slide.toml");
    let text = format!("[scenario]\ngraph = {tests:?}\nfor_s = 1e6\n[check.x]\nof = \"touch.x\"\nnever_above = 1.0\n");
    fs::write(&endless, text).unwrap();
    let [scenario, out] = [&endless, &folder.path().join("out")].map(|path| path.to_str().unwrap().to_owned());
    let running = Running::start(&["verify", &scenario, "--out", &out], &Path::new(&out).join("endless.csv"));
    running.signal("-INT");
    let (_, said) = running.end();
    assert_eq!((said.code, said.err.as_str()), (1, "error: interrupted: some runs are missing\n"));
}

#[test]
fn the_page_shows_a_scenario_that_runs() {
    let page = fs::read_to_string(workspace().join("docs/scenarios.md")).unwrap();
    let shown = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    assert_eq!(shown, fs::read_to_string(workspace().join(SLIDE)).unwrap());
}

/// Three runs on a bench whose friction and whose object vary.
fn varied(vary: &str, bound: f64) -> String {
    let graphs = workspace().join("graphs").display().to_string();
    format!(
        "[scenario]\ngraph = '{graphs}/force.toml'\nbench = '{graphs}/benches/ball.toml'\nseeds = 3\nfor_s = 3.0\n\
         from = 'touch.present'\nvary = {vary}\n[check.force]\nof = 'truth.force'\nnever_above = {bound}\n"
    )
}

#[test]
fn parameters_vary_between_runs_and_the_worst_run_is_named_and_comes_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("varied.toml");
    let path = path.to_str().unwrap();
    let [object, friction] = ["devices.bench.objects.0.stiffness", "devices.bench.friction"];
    fs::write(path, varied(&format!("{{ {object} = [60.0, 1200.0], {friction} = [0.1, 1.0] }}"), 1.0)).unwrap();
    let said = say(&["verify", path, "--json"]);
    let found: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let scenario = &found["scenarios"][0];
    let values = scenario["rows"][0]["values"].as_array().unwrap();
    let stiffness = |run: usize| scenario["runs"][run]["varied"][object].as_f64().unwrap();
    assert!((0..3).all(|run| (60.0..=1200.0).contains(&stiffness(run))) && stiffness(0) != stiffness(1));
    let worst = (0..3).max_by(|a, b| values[*a].as_f64().unwrap().total_cmp(&values[*b].as_f64().unwrap())).unwrap();
    let page = say(&["verify", path]);
    assert_eq!(page.code, 1);
    let named = format!("max of force is worst with seed {}: --set {friction}=", worst + 1);
    assert!(page.out.contains(&named) && page.out.contains(&format!("{object} = 60 to 1200")), "{}", page.out);
    // The same run by hand.
    let set = |name: &str| format!("{name}={:?}", scenario["runs"][worst]["varied"][name].as_f64().unwrap());
    let out = folder.path().join("run.csv").display().to_string();
    let args = ["run", "graphs/force.toml", "--quiet", "--for", "3s", "--out", &out];
    let seed = format!("devices.bench.seed={}", worst + 1);
    let sets = [set(object), set(friction), seed];
    let run = say(&args.into_iter().chain(sets.iter().flat_map(|set| ["--set", set])).collect::<Vec<_>>());
    assert_eq!(run.code, 0, "{}", run.err);
    let text = fs::read_to_string(&out).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let column = lines.next().unwrap().split(',').position(|name| name == "truth.force").unwrap();
    let force = lines.filter_map(|line| line.split(',').nth(column)?.parse::<f64>().ok()).fold(0.0, f64::max);
    assert!((force - values[worst].as_f64().unwrap()).abs() < 1e-9, "{force}");
}

#[test]
fn what_cannot_vary_is_named_at_its_values() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("varied.toml");
    let friction = "{ devices.bench.friction = [0.1, 1.0] }";
    for (text, why) in [
        (varied("{ devices.bench.friction = [1.0] }", 9.0), "expected two numbers, the smaller one first"),
        (varied("{ devices.bench.friction = [1.0, 0.1] }", 9.0), "expected two numbers, the smaller one first"),
        (varied("{ devices.bench.friction = [0.1, inf] }", 9.0), "expected two numbers, the smaller one first"),
        (varied("[0.1, 1.0]", 9.0), "expected parameters of devices, each with its smallest and its largest value"),
        (varied("{ devices.bench.frction = [0.1, 1.0] }", 9.0), "`frction` is not a parameter here"),
        (varied("{ devices.bench.frction = [0.1, 1.0] }", 9.0), "did you mean `friction`"),
        (varied("{ devices.bnch.friction = [0.1, 1.0] }", 9.0), "did you mean `bench`?"),
        (varied("{ devices.bench.friction = [-0.1, 1.0] }", 9.0), "expected a number, 0 or more [N m], found -0.1"),
        (varied("{ devices.bench.rows = [8, 16] }", 9.0), "a parameter that takes any number can vary"),
        (varied("{ nodes.pid.gains.pressure.kp = [0.1, 1.0] }", 9.0), "is no parameter of a device"),
        (
            varied("{ devices.bench.objects.1.stiffness = [60.0, 90.0] }", 9.0),
            "`devices.bench.objects.1.stiffness=60.0`",
        ),
        (varied("{ devices.bench.objects.00.stiffness = [60.0, 90.0] }", 9.0), "does not load"),
        (varied(friction, 9.0).replace("seeds = 3\n", ""), "has no `seeds`, so nothing can vary"),
    ] {
        fs::write(&path, &text).unwrap();
        let said = say(&["verify", path.to_str().unwrap()]);
        assert_eq!(said.code, 2, "{text}");
        assert!(said.err.contains(why) && said.err.contains("varied.toml:"), "{text}{}", said.err);
    }
}

#[test]
fn a_scenario_runs_on_each_of_its_benches_and_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("both.toml");
    let path = path.to_str().unwrap();
    let benches = workspace().join("graphs/benches").display().to_string();
    let on = |names: &[&str]| {
        let names: Vec<String> = names.iter().map(|name| format!("'{benches}/{name}.toml'")).collect();
        let list = format!("bench = [{}]", names.join(", "));
        let text = varied("{ devices.bench.friction = [0.1, 1.0] }", 8.0);
        text.replace(&format!("bench = '{benches}/ball.toml'"), &list)
    };
    fs::write(path, on(&["ball", "pen"])).unwrap();
    let records = folder.path().join("records");
    let said = say(&["verify", path, "--seeds", "2", "--json", "--out", records.to_str().unwrap()]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let found: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let scenarios = found["scenarios"].as_array().unwrap();
    let names: Vec<&str> = scenarios.iter().map(|scenario| scenario["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["both on ball", "both on pen"]);
    let force = |i: usize| scenarios[i]["rows"][0]["values"][0].as_f64().unwrap();
    assert!((force(0) - force(1)).abs() > 1e-3, "a ball and a pen have different forces");
    for file in ["both_on_ball-1.csv", "both_on_ball-2.csv", "both_on_pen-1.csv", "both_on_pen-2.csv"] {
        assert!(records.join(file).exists(), "{file}");
    }
    let checked = say(&["check", path]);
    assert!(checked.out.contains("a scenario of 6 runs on 2 benches, 3 s each"), "{}", checked.out);
    // A mistake of one bench is shown once, and at its place.
    fs::write(path, on(&["ball", "pin"])).unwrap();
    let said = say(&["verify", path]);
    assert_eq!((said.code, said.err.matches("error[").count()), (2, 1), "{}", said.err);
    assert!(said.err.contains("pin.toml") && said.err.contains("both.toml:3:"), "{}", said.err);
    // Two benches of one name would have one name in the table, and a live one is marked where it stands.
    for (names, why) in [
        (["ball", "ball"], "expected benches whose files have different names"),
        (["ball", "myrmex_lwr"], "runs in real time"),
    ] {
        fs::write(path, on(&names)).unwrap();
        let said = say(&["verify", path]);
        assert_eq!(said.code, 2, "{}", said.err);
        assert!(said.err.contains(why), "{}", said.err);
        let mark = said.err.lines().find(|line| line.contains('^')).unwrap().find('^').unwrap();
        let line = said.err.lines().find(|line| line.contains("bench = [")).unwrap();
        assert!(
            line[mark..].starts_with('\'')
                && line[mark + 1..].split('\'').next().unwrap().ends_with(&format!("{}.toml", names[1])),
            "{}",
            said.err
        );
        assert_eq!(line[mark..].matches(".toml").count(), 1, "the second one is marked: {}", said.err);
    }
    fs::write(path, on(&[])).unwrap();
    let said = say(&["verify", path]);
    assert!(said.err.contains("expected the path of a bench, or a list of such paths"), "{}", said.err);
}
