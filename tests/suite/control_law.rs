//! `explain`: its numbers are those of a run.

use std::collections::BTreeMap;
use std::fs;

use serde_json::Value;

use crate::cli::in_new_folder;
use crate::tool::say;

/// The rows of a recording, each by the names of its columns; absent values are left out.
pub(crate) fn recorded(args: &[&str], for_s: &str) -> Vec<BTreeMap<String, f64>> {
    let (_folder, path) = in_new_folder("run.csv");
    let run = say(&[&["run"], args, &["--quiet", "--for", for_s, "--out", &path]].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    rows(&path)
}

/// The rows of a file in CSV, each by the names of its columns; absent values are left out.
pub(crate) fn rows(path: &str) -> Vec<BTreeMap<String, f64>> {
    let text = fs::read_to_string(path).unwrap();
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let cells = names.iter().zip(line.split(','));
        cells.filter_map(|(name, cell)| Some(((*name).to_owned(), cell.parse().ok()?))).collect()
    };
    lines.map(row).collect()
}

pub(crate) fn explained(args: &[&str]) -> Value {
    let said = say(&[&["explain"], args, &["--format", "json"]].concat());
    assert_eq!(said.code, 0, "{}", said.err);
    serde_json::from_str(&said.out).unwrap()
}

/// The factor of a schedule on the control of a feature in a tick.
fn factor(schedule: &Value, row: &BTreeMap<String, f64>) -> f64 {
    let Some(ratio) = row.get("answer.stiffness.ratio") else { return 1.0 };
    let bound = |key: &str| schedule[key].as_f64().unwrap();
    (1.0 / ratio).clamp(bound("min"), bound("max"))
}

/// The control that a controller may take from one tick to the next: within its `limit`, and as its `rise` allows.
fn grown(feature: &Value, wanted: f64, last: &BTreeMap<String, f64>, row: &BTreeMap<String, f64>) -> f64 {
    let limit = feature["limit"].as_f64().unwrap_or(f64::INFINITY);
    let wanted = wanted.clamp(-limit, limit);
    let Some(rise) = feature["rise"].as_f64() else { return wanted };
    let name = format!("pid.control.{}", feature["name"].as_str().unwrap());
    let control = last.get(&name).copied().unwrap_or(0.0);
    let (step, least) = (rise * (row["time"] - last["time"]), rise * 0.02);
    wanted.clamp((control.min(0.0) - step).min(-least), (control.max(0.0) + step).max(least))
}

/// The rate of an error behind its low-pass filter of 30 ms, which begins at zero with the first control.
fn smooth_rate(rate: f64, name: &str, last: &BTreeMap<String, f64>, row: &BTreeMap<String, f64>) -> f64 {
    let error = format!("error.error.{name}");
    if !last.contains_key(&format!("pid.control.{name}")) {
        return 0.0;
    }
    let step = row["time"] - last["time"];
    let slope = (row[&error] - last[&error]) / step;
    rate + (slope - rate) * (1.0 - (-step / 0.03).exp())
}

/// A control, less a fifth of what its contact slides faster than it by, beyond `brake_above`.
fn braked(feature: &Value, wanted: f64, rate: f64) -> f64 {
    let Some(above) = feature["brake_above"].as_f64() else { return wanted };
    let faster = if -rate * wanted > 0.0 { (rate.abs() - wanted.abs()).max(0.0) } else { rate.abs() };
    wanted + 0.2 * (faster - above).max(0.0).copysign(rate)
}

/// Asserts that the twist of each tick is the sum of the columns times the controls and of the constants, and that a
/// control without integral and derivative is kp times its error, less what brakes it.
fn assert_is_the_law_of_a_run(graph: &str, sum: &str, for_s: &str) {
    let explained = explained(&[graph]);
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    let (mut compared, mut rates, rows) = (0, BTreeMap::new(), recorded(&[graph], for_s));
    // A tick in which the mode changes writes the twist of the one before.
    for [last, row] in rows.array_windows() {
        for name in row.keys().filter_map(|port| port.strip_prefix("pid.control.")) {
            let rate = rates.entry(name).or_insert(0.0);
            *rate = smooth_rate(*rate, name, last, row);
        }
        if last["mode"] != row["mode"] {
            continue;
        }
        let mode = &modes[row["mode"] as usize];
        let mut twist = [0.0; 6];
        for feature in mode["features"].as_array().unwrap() {
            let name = feature["name"].as_str().unwrap();
            let Some(control) = row.get(&format!("pid.control.{name}")) else { continue };
            let is_proportional = ["ki", "kd"].iter().all(|gain| feature[gain] == 0.0);
            if let Some(error) = row.get(&format!("error.error.{name}")).filter(|_| is_proportional) {
                let wanted = feature["kp"].as_f64().unwrap() * error;
                let by_hand = grown(feature, braked(feature, wanted, rates[name]), last, row);
                assert!((control - by_hand).abs() < 1e-9, "{graph}, {name}: {control} and {by_hand}");
            }
            let schedules = feature["schedules"].as_array().into_iter().flatten();
            let factor: f64 = schedules.map(|schedule| factor(schedule, row)).product();
            (0..6).for_each(|i| twist[i] += feature["column"][i].as_f64().unwrap() * control * factor);
        }
        for constant in mode["constants"].as_array().unwrap() {
            (0..6).for_each(|i| twist[i] += constant["twist"][i].as_f64().unwrap());
        }
        for (i, part) in ["vx", "vy", "vz", "wx", "wy", "wz"].into_iter().enumerate() {
            let Some(ran) = row.get(&format!("{sum}.twist.{part}")) else { continue };
            assert!((ran - twist[i]).abs() < 1e-9, "{graph}, {part}: {ran} and {}", twist[i]);
            compared += 1;
        }
    }
    assert!(compared > 1000, "{graph}: {compared} values");
}

