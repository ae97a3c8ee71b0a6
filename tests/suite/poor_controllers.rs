//! Poor controllers: each shipped task with one mistake gets the warning of this mistake and no other, and good variants
//! of the tasks get none.

mod columns;
mod good;
mod live;
mod mounts;
mod pairs;
mod poor;
mod reach;
mod variant;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::source::Report;
use tactflow_tests::{catalogue, toml_files, workspace};

use crate::cli::in_new_folder;
use crate::control_law::explained;
use columns::{more_wrong_columns, wrong_columns};
use good::{good, good_at_second_sight, good_behind_nodes, good_by_exits, good_by_modes, good_by_turns};
use live::{good_by_others, poor_by_others};
use mounts::{good_mounts, half_turn, poor_mounts};
use pairs::{good_pairs, poor_pairs};
use poor::{at_second_sight, opposed, poor_behind_nodes, poor_filters_and_motions, poor_gains, poor_modes, poor_sums};
use reach::{never_present, never_reached};
use variant::{graph, variant};

fn codes(report: Option<&Report>) -> BTreeSet<&'static str> {
    report.iter().flat_map(|report| &report.diagnostics).map(|diagnostic| diagnostic.code.name()).collect()
}

/// Applies all fixes, and returns the text of the graph; `None` if they change something else.
fn fixed(report: &Report, graph: &Path) -> Option<String> {
    let fixes: Vec<_> = report.diagnostics.iter().flat_map(|diagnostic| &diagnostic.fix).cloned().collect();
    let files = report.sources.edited(&fixes);
    files.into_iter().find(|(name, _)| Path::new(name) == graph).map(|(_, text)| text)
}

#[test]
fn each_poor_controller_gets_its_warning_and_no_other() {
    let mut wrong = Vec::new();
    let poor = [
        wrong_columns(),
        more_wrong_columns(),
        poor_mounts(),
        poor_gains(),
        poor_modes(),
        poor_behind_nodes(),
        poor_sums(),
        opposed(),
        never_reached(),
        never_present(),
        at_second_sight(),
        poor_filters_and_motions(),
        poor_pairs(),
        poor_by_others(),
    ];
    let poor: Vec<_> = poor.into_iter().flatten().collect();
    assert!(poor.len() > 50, "{}", poor.len());
    let kinds: BTreeSet<_> = poor.iter().map(|(code, _)| *code).collect();
    for (code, variant) in &poor {
        let named = || format!("{}, {:?}", variant.task, variant.changes);
        let report = variant.warnings();
        if codes(report.as_ref()) != BTreeSet::from([*code]) {
            let found = report.map(|report| report.render(false)).unwrap_or_default();
            wrong.push(format!("{code}: {}\n{found}", named()));
            continue;
        }
        let report = report.unwrap();
        let Some(text) = fixed(&report, &graph(variant.task)) else { continue };
        let after = variant.compiled(text).warnings();
        if !codes(after.as_ref()).is_empty() {
            let helps: Vec<_> = report.diagnostics.iter().map(|diagnostic| &diagnostic.help).collect();
            wrong.push(format!("{code}: {} still has {:?} after {helps:?}", named(), codes(after.as_ref())));
        }
    }
    assert!(wrong.is_empty(), "{} of {}\n{}", wrong.len(), poor.len(), wrong.join("\n"));
    assert!(kinds.len() > 12, "{kinds:?}");
}

