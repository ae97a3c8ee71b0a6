//! `explain` against what a run measures: the lag behind a ramp, the stopping distance and the impact force of a touch.

use std::fs;

use serde_json::Value;
use tactflow_tests::workspace;

use crate::cli::in_new_folder;
use crate::control_law::{explained, recorded};
use crate::tool::say;

/// What a scenario measures with three seeds: the median of one figure of one check.
fn measured(scenario: &str, check: &str, figure: &str) -> f64 {
    let (_folder, path) = in_new_folder("scenario.toml");
    fs::write(&path, scenario).unwrap();
    let said = say(&["verify", &path, "--json"]);
    let found: Value = serde_json::from_str(&said.out).unwrap_or_else(|error| panic!("{error}: {}", said.err));
    let rows = found["scenarios"][0]["rows"].as_array().unwrap();
    let row = rows.iter().find(|row| row["check"] == check && row["figure"] == figure);
    row.and_then(|row| row["median"].as_f64()).unwrap_or_else(|| panic!("{check}, {figure}: {}", said.out))
}

fn scenario(task: &str, bench: &str, rest: &str) -> String {
    let graphs = workspace().join("graphs").display().to_string();
    format!(
        "[scenario]\ngraph = '{graphs}/{task}.toml'\nbench = '{graphs}/benches/{bench}.toml'\nseeds = 3\nfor_s = 9.0\n\
         from = 'touch.present'\n{rest}"
    )
}

/// A number of the loop of a feature in the mode `servo`.
fn of_loop(task: &str, bench: &str, feature: &str, key: &str) -> f64 {
    let bench = format!("graphs/benches/{bench}.toml");
    let explained = explained(&[&format!("graphs/{task}.toml"), "--bench", &bench]);
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    let mode = modes.iter().find(|mode| mode["mode"] == "servo").unwrap();
    let one = mode["loops"].as_array().unwrap().iter().find(|one| one["feature"] == feature).unwrap();
    one["margins"][key].as_f64().unwrap()
}

#[test]
fn the_lag_behind_a_ramp_is_the_one_that_explain_prints() {
    // Along y the arm is soft, and the contact sticks to the foam and slips: the lag is then larger.
    for (task, bench) in [("hybrid", "ball"), ("hybrid", "pen"), ("position", "ball")] {
        let check = "[check.x]\nof = 'error.error.x'\nafter_s = 5.0\n";
        let ramp = "[[inject]]\nrole = 'pad'\nfault = 'moving'\nfrom_s = 3.0\nvelocity_m_per_s = [0.002, 0, 0]\n";
        let lag = measured(&scenario(task, bench, &format!("{check}{ramp}")), "x", "mean").abs() / 0.002;
        let explained = of_loop(task, bench, "x", "ramp_lag_s");
        assert!((lag / explained - 1.0).abs() < 0.2, "{task} on {bench}: {lag} s, explained {explained} s");
    }
}

/// The approaches of a mode, by the node that makes them.
fn approach(args: &[&str], mode: &str, node: &str) -> Value {
    let explained = explained(args);
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    let mode = modes.iter().find(|one| one["mode"] == mode).unwrap();
    let approaches = mode["approaches"].as_array().unwrap();
    approaches.iter().find(|one| one["node"] == node).unwrap_or_else(|| panic!("{approaches:?}")).clone()
}

#[test]
fn the_stopping_distance_bounds_that_of_a_run_and_the_impact_bounds_its_force() {
    let args = ["graphs/hybrid.toml", "--bench", "graphs/benches/pen.toml"];
    let reach = approach(&args, "approach", "reach");
    let distance = reach["stopping_distance_m"].as_f64().unwrap();
    // Two periods of 4 ms, 2 ms of latency, and 2 m/s².
    assert!((distance - (0.015 * 0.010 + 0.015 * 0.015 / 4.0)).abs() < 1e-12, "{distance}");
    let impact = reach["impacts"][0]["force_n"].as_f64().unwrap();
    assert!((impact - 0.015 * 10_000.0 / (std::f64::consts::TAU * 6.6)).abs() < 1e-9, "{impact}");
    let search = approach(&args, "servo", "move.lost");
    assert_eq!(search["speed_m_per_s"], 0.005);
    // A motion away from the object, or along it, has no impact.
    let away = approach(&["graphs/square.toml", args[1], args[2]], "retreat", "reach");
    let along = approach(&["graphs/cable.toml", args[1], args[2]], "servo", "guide");
    assert_eq!((&away["impacts"], &along["impacts"]), (&serde_json::json!([]), &serde_json::json!([])));
    // The commanded distance from the tick after `stop` until rest.
    let stopped = recorded(&[args[0], args[1], args[2], "--send", "0.2s:stop", "--send", "0.3s:resume"], "0.3s");
    let distance_of = |rows: &[std::collections::BTreeMap<String, f64>]| -> f64 {
        rows.iter().filter_map(|row| row.get("move.acceleration.twist.vz")).map(|speed| speed * 0.004).sum()
    };
    let from = stopped.iter().position(|row| row["time"] > 0.2).unwrap();
    let ran = distance_of(&stopped[from..]);
    assert!(ran > 0.0 && ran < distance, "{ran} m, explained {distance} m");
    // Without a command back, the first 100 ms of a touch press with the moving mass.
    let rows = recorded(&args, "1s");
    let force = |row: &std::collections::BTreeMap<String, f64>| row.get("truth.force").copied().unwrap_or(0.0);
    let touch = rows.iter().position(|row| force(row) > 0.02).unwrap();
    let most = rows[touch..touch + 25].iter().map(force).fold(0.0, f64::max);
    assert!(most > impact / 5.0 && most < impact, "{most} N, explained {impact} N");
}