#[test]
fn the_law_is_that_of_a_run() {
    for graph in ["graphs/hybrid.toml", "graphs/rolling.toml", "graphs/force.toml", "graphs/position.toml"] {
        assert_is_the_law_of_a_run(graph, "sum", "3s");
    }
}

#[test]
fn what_a_mode_sets_counts() {
    let explained = explained(&["graphs/hybrid.toml", "--set", "nodes.pid.gains.x.kp=3"]);
    let [approach, servo] = ["approach", "servo"].map(|name| {
        let modes = explained["motions"][0]["modes"].as_array().unwrap();
        modes.iter().find(|mode| mode["mode"] == name).unwrap().clone()
    });
    assert_eq!(approach["features"][0]["column"], serde_json::json!([0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    assert_eq!(approach["constants"][0]["twist"][2], 0.008);
    assert_eq!((&servo["features"][0]["kp"], servo["constants"].as_array().unwrap().len()), (&3.0.into(), 0));
    let pressure = servo["features"].as_array().unwrap().iter().find(|one| one["name"] == "pressure").unwrap();
    // A low-pass of 50 ms, and half of nine periods of 4 ms.
    let delay: f64 = pressure["filters"].as_array().unwrap().iter().map(|one| one["delay_s"].as_f64().unwrap()).sum();
    assert!((delay - 0.068).abs() < 1e-9, "{delay}");
    assert_eq!(servo["ends"][0][0], "on_lost");
}

#[test]
fn every_shipped_task_is_explained_for_a_person_and_for_a_page() {
    for graph in tactflow_tests::shipped_graphs() {
        let graph = graph.display().to_string();
        let shown = say(&["explain", &graph]);
        let moves = say(&["show", &graph]).out.contains("velocity = ");
        assert_eq!(shown.code, if moves { 0 } else { 2 }, "{graph}: {}", shown.err);
        assert_eq!(say(&["explain", &graph, "--format", "markdown"]).code, shown.code, "{graph}");
    }
    let page = say(&["explain", "graphs/hybrid.toml"]).out;
    for text in [
        "in the mode `servo`",
        "x                0  -3   0    0   0   0   0  3, 0, 0       50 ms (low_pass)",
        "`pid` lets the control of `x` grow by at most 0.25 m/s2",
        "`pid` brakes `y` where it moves faster than kp asks for, by more than 0.01 m/s.",
        "`pid` integrates errors of `pressure` up to 0.02 only",
        "At rest: wx, wy, wz.",
        "From a change of the contact to the command: 52 ms for `x`; 2 ms for `y`; 70 ms for `pressure`.",
        "Latency that the pad states: 4 ms for `x`, `y`, `pressure`. It counts where the bench has measured none.",
        "with the latency of the pad: as in the measured response for `x` over `ball`, `pressure` over `ball`.",
        "`move.contact` (`contact_limit`)",
        "force_n = 15.0",
    ] {
        assert!(page.contains(text), "{text}: {page}");
    }
}

#[test]
fn the_latency_is_that_of_the_samples_the_filters_and_the_contact() {
    let facts = "facts.arm.contacts=[{ object = \"pen\", latency_ms = 12.0, y = { vy = -1.0, latency_ms = 5.0 } }]";
    let slow = ["--set", "devices.bench.rate_hz=125", "--set", "devices.bench.latency_s=0.03"];
    let explained = explained(&[&["graphs/hybrid.toml", "--set", facts], &slow[..]].concat());
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    let of = |mode: &str| modes.iter().find(|one| one["mode"] == mode).unwrap()["latencies"].as_array().unwrap();
    assert!(of("approach").is_empty(), "nothing is controlled");
    // Half of a period of 8 ms, a low-pass of 50 ms for x and the pressure, and half of nine periods of its mean.
    for (found, (feature, to_command, to_image)) in
        of("servo").iter().zip([("x", 0.054, Some(0.012)), ("y", 0.004, Some(0.005)), ("pressure", 0.09, None)])
    {
        assert_eq!(found["feature"], feature);
        let near = |value: &Value, wanted: f64| (value.as_f64().unwrap() - wanted).abs() < 1e-9;
        assert!(near(&found["to_command_s"], to_command) && near(&found["of_pad_s"], 0.03), "{found}");
        // The contact does not say how the pressure answers.
        let image = &found["to_image"][0]["latency_s"];
        assert!(to_image.map_or(image.is_null(), |wanted| near(image, wanted)), "{found}");
    }
    assert_eq!(of("servo").len(), 3);
    let two_arms = say(&["explain", "graphs/carry.toml", "--set", "devices.cell.latency_s=0.02"]).out;
    assert!(two_arms.contains("Latency that the pad states: 20 ms"), "{two_arms}");
}

#[test]
fn a_warning_says_that_a_late_pad_takes_the_phase() {
    let bench =
        ["graphs/position.toml", "--bench", "graphs/benches/simulated.toml", "--set", "devices.bench.rate_hz=50"];
    let checked = |latency: &str| {
        let set = format!("devices.bench.latency_s={latency}");
        let args = ["--set", "nodes.pid.gains.y.kp=10.0", "--set", &set];
        say(&[&["check"], &bench[..], &args].concat()).err
    };
    let late = checked("0.08");
    assert!(late.contains("phase margin 38°; its pad is 80 ms late"), "{late}");
    // The recipe begins with 0.5 / T, and T is 240 ms and half of a period.
    let later = checked("0.24");
    assert!(later.contains("Begin with `kp = 2`, as in the recipe"), "{later}");
    assert_eq!(checked("0.0"), "");
}

#[test]
fn a_contact_that_cannot_be_read_is_marked_in_its_file() {
    let bad = "facts.arm.contacts=[{ object = \"pen\", pressure = { vz = 17.0, resonance_hz = -5.0 } }]";
    let said = say(&["explain", "graphs/force.toml", "--set", bad]);
    assert_eq!(said.code, 2, "{}", said.out);
    for text in ["warning[unusual-value]", "-5.0", "error: `contacts` in `[facts.arm]` of the bench: pen"] {
        assert!(said.err.contains(text), "{text}: {}", said.err);
    }
}

#[test]
fn one_port_is_explained_and_an_unknown_one_is_named() {
    let port = explained(&["graphs/hybrid.toml", "move.bumpless.twist"]);
    let limits = port["motions"][0]["limits"].as_array().unwrap().iter().map(|limit| limit["node"].as_str().unwrap());
    assert_eq!(limits.collect::<Vec<_>>(), ["damping", "move.bumpless"]);
    // Its loops are those of the command, over the contacts that the bench states.
    let all = explained(&["graphs/hybrid.toml"]);
    for twist in ["move.bumpless.twist", "projector.twist"] {
        let port = explained(&["graphs/hybrid.toml", twist]);
        let loops = |page: &Value| page["motions"][0]["modes"][1]["loops"].clone();
        assert_eq!(loops(&port), loops(&all), "{twist}");
        assert!(loops(&all)[0]["object"] == "ball", "{all}");
    }
    let other = say(&["explain", "graphs/hybrid.toml", "pid.control"]);
    assert_eq!(other.code, 2, "{}", other.out);
    assert!(other.err.contains("`pid.control` carries features: name a port that carries a twist"), "{}", other.err);
    let unknown = say(&["explain", "graphs/hybrid.toml", "move.bumples.twist"]);
    assert_eq!(unknown.code, 2);
    assert!(unknown.err.contains("no node writes `move.bumples.twist`"), "{}", unknown.err);
    // What the graph itself names: a command, and what a part exports.
    let loops = |page: &Value| page["motions"][0]["modes"][1]["loops"].clone();
    assert_eq!(loops(&explained(&["graphs/hybrid.toml", "arm.velocity"])), loops(&all));
    let exported = say(&["explain", "graphs/hybrid.toml", "move.velocity"]);
    assert!(exported.err.contains("did you mean `move.joints.velocity`?"), "{}", exported.err);
}

/// The loops of the mode `servo`, each with the object and the feature.
fn loops(args: &[&str]) -> Vec<Value> {
    let explained = explained(args);
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    modes.iter().find(|mode| mode["mode"] == "servo").unwrap()["loops"].as_array().unwrap().clone()
}

#[test]
fn margins_are_those_of_geometry_and_of_the_contacts_that_the_bench_states() {
    let alone = loops(&["graphs/hybrid.toml", "--set", "facts.arm.contacts=[]"]);
    let [x, _, pressure] = &alone[..] else { panic!("{alone:?}") };
    // An integrator with a gain of 3 1/s, and a low-pass of 50 ms: ω √(1 + (50 ms ω)²) = 3 1/s.
    let crossover = x["margins"]["crossover_hz"].as_f64().unwrap() * std::f64::consts::TAU;
    assert!((crossover * (0.05 * crossover).hypot(1.0) - 3.0).abs() < 1e-2, "{crossover}");
    assert!((x["margins"]["ramp_lag_s"].as_f64().unwrap() - 1.0 / 3.0).abs() < 1e-9);
    assert_eq!((&x["object"], &pressure["margins"]), (&Value::Null, &Value::Null));
    let ball = r#"{ object = "ball", pressure = { vz = 10.0, resonance_hz = 2.4, damping_ratio = 0.35 } }"#;
    let stiff = "pressure = { vz = 17.0, resonance_hz = 5.0, damping_ratio = 0.3 }";
    let contacts = format!("facts.arm.contacts=[{ball}, {{ object = \"pen\", latency_ms = 20.0, {stiff} }}]");
    let args = ["graphs/hybrid.toml", "--set", &contacts];
    let both = loops(&args);
    assert_eq!(both.len(), 6);
    let phase = |one: &Value| one["margins"]["phase_deg"].as_f64().unwrap();
    assert!(both.iter().all(|one| one["margins"]["is_stable"] == true && phase(one) > 20.0), "{both:?}");
    // The schedule divides the gain by the larger answer, and of x the latency costs margin: the crossover times 16 ms,
    // because over the ball that of the pad counts, which is 4 ms.
    assert!(phase(&both[2]) < phase(&both[5]));
    assert!((phase(&both[0]) - phase(&both[3]) - (crossover * 0.016).to_degrees()).abs() < 0.1);
    let page = say(&[&["explain"], &args[..]].concat()).out;
    assert!(page.contains("The worst loop is that of `pressure` over `"), "{page}");
}

#[test]
fn a_place_that_rolls_over_an_unknown_radius_is_computed_without_it_and_explain_says_so() {
    let page = |args: &[&str]| say(&[&["explain", "graphs/rolling.toml"], args].concat()).out;
    let left_out = ["`x` over `ball` also rolls with `wy`, and the bench", "`y` over `ball` also rolls with `wx`"];
    let unknown = page(&["--bench", "graphs/benches/ball.toml"]);
    assert!(left_out.iter().all(|text| unknown.contains(text)), "{unknown}");
    // What it says to write is what it then computes with.
    assert!(unknown.contains("`wy = -0.05`") && unknown.contains("`wx = 0.05`"), "{unknown}");
    let stated =
        "facts.arm.contacts=[{ object = \"ball\", x = { vx = -1.0, wy = -0.05 }, y = { vy = -1.0, wx = 0.05 } }]";
    for known in [page(&["--bench", "graphs/benches/ball.toml", "--set", stated]), page(&[])] {
        assert!(!known.contains("also rolls") && known.contains("crossover"), "{known}");
    }
}

#[test]
fn contacts_that_are_none_are_refused_with_an_example() {
    let wrong = say(&["explain", "graphs/hybrid.toml", "--set", "facts.arm.contacts=[{ pressure = { vz = 1.0 } }]"]);
    assert_eq!(wrong.code, 2);
    assert!(wrong.err.contains("missing field `object`") && wrong.err.contains("for example"), "{}", wrong.err);
}

#[test]
fn the_window_of_a_mean_has_as_many_samples_as_its_node_keeps() {
    // Those that are less than the window older than the newest one. The delay is half of the time between them.
    for (window_ms, samples) in [(16.0, 4.0), (17.0, 5.0), (20.0, 5.0), (3.0, 1.0)] {
        let window = format!("--set=nodes.mean.window_ms={window_ms:?}");
        let nodes = ["--set=nodes.mean.type=moving_average", "--set=nodes.mean.in.value=touch.pressure", &window];
        let explained =
            explained(&[&["graphs/edge.toml"], &nodes[..], &["--set=nodes.calm.in.value=mean.value"]].concat());
        let features = explained["motions"][0]["modes"][1]["features"].as_array().unwrap();
        let mut filters = features.iter().flat_map(|feature| feature["filters"].as_array().unwrap());
        let mean = filters.find(|filter| filter["node"] == "mean").unwrap();
        let expected = 0.5 * (samples - 1.0) * 0.004;
        assert!((mean["delay_s"].as_f64().unwrap() - expected).abs() < 1e-9, "{window_ms} ms: {mean}");
    }
}