#[test]
fn no_good_controller_is_blamed() {
    let good = [
        good(),
        good_behind_nodes(),
        good_at_second_sight(),
        good_by_turns(),
        good_by_modes(),
        good_by_exits(),
        good_mounts(),
        good_pairs(),
        good_by_others(),
    ]
    .into_iter()
    .flatten()
    .collect::<Vec<_>>();
    assert!(good.len() > 60, "{}", good.len());
    let reports = good.iter().filter_map(|variant| Some((variant, variant.warnings()?)));
    let wrong: Vec<String> = reports
        .map(|(variant, report)| format!("{}, {:?}\n{}", variant.task, variant.changes, report.render(false)))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn both_arms_of_two_arms_have_the_contact_of_the_bench_whose_ball_they_press() {
    let contacts = |bench: &str, arm: &str| {
        let text = std::fs::read_to_string(workspace().join("graphs/benches").join(bench)).unwrap();
        let bench: toml::Table = text.parse().unwrap();
        bench["facts"][arm]["contacts"].clone()
    };
    for arm in ["left_arm", "right_arm"] {
        assert_eq!(contacts("two_arms.toml", arm), contacts("ball.toml", "arm"), "{arm}");
    }
}

#[test]
fn no_shipped_task_is_blamed_on_any_bench_that_it_runs_on() {
    let (mut pairs, mut wrong) = (0, Vec::new());
    let folder = workspace().join("graphs");
    let benches: Vec<Option<PathBuf>> =
        [None].into_iter().chain(toml_files(&folder.join("benches")).into_iter().map(Some)).collect();
    // A bench that waits for a simulator to connect is left out.
    let waits = |bench: &Option<PathBuf>| bench.as_ref().is_some_and(|bench| bench.ends_with("lockstep.toml"));
    for task in toml_files(&folder) {
        for bench in benches.iter().filter(|bench| !waits(bench)) {
            let request = Request { bench: bench.clone(), ..Request::file(&task) };
            let Ok(compiled) = compile(&catalogue(), &request) else { continue };
            pairs += 1;
            wrong.extend(compiled.warnings().map(|report| format!("{bench:?}\n{}", report.render(false))));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(pairs > 100, "{pairs} pairs of a task and a bench");
}

/// Returns the help of the first warning of a variant.
fn help(task: &'static str, changes: &[&str]) -> String {
    let report = variant(task, changes).warnings().unwrap_or_else(|| panic!("{task}, {changes:?}: no warning"));
    report.diagnostics[0].help.clone().unwrap()
}

#[test]
fn the_help_states_the_column_that_has_to_be_written_before_the_mount() {
    let contact = "set facts.arm.contacts=[{ object = \"ball\", x = { vx = 1.0 } }]";
    let columns = ["columns.x = [1, 0, 0, 0, 0, 0]", "columns.y = [0, 1, 0, 0, 0, 0]"];
    let help = help("hybrid", &[&half_turn()[..], &columns, &[contact]].concat());
    assert!(help.starts_with("write `columns.x = [-1, 0, 0, 0, 0, 0]`: `turned` turns it"), "{help}");
}

#[test]
fn a_fix_before_a_mount_moves_the_arm_along_what_changes_the_feature_and_nothing_else() {
    let quarter = "set nodes.mount.rpy=[0, 0, 1.5707963]";
    let roll = ["columns.x = [-1, 0, 0, 0, -20, 0]", "columns.y = [0, -1, 0, 20, 0, 0]"];
    let rolls = ["select = [1, 1, 1, 1, 1, 0]", "set nodes.mount.xyz=[0.05, 0.02, 0.03]", roll[0], roll[1]];
    for (changes, right) in [
        (&[][..], [("x", [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ("y", [0.0, -1.0, 0.0, 0.0, 0.0, 0.0])]),
        (&[quarter], [("x", [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ("y", [0.0, -1.0, 0.0, 0.0, 0.0, 0.0])]),
        (
            &[quarter, rolls[0], rolls[1], rolls[2], rolls[3]],
            [("x", [-1.0, 0.0, 0.0, 0.0, -20.0, 0.0]), ("y", [0.0, -1.0, 0.0, 20.0, 0.0, 0.0])],
        ),
        (&["set nodes.mount.rpy=[0, 1.0, 0]"], [("pressure", [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]); 2]),
    ] {
        let poor = variant("hybrid", &[&half_turn()[..], changes].concat());
        let text = fixed(&poor.warnings().unwrap(), &graph("hybrid")).unwrap();
        let (_folder, path) = in_new_folder("hybrid.toml");
        let shipped = workspace().join("graphs");
        let text = ["parts/", "benches/", "robots/"].iter().fold(text, |text, folder| {
            text.replace(&format!("\"{folder}"), &format!("\"{}/{folder}", shipped.display()))
        });
        std::fs::write(&path, text).unwrap();
        let sets = poor.changes.iter().filter_map(|change| change.strip_prefix("set "));
        let sets: Vec<&str> = sets.flat_map(|set| ["--set", set]).collect();
        let page = explained(&[&[&*path], &sets[..]].concat());
        let modes = page["motions"][0]["modes"].as_array().unwrap();
        let servo = modes.iter().find(|mode| mode["mode"] == "servo").unwrap();
        for (name, column) in right {
            let features = servo["features"].as_array().unwrap();
            let found = &features.iter().find(|feature| feature["name"] == name).unwrap()["column"];
            let found: [f64; 6] = serde_json::from_value(found.clone()).unwrap();
            let is_near =
                found.iter().zip(column).all(|(found, wanted)| (found - wanted).abs() < 0.01 * wanted.abs().max(1.0));
            assert!(is_near, "{changes:?}, {name}: {found:?}");
        }
    }
}

#[test]
fn a_projector_before_a_mount_keeps_a_fix_away() {
    let quarter = ["set nodes.mount.rpy=[0, 0, 1.5707963]", "select = [1, 0, 1, 0, 0, 0]"];
    let report = variant("hybrid", &[&half_turn()[..], &quarter].concat()).warnings().unwrap();
    let shown = report.render(false);
    assert!(shown.contains("what the projectors before it select") && !shown.contains("write `columns."), "{shown}");
}

#[test]
fn a_column_that_a_mode_sets_is_marked_where_it_stands() {
    let text = |change: &str| variant("hybrid", &[change]).warnings().map(|report| report.render(false));
    let found = text("set modes.servo.set.jacobian.columns.pressure=[0, 0, 30, 0, 0, 0]").unwrap();
    assert!(found.contains("in mode `servo`, this column counts"), "{found}");
    let found = text("columns.pressure = [0, 0, 30, 0, 0, 0]").unwrap();
    assert!(!found.contains("this column counts"), "{found}");
}

#[test]
fn an_integral_that_a_mode_lets_wind_up_is_marked_at_the_bound_that_the_mode_sets() {
    let changes =
        ["set nodes.pid.gains.x={ kp = 2.0, ki = 0.5, within = 0.003 }", "set modes.servo.set.pid.gains.x.within=0.2"];
    let shown = variant("hybrid", &changes).warnings().map(|report| report.render(false)).unwrap();
    assert!(
        shown.contains("1 | modes.servo.set.pid.gains.x.within=0.2\n  |                                    ^^^"),
        "{shown}"
    );
}

#[test]
fn an_exit_that_waits_for_another_error_does_not_need_this_one() {
    let changes = |when: &str| {
        [
            "select = [0, 0, 1, 0, 0, 0]".to_owned(),
            "set nodes.wide_error.type=\"feature_error\"".to_owned(),
            "set nodes.wide_error.in.pressure=\"calm.value\"".to_owned(),
            "set nodes.wide_error.in.orientation=\"touch.orientation\"".to_owned(),
            "set nodes.wide_error.setpoint={ pressure = 0.1, orientation = 1.5708 }".to_owned(),
            "set nodes.pid.in.error=\"wide_error.error\"".to_owned(),
            format!("set modes.servo.go={{ to = \"approach\", when = {when:?}, above = 0.5, for_ms = 20 }}"),
        ]
    };
    for (when, way) in [
        ("wide_error.error.orientation", "measure the error of `orientation` in a `feature_error` of its own"),
        ("error.error.orientation", "or remove the feature"),
    ] {
        let changes = changes(when);
        let help = help("edge", &changes.each_ref().map(|change| &**change));
        assert!(help.contains(way), "{when}: {help}");
    }
}

#[test]
fn the_help_of_a_held_place_leaves_the_control_of_the_force() {
    for (task, change, fix) in [
        ("square", "in_plane = false", "write `in_plane = true` in `path`"),
        ("guided", "speed_rad_per_s = 0.1\nspeed_m_per_s = 0.02", "write `speed_m_per_s = 0.0` in `level`"),
    ] {
        let help = help(task, &[change]);
        assert!(help.starts_with(fix), "{help}");
    }
}

#[test]
fn a_gain_that_is_too_large_for_its_rise_is_to_become_smaller() {
    let text = help("hybrid", &["gains.x = { kp = 12.0, rise = 0.1 }", "set facts.arm.contacts=[]"]);
    assert!(
        text.starts_with(
            "write `kp = 3.1` or less, which this `rise` can follow. An arm without springs in its joints"
        ),
        "{text}"
    );
    let text = help("hybrid", &["gains.x = { kp = 3.0, rise = 0.005 }"]);
    assert!(text.starts_with("write `rise = 0.09` or more, or remove it"), "{text}");
}

#[test]
fn a_range_that_leaves_a_small_margin_says_which() {
    let text = |most: f64| {
        let change = format!("set live.pid.gains.y.kp.max={most}");
        variant("hybrid", &[&change]).warnings().map(|report| report.render(false)).unwrap()
    };
    let small = text(11.0);
    assert!(small.contains("the gain margin of the loop of `y` is then only 1.9 dB over `ball`"), "{small}");
    let none = text(20.0);
    assert!(none.contains("the loop of `y` is then unstable over `ball`"), "{none}");
}

#[test]
fn a_rule_that_is_broken_on_purpose_is_allowed_with_its_reason() {
    let changes =
        ["gains.x = { kp = 17.5 }", "+[allow]", "+low-margin = \"it rings on purpose, to show what ringing is\""];
    let compiled = variant("hybrid", &changes).compiled(variant("hybrid", &changes).text());
    assert!(compiled.warnings().is_none());
    assert_eq!(compiled.allowed()[0].count, 1);
}

#[test]
fn the_numbers_of_a_warning_are_those_of_explain() {
    let args = ["graphs/edge.toml", "--set", "nodes.pid.gains.pressure.kp=2.5"];
    let said = crate::tool::say(&[&["explain"], &args[..], &["--format", "json"]].concat());
    let explained: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let loops = explained["motions"][0]["modes"][1]["loops"].as_array().unwrap();
    let margins = &loops.iter().find(|one| one["feature"] == "pressure").unwrap()["margins"];
    let [peak, gain, phase] = ["peak_sensitivity", "gain_db", "phase_deg"].map(|key| margins[key].as_f64().unwrap());
    let phase = phase.floor();
    let expected =
        format!("the peak of its sensitivity is {peak:.2}, its gain margin {gain:.1} dB and its phase margin {phase}°");
    let checked = crate::tool::say(&[&["check"], &args[..]].concat());
    assert!(checked.err.contains(&expected), "{expected}\n{}", checked.err);
    let run = crate::tool::say(&[&["run"], &args[..], &["--for", "10ms", "--quiet"]].concat());
    assert!(run.err.contains("warning[low-margin]"), "{}", run.err);
}

#[test]
fn a_schedule_that_makes_the_gains_larger_is_named_where_its_bound_stands() {
    let factors = ["--set", "parts.answer.set.stiffness.nominal=150", "--set", "nodes.schedule.max=10"];
    let pen = ["check", "graphs/force.toml", "--bench", "graphs/benches/pen.toml"];
    let checked = crate::tool::say(&[&pen[..], &factors[..]].concat());
    let note = "note: `schedule` multiplies the gains by 10.0 over `pen`\n  --> command line:1:20\n";
    assert!(checked.err.contains("warning[low-margin]") && checked.err.contains(note), "{}", checked.err);
    // One that makes them smaller is no reason.
    let gain = ["--set", "nodes.pid.gains.pressure.kp=4", "--set", "parts.answer.set.stiffness.nominal=5"];
    let checked = crate::tool::say(&[&pen[..], &gain[..]].concat());
    assert!(checked.err.contains("warning[low-margin]") && !checked.err.contains("multiplies"), "{}", checked.err);
}
