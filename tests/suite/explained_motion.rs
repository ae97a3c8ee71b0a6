//! `explain` against what a run measures: the lag behind a ramp, the bandwidth of a step, the gain at which a loop
//! oscillates, the stopping distance and the impact force of a touch.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, TAU};
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

/// The mode `servo`.
fn servo(task: &str, bench: &str) -> Value {
    let bench = format!("graphs/benches/{bench}.toml");
    let explained = explained(&[&format!("graphs/{task}.toml"), "--bench", &bench]);
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    modes.iter().find(|mode| mode["mode"] == "servo").unwrap().clone()
}

/// The loop of a feature in the mode `servo`.
fn loop_of(task: &str, bench: &str, feature: &str) -> Value {
    let mode = servo(task, bench);
    mode["loops"].as_array().unwrap().iter().find(|one| one["feature"] == feature).unwrap().clone()
}

/// A number of the loop of a feature in the mode `servo`.
fn of_loop(task: &str, bench: &str, feature: &str, key: &str) -> f64 {
    loop_of(task, bench, feature)["margins"][key].as_f64().unwrap()
}

#[test]
fn the_lag_behind_a_ramp_is_the_one_that_explain_prints() {
    // Along y the arm is soft, and the contact sticks to the foam and slips: the lag is then larger.
    for (task, bench) in [("hybrid", "ball"), ("hybrid", "pen"), ("position", "ball"), ("rolling", "moved_ball")] {
        let check = "[check.x]\nof = 'error.error.x'\nafter_s = 5.0\n";
        let ramp = "[[inject]]\nrole = 'pad'\nfault = 'moving'\nfrom_s = 3.0\nvelocity_m_per_s = [0.002, 0, 0]\n";
        let lag = measured(&scenario(task, bench, &format!("{check}{ramp}")), "x", "mean").abs() / 0.002;
        let explained = of_loop(task, bench, "x", "ramp_lag_s");
        // An integral takes the lag away in 5 s.
        let least = if task == "rolling" { 0.0 } else { 0.8 };
        assert!((least..1.2).contains(&(lag / explained)), "{task} on {bench}: {lag} s, explained {explained} s");
    }
}

#[test]
fn a_filter_does_not_change_the_lag_behind_an_edge_that_turns_and_an_integral_takes_it_away() {
    let turns = "devices.bench.objects.0.motion=[{ from_s = 4.0, to_s = 12.0, turn = -0.8, steady = true }]";
    for (ki, left) in [(0.0, 1.0), (4.0, 0.0)] {
        let gains =
            ["kp=4.0".to_owned(), format!("ki={ki:?}")].map(|gain| format!("nodes.pid.gains.orientation.{gain}"));
        let filter = "nodes.direction.window=40".to_owned();
        let sets: Vec<&str> = gains.iter().chain([&filter]).flat_map(|set| ["--set", set]).collect();
        let page = explained(&[&["graphs/edge.toml"], &sets[..]].concat());
        let modes = page["motions"][0]["modes"].as_array().unwrap();
        let loops = modes.iter().flat_map(|mode| mode["loops"].as_array().unwrap());
        let margins = loops.clone().find(|one| one["feature"] == "orientation").unwrap()["margins"].clone();
        let lag = margins["ramp_lag_s"].as_f64().unwrap();
        assert_eq!(margins["integral_s"].as_f64(), (ki > 0.0).then_some(1.0), "{margins}");
        let rows = recorded(&[&["graphs/edge.toml", "--set", turns], &sets[..]].concat(), "11.9s");
        // The edge turns by 0.1 rad/s.
        let errors = rows.iter().filter(|row| row["time"] > 9.0).map(|row| row["error.error.orientation"] / 0.1);
        let errors: Vec<f64> = errors.collect();
        let ran = errors.iter().sum::<f64>().abs() / errors.len() as f64;
        assert!((ran - left * lag).abs() < 0.2 * lag, "{ran} s, explained {lag} s, of which {left} is left");
    }
}

/// The error of the pressure in a run, from 10 s on, without its mean (rms).
pub(crate) fn swing(args: &[&str], [kp, ki]: [f64; 2]) -> f64 {
    let gains = [format!("kp={kp:?}"), format!("ki={ki:?}")].map(|gain| format!("nodes.pid.gains.pressure.{gain}"));
    let rows = recorded(&[args, &["--set", &gains[0], "--set", &gains[1]]].concat(), "16s");
    let late = rows.iter().filter(|row| row["time"] > 10.0);
    let errors: Vec<f64> = late.filter_map(|row| row.get("error.error.pressure").copied()).collect();
    let number = errors.len() as f64;
    let mean = errors.iter().sum::<f64>() / number;
    (errors.iter().map(|error| (error - mean).powi(2)).sum::<f64>() / number).sqrt()
}

