//! `explain` against what a run measures: the lag behind a ramp, the bandwidth of a step, the stopping distance and the
//! impact force of a touch.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
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

/// Period of the rows [s].
const PERIOD: f64 = 0.004;
/// The setpoints of the pressure, from a time on [s, N per tactel].
const STEPS: [(f64, f64); 3] = [(0.0, 0.10), (6.0, 0.12), (10.0, 0.10)];
/// Rows that a step is given [1].
const ROWS: usize = (4.0 / PERIOD) as usize;

/// The filtered pressure after a step of its setpoint, as a fraction of the step: the mean of three seeds, and of a step
/// up and one down, because foam that is pressed answers otherwise than foam that comes back.
fn step_of_pressure(bench: &str) -> Vec<f64> {
    let graphs = workspace().join("graphs").display().to_string();
    let shipped = fs::read_to_string(format!("{graphs}/force.toml")).unwrap();
    let own = shipped
        .replace("file = \"", &format!("file = \"{graphs}/"))
        .replace("bench = \"", &format!("bench = \"{graphs}/"))
        .replace("{ from = \"pad.pressure\" }", &STEPS[0].1.to_string());
    let (_folder, path) = in_new_folder("force.toml");
    fs::write(&path, own + "\n[live]\nerror.setpoint.pressure = { min = 0.0, max = 0.2, rate = 10.0 }\n").unwrap();
    let bench = format!("{graphs}/benches/{bench}.toml");
    let [up, down] = [STEPS[1], STEPS[2]].map(|(at, to)| format!("{at}s:error.setpoint.pressure={to}"));
    let runs = ["1", "2", "3"].map(|seed| {
        let seed = format!("devices.bench.seed={seed}");
        let args = [&path, "--bench", &bench, "--change", &up, "--change", &down, "--set", &seed];
        recorded(&args, "14.1s").iter().map(|row| row.get("calm.value").copied().unwrap_or(0.0)).collect::<Vec<f64>>()
    });
    let steps = runs.iter().flat_map(|run| STEPS.windows(2).map(move |pair| step_in(run, pair[0].1, pair[1])));
    let mut mean = vec![0.0; ROWS];
    for step in steps {
        mean.iter_mut().zip(step).for_each(|(sum, value)| *sum += value / 6.0);
    }
    mean
}

/// One step, from the mean of the second before it, as a fraction of what was asked for.
fn step_in(run: &[f64], from: f64, (at, to): (f64, f64)) -> Vec<f64> {
    let (at, second) = ((at / PERIOD) as usize, (1.0 / PERIOD) as usize);
    let rest = run[at - second..at].iter().sum::<f64>() / second as f64;
    run[at..at + ROWS].iter().map(|pressure| (pressure - rest) / (to - from)).collect()
}

/// The frequency at which the response to a step falls below 71 % [Hz]: the closed loop is
/// T(w) = 1 - j w ∫ (1 - y) exp(-j w t) dt.
fn bandwidth(step: &[f64]) -> f64 {
    let passes = |hz: f64| {
        let omega = TAU * hz;
        let (re, im) = step.iter().enumerate().fold((0.0, 0.0), |(re, im), (tick, y)| {
            let (sin, cos) = (omega * PERIOD * tick as f64).sin_cos();
            (re + (1.0 - y) * cos * PERIOD, im - (1.0 - y) * sin * PERIOD)
        });
        (1.0 + omega * im).hypot(omega * re)
    };
    (10..).map(|hundredths| f64::from(hundredths) * 0.01).find(|hz| passes(*hz) < 0.5_f64.sqrt()).unwrap()
}

#[test]
fn the_bandwidth_is_the_one_of_a_step() {
    // A first-order step with a time constant of 0.4 s: the measurement alone.
    let first_order: Vec<f64> = (0..ROWS).map(|tick| 1.0 - (-PERIOD * tick as f64 / 0.4).exp()).collect();
    assert!((bandwidth(&first_order) - 1.0 / (TAU * 0.4)).abs() < 0.015);
    for bench in ["ball", "pen", "toy_box"] {
        let (ran, explained) =
            (bandwidth(&step_of_pressure(bench)), of_loop("force", bench, "pressure", "bandwidth_hz"));
        assert!((ran / explained - 1.0).abs() < 0.2, "{bench}: {ran} Hz, explained {explained} Hz");
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
    // Two periods of 4 ms, 3 ms of latency, and 2 m/s².
    assert!((distance - (0.015 * 0.011 + 0.015 * 0.015 / 4.0)).abs() < 1e-12, "{distance}");
    let impact = reach["impacts"][0]["force_n"].as_f64().unwrap();
    assert!((impact - 0.015 * 10_000.0 / (TAU * 7.8)).abs() < 1e-9, "{impact}");
    let search = approach(&args, "servo", "move.lost");
    assert_eq!(search["speed_m_per_s"], 0.005);
    // A motion away from the object, or along it, has no impact.
    let away = approach(&["graphs/square.toml", args[1], args[2]], "retreat", "reach");
    let along = approach(&["graphs/cable.toml", args[1], args[2]], "servo", "guide");
    assert_eq!((&away["impacts"], &along["impacts"]), (&serde_json::json!([]), &serde_json::json!([])));
    // The commanded distance from the tick after `stop` until rest.
    let stopped = recorded(&[args[0], args[1], args[2], "--send", "0.2s:stop", "--send", "0.3s:resume"], "0.3s");
    let distance_of = |rows: &[BTreeMap<String, f64>]| -> f64 {
        rows.iter().filter_map(|row| row.get("move.acceleration.twist.vz")).map(|speed| speed * 0.004).sum()
    };
    let from = stopped.iter().position(|row| row["time"] > 0.2).unwrap();
    let ran = distance_of(&stopped[from..]);
    assert!(ran > 0.0 && ran < distance, "{ran} m, explained {distance} m");
    // Without a command back, the first 100 ms of a touch press with the moving mass.
    let rows = recorded(&args, "1s");
    let force = |row: &BTreeMap<String, f64>| row.get("truth.force").copied().unwrap_or(0.0);
    let touch = rows.iter().position(|row| force(row) > 0.02).unwrap();
    let most = rows[touch..touch + 25].iter().map(force).fold(0.0, f64::max);
    assert!(most > impact / 5.0 && most < impact, "{most} N, explained {impact} N");
}