#[test]
fn a_loop_oscillates_by_itself_from_its_gain_margin_on() {
    let alone = ["--set", "nodes.schedule.min=1.0", "--set", "nodes.schedule.max=1.0"];
    for (task, bench, set, gains) in [
        ("force", "pen", &alone[..], [0.6, 0.08]),
        ("force", "toy_box", &alone[..], [0.6, 0.08]),
        ("edge", "edge", &[][..], [0.4, 0.08]),
    ] {
        let (graph, bench) = (format!("graphs/{task}.toml"), format!("graphs/benches/{bench}.toml"));
        let args = [&[&*graph, "--bench", &*bench], set].concat();
        let page = explained(&args);
        let modes = page["motions"][0]["modes"].as_array().unwrap();
        let mut loops = modes.iter().flat_map(|mode| mode["loops"].as_array().unwrap());
        let pressure = loops.find(|one| one["feature"] == "pressure").unwrap();
        let margin = pressure["margins"]["gain_db"].as_f64().unwrap();
        let with = |db: f64| swing(&args, gains.map(|gain| gain * 10_f64.powf(db / 20.0)));
        let (still, below, beyond) = (with(0.0), with(margin - 2.5), with(margin + 2.5));
        assert!(
            below < 2.0 * still && beyond > 4.0 * still,
            "{task}, {bench}, {margin} dB: {still}, {below}, {beyond}"
        );
    }
}

/// Period of the rows [s].
const PERIOD: f64 = 0.004;
/// A step of the setpoint of a feature: from the first value to the second at 6 s, and back at 10 s.
struct Step {
    task: &'static str,
    bench: &'static str,
    feature: &'static str,
    setpoints: [f64; 2],
}

const fn step(task: &'static str, bench: &'static str, feature: &'static str, setpoints: [f64; 2]) -> Step {
    Step { task, bench, feature, setpoints }
}

/// Times of the steps [s].
const STEPS: [f64; 2] = [6.0, 10.0];
/// Rows that a step is given [1].
const ROWS: usize = (4.0 / PERIOD) as usize;

impl Step {
    /// The feature after the step, as a fraction of it: the mean of three seeds, and of the way there and back, because foam
    /// that is pressed answers otherwise than foam that comes back. It is the one before its filters, but for an orientation,
    /// which wraps.
    fn run(&self) -> Vec<f64> {
        let [before, after] = self.setpoints;
        let graphs = workspace().join("graphs").display().to_string();
        let shipped = fs::read_to_string(format!("{graphs}/{}.toml", self.task)).unwrap();
        let own = shipped.split("\n[live]").next().unwrap_or_default();
        let own = own
            .replace("file = \"", &format!("file = \"{graphs}/"))
            .replace("bench = \"", &format!("bench = \"{graphs}/"))
            .replace("{ from = \"pad.pressure\" }", "0.1");
        let (_folder, path) = in_new_folder("task.toml");
        let live = format!("error.setpoint.{} = {{ min = -2.0, max = 2.0, rate = 1e4 }}", self.feature);
        fs::write(&path, format!("{own}\n[live]\n{live}\n")).unwrap();
        let bench = format!("{graphs}/benches/{}.toml", self.bench);
        let change = |at: f64, to: f64| format!("{at}s:error.setpoint.{}={to:?}", self.feature);
        let [there, back] = [change(STEPS[0], after), change(STEPS[1], before)];
        let measured = self.measured();
        let mut mean = vec![0.0; ROWS];
        for seed in 1..=3 {
            let seed = format!("devices.bench.seed={seed}");
            let sets = ["devices.bench.for_s=20.0", "devices.bench.objects.0.motion=[]", &seed];
            let sets = sets.iter().flat_map(|set| ["--set", set]);
            let args = [&*path, "--bench", &bench, "--change", &there, "--change", &back];
            let rows = recorded(&args.into_iter().chain(sets).collect::<Vec<_>>(), "14.1s");
            let error = format!("error.error.{}", self.feature);
            let setpoint =
                |time: f64| if (STEPS[0]..STEPS[1]).contains(&(time + PERIOD / 2.0)) { after } else { before };
            let by_error =
                |row: &BTreeMap<String, f64>| setpoint(row["time"]) - row.get(&error).copied().unwrap_or(0.0);
            let feature = |row: &BTreeMap<String, f64>| match self.feature {
                "orientation" => by_error(row),
                _ => row.get(&measured).copied().unwrap_or(before),
            };
            let run: Vec<f64> = rows.iter().map(feature).collect();
            for (at, [from, to]) in STEPS.into_iter().zip([[before, after], [after, before]]) {
                let (at, second) = ((at / PERIOD) as usize, (1.0 / PERIOD) as usize);
                let rest = run[at - second..at].iter().sum::<f64>() / second as f64;
                let step = run[at..at + ROWS].iter().map(|value| (value - rest) / (to - from));
                mean.iter_mut().zip(step).for_each(|(sum, value)| *sum += value / 6.0);
            }
        }
        mean
    }

    fn explained(&self, key: &str) -> f64 {
        of_loop(self.task, self.bench, self.feature, key)
    }

    /// The port of the feature before its filters.
    fn measured(&self) -> String {
        let mode = servo(self.task, self.bench);
        let features = mode["features"].as_array().unwrap_or_else(|| panic!("{mode}"));
        let own = features.iter().find(|feature| feature["name"] == self.feature).unwrap();
        own["measured"].as_str().unwrap().to_owned()
    }
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
    for one in [
        step("force", "ball", "pressure", [0.10, 0.12]),
        step("force", "pen", "pressure", [0.10, 0.115]),
        step("force", "toy_box", "pressure", [0.10, 0.11]),
        step("edge", "edge", "pressure", [0.10, 0.12]),
        step("edge", "edge", "orientation", [FRAC_PI_2, FRAC_PI_2 + 0.04]),
    ] {
        let (ran, explained) = (bandwidth(&one.run()), one.explained("bandwidth_hz"));
        let Step { task, bench, feature, .. } = one;
        assert!((explained / ran - 1.0).abs() < 0.2, "{task}, {bench}, {feature}: {ran} Hz, explained {explained} Hz");
    }
}

#[test]
fn the_force_that_friction_spares_follows_a_little_less_than_printed() {
    let one = step("hold_without_slip", "dragged_box", "spare", [0.0, 0.3]);
    let ratio = bandwidth(&one.run()) / one.explained("bandwidth_hz");
    assert!((0.7..1.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_bandwidth_of_a_flat_response_lies_in_its_range() {
    // The arm resonates, and soft foam creeps: the response stays near 71 % for more than an octave. The play of x is
    // 1.5 mm, and takes much of a step of 4 mm.
    for one in [
        step("hybrid", "ball", "x", [0.0, 0.008]),
        step("hybrid", "pen", "x", [0.0, 0.008]),
        step("rolling", "moved_ball", "pressure", [0.10, 0.115]),
        step("rolling", "moved_ball", "pressure", [0.10, 0.12]),
    ] {
        let ran = bandwidth(&one.run());
        let explained = loop_of(one.task, one.bench, one.feature);
        let [low, high] = [0, 1].map(|i| explained["margins"]["bandwidth_range_hz"][i].as_f64().unwrap());
        let is_inside = 0.8 * low < ran && ran < 1.2 * high;
        assert!(
            is_inside && high < 5.0 * low,
            "{}, {}: {ran} Hz, explained {low} to {high} Hz",
            one.bench,
            one.feature
        );
    }
}

#[test]
fn the_estimate_of_a_run_is_near_what_the_bench_states() {
    // A soft ball touches more tactels the further it is pressed, so its last bit of a press answers less than the whole.
    for (bench, off) in [("ball", 0.2..0.45), ("pen", -0.1..0.1), ("toy_box", -0.1..0.1)] {
        let file = format!("graphs/benches/{bench}.toml");
        let stated: toml::Table = toml::from_str(&fs::read_to_string(workspace().join(&file)).unwrap()).unwrap();
        let stated = stated["facts"]["arm"]["contacts"][0]["pressure"]["vz"].as_float().unwrap();
        let rows = recorded(&["graphs/force.toml", "--bench", &file], "6s");
        let estimate = 10.0 * rows[rows.len() - 1]["answer.stiffness.ratio"];
        assert!(
            off.contains(&(estimate / stated - 1.0)),
            "{bench}: {estimate}, stated {stated} N per tactel and metre"
        );
    }
}

/// The way of the sensor between both crossings of the middle of a place that a slow sine moves to and fro, without its
/// controller [m].
fn hysteresis(task: &str, bench: &str, place: &str, amplitude: f64, more: &[&str]) -> f64 {
    let [graph, bench] = [format!("graphs/{task}.toml"), format!("graphs/benches/{bench}.toml")];
    let speed = 0.1 * TAU * amplitude;
    let signal = format!(
        "nodes.slow={{ type = 'signal_generator', in.gate = 'modes.servo', form = 'sine', unit = 'm/s', amplitude = \
         {speed:?}, frequency = 0.1 }}"
    );
    let twist = format!("nodes.sway={{ type = 'compose_twist', in.v{place} = 'slow.value' }}");
    let alone = format!("nodes.jacobian.columns.{place}=[0, 0, 0, 0, 0, 0]");
    let sets = [&*signal, &*twist, "nodes.sum.in.sway='sway.twist'", &*alone, "devices.bench.for_s=40.0"];
    let sets = sets.iter().chain(more).flat_map(|set| ["--set", set]);
    let rows = recorded(&[&*graph, "--bench", &*bench].into_iter().chain(sets).collect::<Vec<_>>(), "32s");
    let mut way = 0.0;
    let moved = rows.iter().filter_map(|row| {
        let velocity = row.get(&format!("sum.twist.v{place}")).copied().unwrap_or(0.0);
        way += velocity * PERIOD;
        Some((row["time"], velocity, way, *row.get(&format!("error.error.{place}"))?))
    });
    let moved: Vec<_> = moved.filter(|(time, ..)| *time > 11.0).collect();
    let (least, most) = moved.iter().fold((f64::MAX, f64::MIN), |(a, b), (.., x)| (a.min(*x), b.max(*x)));
    let middle = 0.5 * (least + most);
    let crossings = moved.windows(2).filter(|pair| (pair[0].3 < middle) != (pair[1].3 < middle));
    let (there, back): (Vec<_>, Vec<_>) = crossings.map(|pair| pair[1]).partition(|(_, velocity, ..)| *velocity > 0.0);
    let mean = |rows: &[(f64, f64, f64, f64)]| rows.iter().map(|row| row.2).sum::<f64>() / rows.len() as f64;
    (mean(&there) - mean(&back)).abs()
}

#[test]
fn the_play_of_a_contact_is_the_width_of_its_hysteresis() {
    let rests = ["nodes.guide.twist=[0, 0, 0, 0, 0, 0]"];
    for (task, bench, place, amplitude, more) in [
        ("hybrid", "ball", "x", 0.005, &[][..]),
        ("hybrid", "ball", "y", 0.010, &[]),
        ("hybrid", "pen", "y", 0.012, &[]),
        ("cable", "cable", "x", 0.005, &rests),
    ] {
        let ran = hysteresis(task, bench, place, amplitude, more);
        let explained = loop_of(task, bench, place);
        let [play, step, late] = ["play", "step", "late_s"].map(|key| explained["play"][key].as_f64().unwrap());
        assert!((play / ran - 1.0).abs() < 0.2, "{task}, {bench}, {place}: {ran} m, explained {play} m");
        // Along y a step of 5 mm is smaller than the play. Of the pen, geometry alone says the bandwidth.
        let file = format!("graphs/benches/{bench}.toml");
        let text = say(&["explain", &format!("graphs/{task}.toml"), "--bench", &file]).out;
        let mut rows = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>());
        let is_bound = rows.any(|row| row.contains(&place) && row.contains(&"up") && row.contains(&"Hz"));
        assert_eq!(is_bound, place == "y" && bench == "ball", "{text}");
        assert!((late - play * explained["margins"]["ramp_lag_s"].as_f64().unwrap() / step).abs() < 1e-12);
    }
}

#[test]
fn a_step_that_is_smaller_than_the_play_is_answered_later_and_by_less_than_the_bandwidth() {
    let steps = [0.002, 0.005, 0.008].map(|size| step("hybrid", "ball", "y", [0.0, size]).run());
    let [small, usual, large] = [0, 1, 2].map(|i| bandwidth(&steps[i]));
    // The ramp lag is the time constant without friction, and a contact that rests anywhere in its play begins later.
    let lag = of_loop("hybrid", "ball", "y", "ramp_lag_s");
    let late = loop_of("hybrid", "ball", "y")["play"]["late_s"].as_f64().unwrap();
    let half = steps[1].iter().position(|y| *y > 0.5).unwrap() as f64 * PERIOD;
    assert!((lag * 2.0_f64.ln()..lag * 2.0_f64.ln() + late).contains(&half), "{half} s, {lag} s, {late} s");
    let explained = of_loop("hybrid", "ball", "y", "bandwidth_hz");
    assert!(small < 0.4 * explained && usual < explained, "{small}, {usual}, explained {explained} Hz");
    assert!((large / explained - 1.0).abs() < 0.2, "{large}, explained {explained} Hz");
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
fn the_impact_bounds_the_force_of_a_touch_in_a_run() {
    let fast = "modes.approach.set.reach.twist=[0, 0, 0.015, 0, 0, 0]";
    let args = ["graphs/hybrid.toml", "--bench", "graphs/benches/pen.toml", "--set", fast];
    let reach = approach(&args, "approach", "reach");
    let distance = reach["stopping_distance_m"].as_f64().unwrap();
    // Two periods of 4 ms, 109 degrees of the pressure at 8.06 Hz, which are 37.6 ms, 2 m/s², and the resonance of x.
    let braking = 0.015 * 0.0456 + 0.015 * 0.015 / 4.0;
    assert!((distance - braking - 0.015 / (TAU * 2.37)).abs() < 1e-12, "{distance}");
    let impact = reach["impacts"][0]["force_n"].as_f64().unwrap();
    assert!((impact - 0.015 * 10_000.0 / (TAU * 7.46)).abs() < 1e-9, "{impact}");
    let search = approach(&args, "servo", "move.lost");
    assert_eq!(search["speed_m_per_s"], 0.005);
    // A motion away from the object, or along it, has no impact.
    let away = approach(&["graphs/square.toml", args[1], args[2]], "retreat", "reach");
    let along = approach(&["graphs/cable.toml", args[1], args[2]], "servo", "guide");
    assert_eq!((&away["impacts"], &along["impacts"]), (&serde_json::json!([]), &serde_json::json!([])));
    // Without a command back, the first 100 ms of a touch press with the moving mass.
    let rows = recorded(&args, "1s");
    let force = |row: &BTreeMap<String, f64>| row.get("truth.force").copied().unwrap_or(0.0);
    let touch = rows.iter().position(|row| force(row) > 0.02).unwrap();
    let most = rows[touch..touch + 25].iter().map(force).fold(0.0, f64::max);
    assert!(most > impact / 5.0 && most < impact, "{most} N, explained {impact} N");
}

#[test]
fn the_stopping_distance_bounds_that_of_an_arm_that_swings_in_the_air() {
    let away = "devices.bench.objects.0.at=[0.0, 0.0, 0.15]";
    for (bench, swings) in [("ball", true), ("pen", true), ("edge", false)] {
        let bench = format!("graphs/benches/{bench}.toml");
        let args = ["graphs/hybrid.toml", "--bench", &bench, "--set", away];
        let reach = approach(&args, "approach", "reach");
        let distance = reach["stopping_distance_m"].as_f64().unwrap();
        let stops = [0.6, 1.5, 2.0].map(|time: f64| {
            let send = [format!("{time}s:stop"), format!("{}s:resume", time + 0.8)];
            let send = ["--send", &send[0], "--send", &send[1]];
            let rows = recorded(&[&args[..], &send].concat(), &format!("{}s", time + 0.8));
            let place = |row: &BTreeMap<String, f64>| ["x", "y", "z"].map(|axis| row[&format!("{POSE}.{axis}")]);
            let from = rows.iter().position(|row| row["time"] > time).unwrap();
            let start = place(&rows[from]);
            let way = |row| (0..3).map(|i| (place(row)[i] - start[i]).powi(2)).sum::<f64>().sqrt();
            rows[from..].iter().map(way).fold(0.0, f64::max)
        });
        let longest = stops.into_iter().fold(0.0, f64::max);
        assert_eq!(reach["swing"].is_object(), swings, "{bench}: {reach}");
        // Without the swing, the distance is too small.
        assert_eq!(longest < distance, swings, "{bench}: {stops:?} m, explained {distance} m");
    }
}

/// The measured pose of the sensor.
const POSE: &str = "move.state.sensor_pose";
