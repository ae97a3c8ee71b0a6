//! `tune`: what it measures, what it proposes, and what it writes.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::cli::in_new_folder;
use crate::control_law::explained;
use crate::lockstep::Peer;
use crate::tool::{peer, say};

/// The text of a shipped file, with the files that it names at their own places.
pub(crate) fn shipped(file: &str) -> String {
    let graphs = tactflow_tests::workspace().join("graphs");
    let text = fs::read_to_string(graphs.join(file)).unwrap();
    let text = text.replace("\"../", &format!("\"{}/", graphs.display()));
    ["parts/", "benches/"]
        .iter()
        .fold(text, |text, folder| text.replace(&format!("\"{folder}"), &format!("\"{}/{folder}", graphs.display())))
}

/// Writes a copy of `force` into a folder, with another text in its part `answer.toml`. Returns its path.
pub(crate) fn force_with(folder: &Path, old: &str, new: &str) -> String {
    let [answer, force] = ["parts/answer.toml", "force.toml"].map(shipped);
    assert!(answer.contains(old), "{old}");
    let part = folder.join("answer.toml");
    fs::write(&part, answer.replace(old, new)).unwrap();
    let used = tactflow_tests::workspace().join("graphs/parts/answer.toml");
    let path = folder.join("force.toml");
    fs::write(&path, force.replace(used.to_str().unwrap(), part.to_str().unwrap())).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_slow_edge_gets_the_gain_that_was_found_by_hand_and_the_files_keep_their_comments() {
    let (_folder, path) = in_new_folder("edge.toml");
    fs::write(&path, shipped("edge.toml")).unwrap();
    let bench = Path::new(&path).with_file_name("edge_bench.toml").display().to_string();
    fs::write(&bench, shipped("benches/edge.toml")).unwrap();
    let from = ["--set", "nodes.pid.gains.orientation.kp=1.0", "--set", "nodes.pid.gains.orientation.ki=0.0"];
    let args = ["tune", &path, "--bench", &bench, "--feature", "orientation", "--save"];
    let said = say(&[&args[..], &from].concat());
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    // The gain that was found by hand on another simulator, with another arm and another foam.
    let graph: toml::Table = toml::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let kp = graph["nodes"]["pid"]["gains"]["orientation"]["kp"].as_float().unwrap();
    assert!((kp / 8.0 - 1.0).abs() < 0.2, "{kp}");
    let comments = |text: &str| text.matches('#').count();
    for (file, old) in [(&path, shipped("edge.toml")), (&bench, shipped("benches/edge.toml"))] {
        assert_eq!(comments(&fs::read_to_string(file).unwrap()), comments(&old), "{file}");
    }
    let page = say(&["explain", &path, "--bench", &bench, "--format", "json"]);
    let explained: Value = serde_json::from_str(&page.out).unwrap();
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    let loops = modes.iter().flat_map(|mode| mode["loops"].as_array().unwrap());
    let of_edge: Vec<&Value> = loops.filter(|one| one["feature"] == "orientation").collect();
    assert!(of_edge.iter().all(|one| one["object"] == "edge"), "{of_edge:?}");
    let margins = &of_edge.first().unwrap()["margins"];
    assert!(margins["gain_db"].as_f64().unwrap() > 6.0, "{margins}");
}

#[test]
fn a_loop_is_measured_with_several_settings_and_the_worst_of_them_decides() {
    let (_folder, path) = in_new_folder("force.toml");
    fs::write(&path, shipped("force.toml")).unwrap();
    let bench = Path::new(&path).with_file_name("pen.toml").display().to_string();
    fs::write(&bench, shipped("benches/pen.toml")).unwrap();
    let softer = "devices.bench.stiffness=100.0";
    let said = say(&["tune", &path, "--bench", &bench, "--also", softer, "--save", "--format", "json"]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let found: Value = serde_json::from_str(&said.out).unwrap_or_else(|why| panic!("{why}: {}", said.out));
    assert!(said.err.contains("wrote "), "{}", said.err);
    let contacts = found["contacts"].as_array().unwrap();
    let objects: Vec<&str> = contacts.iter().map(|contact| contact["object"].as_str().unwrap()).collect();
    assert_eq!(objects, ["pen".to_owned(), format!("pen with {softer}")]);
    let [arm, soft] = [0, 1].map(|i| contacts[i]["pressure"]["vz"].as_f64().unwrap());
    assert!(soft < 0.8 * arm, "an arm of half the stiffness yields: {arm}, {soft}");
    let margins = found["features"][0]["margins"].as_array().unwrap();
    let worst = margins.iter().map(|margins| margins["peak_sensitivity"].as_f64().unwrap()).fold(0.0, f64::max);
    assert!(margins.len() == 2 && (1.2..=1.7).contains(&worst), "{margins:?}");
    let saved: toml::Table = toml::from_str(&fs::read_to_string(&bench).unwrap()).unwrap();
    let saved = saved["facts"]["arm"]["contacts"].as_array().unwrap();
    assert_eq!(saved.len(), 2, "each setting has its contact");
    let stated: toml::Table = toml::from_str(&shipped("benches/pen.toml")).unwrap();
    let stated = stated["facts"]["arm"]["contacts"][0].as_table().unwrap();
    let kept = stated.iter().filter(|(key, _)| *key != "pressure");
    assert!(kept.into_iter().all(|(key, value)| saved[0].get(key) == Some(value)), "{saved:?}");
    // The task has the new gains, and the shipped bench states the contact of another measurement.
    let explained = explained(&[&path, "--bench", "graphs/benches/pen.toml"]);
    let modes = explained["motions"][0]["modes"].as_array().unwrap();
    let servo = modes.iter().find(|mode| mode["mode"] == "servo").unwrap();
    let far =
        |key: &str| (servo["loops"][0]["margins"][key].as_f64().unwrap() - margins[0][key].as_f64().unwrap()).abs();
    assert!(far("phase_deg") < 6.0 && far("gain_db") < 1.5, "{servo}: {margins:?}");
}

#[test]
#[ignore = "it takes more than a minute: `.ci/edge` runs it"]
fn gains_far_too_low_and_too_high_end_at_the_same_ones() {
    // The arm is half as stiff, and the image comes 12 ms later.
    let bench = ["--bench", "graphs/benches/toy_box.toml"];
    let plant = ["devices.bench.stiffness=100.0", "devices.bench.latency_s=0.016"];
    // The grid search knows no schedule.
    let fixed = ["nodes.schedule.min=1.0", "nodes.schedule.max=1.0"];
    let plant: Vec<&str> = plant.into_iter().chain(fixed).flat_map(|set| ["--set", set]).collect();
    let found = [0.25, 1.5].map(|factor| {
        let gains = [("kp", GRID_BEST * factor), ("ki", GRID_BEST * factor / 5.0)];
        let gains = gains.map(|(key, gain)| format!("nodes.pid.gains.pressure.{key}={gain:?}"));
        let args = ["tune", "graphs/force.toml", "--set", &gains[0], "--set", &gains[1], "--format", "json"];
        let said = say(&[&args[..], &bench, &plant].concat());
        assert_eq!(said.code, 0, "{}{}", said.out, said.err);
        let tuned: Value = serde_json::from_str(&said.out).unwrap();
        tuned["features"][0]["new"][0].as_f64().unwrap()
    });
    assert!(found.iter().all(|kp| (kp / GRID_BEST - 1.0).abs() < 0.2), "{found:?}, by a grid search {GRID_BEST}");
}

/// The largest gain that keeps a peak of 1.7, 9 dB and 50 deg over the box, by a grid search over the response that a
/// program of its own has measured, with sines of up to 4.8 mm.
const GRID_BEST: f64 = 1.7;

#[test]
fn a_picture_that_cannot_be_written_is_found_before_the_robot_moves() {
    let (_folder, page) = in_new_folder("page.html");
    fs::write(&page, "<html><svg></svg></html>").unwrap();
    for path in [page.as_str(), "/nowhere/bode.svg"] {
        let said = say(&["tune", "graphs/edge.toml", "--feature", "orientation", "--svg", path]);
        assert_eq!(said.code, 2, "{}{}", said.out, said.err);
        assert!(said.err.contains(path) && !said.err.contains("test signal"), "{}", said.err);
    }
}

#[test]
fn gains_beyond_their_live_range_are_tried_and_saved_with_a_wider_range() {
    let (_folder, path) = in_new_folder("hybrid.toml");
    let text = shipped("hybrid.toml").replace("gains.x = { kp = 3.0", "gains.x = { kp = 0.7");
    let narrow = "\npid.gains.x.kp = { min = 0.5, max = 0.8, rate = 2.0 } # narrow\n";
    fs::write(&path, text.replace("\n[live]", "\n[live]\n#") + narrow).unwrap();
    let bench = Path::new(&path).with_file_name("ball.toml").display().to_string();
    fs::write(&bench, shipped("benches/ball.toml")).unwrap();
    let said = say(&["tune", &path, "--bench", &bench, "--feature", "x", "--save"]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let saved = fs::read_to_string(&path).unwrap();
    let graph: toml::Table = toml::from_str(&saved).unwrap();
    let kp = graph["nodes"]["pid"]["gains"]["x"]["kp"].as_float().unwrap();
    assert!(kp > 2.0, "{kp}");
    assert_eq!(graph["live"]["pid"]["gains"]["x"]["kp"]["max"].as_float(), Some(kp));
    assert!(saved.contains("# narrow"), "{saved}");
    assert_eq!(say(&["check", &path, "--bench", &bench]).code, 0);
}

#[test]
fn a_live_bound_of_a_feature_stays_as_it_is() {
    let limit = "live.pid.gains.orientation.limit={ min = 0.2, max = 0.7, rate = 0.5 }";
    let said = say(&["tune", "graphs/edge.toml", "--feature", "orientation", "--set", limit]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
}

#[test]
fn what_cannot_be_tuned_says_why() {
    for (args, why) in [
        (
            &["graphs/hybrid.toml", "--mode", "servos"][..],
            "the graph has no mode `servos`; its modes are `approach`, `servo`",
        ),
        (
            &["graphs/hybrid.toml", "--feature", "z"],
            "the mode `servo` does not control `z`; it controls `x`, `y`, `pressure`",
        ),
        (
            &["graphs/hand.toml"],
            "tactflow tune graphs/force.toml --bench graphs/benches/hand.toml --set bind.arm=palm --set bind.pad=palm",
        ),
        (&["graphs/finger_press.toml"], "`iscan` plays a recording, which does not answer the motion"),
        (&["tests/errors/wrong_columns.toml"], "a graph without modes has no mode to tune"),
        (&["graphs/hybrid.toml", "--feature", "x", "--set", "nodes.pid.gains.x.kp=-3"], "of `x` is negative: make it"),
        (&["graphs/carry.toml", "--arm", "arm"], "no role `arm` is an arm; the arms are `left_arm`, `right_arm`"),
        (&["graphs/force.toml", "--peak", "0.9"], "it must be more than 1, as 1.7 is"),
        (&["graphs/force.toml", "--gain-margin", "nan"], "it must be 0 or more"),
        (
            &["graphs/force.toml", "--set", "facts.arm.contacts=[{ object = \"cup\" }, { object = \"jar\" }]"],
            "states contacts with `cup`, `jar`: measure it as the bench of the graph, and name the object",
        ),
        // A mount between the sum and the limits.
        (
            &[
                "graphs/edge.toml",
                "--set",
                "nodes.mount.type=static_pose",
                "--set",
                "nodes.mount.rpy=[0, 0, 3.14159265]",
                "--set",
                "nodes.turned.type=adjoint",
                "--set",
                "nodes.turned.in.pose=mount.pose",
                "--set",
                "nodes.turned.in.twist=sum.twist",
                "--set",
                "parts.move.in.twist=turned.twist",
            ],
            "wire `turned_sum.twist` to what reads `turned.twist`:\n\n[nodes.turned_sum]\ntype = \"twist_adder\"\n\
             in.mount = \"turned.twist\"",
        ),
    ] {
        let said = say(&[&["tune"], args].concat());
        assert_eq!(said.code, 2, "{}", said.err);
        assert!(said.err.contains(why), "{args:?}: {}", said.err);
    }
}

#[test]
fn a_mount_before_the_sum_changes_nothing_that_is_measured() {
    // Half a turn about x, and columns that are turned with it.
    let mount = [
        "nodes.mount.type=static_pose",
        "nodes.mount.rpy=[3.14159265358979, 0, 0]",
        "nodes.turned.type=adjoint",
        "nodes.turned.in.pose=mount.pose",
        "nodes.turned.in.twist=projector.twist",
        "nodes.sum.in.touch=turned.twist",
        "nodes.jacobian.columns.pressure=[0, 0, -1, 0, 0, 0]",
        "nodes.jacobian.columns.orientation=[0, 0, 0, 0, 0, 1]",
    ];
    let mount: Vec<&str> = mount.into_iter().flat_map(|set| ["--set", set]).collect();
    let plain = ["tune", "graphs/edge.toml", "--feature", "orientation"];
    let [without, with] = [&[][..], &mount].map(|mount| say(&[&plain[..], mount].concat()));
    assert_eq!((without.code, with.code), (0, 0), "{}{}", without.err, with.err);
    assert!(without.out.contains("gain margin"), "{}", without.out);
    assert_eq!(without.out, with.out);
}

#[test]
fn gains_that_follow_the_measured_travel_are_named_and_not_tuned() {
    // Without the commanded travel, the factor says nothing of the loop.
    let folder = tempfile::tempdir().unwrap();
    let equilibrium = "in.equilibrium = \"inputs.equilibrium\"\nin.deflection";
    let wires = format!("in.jacobian = \"inputs.jacobian\"\n{equilibrium} = \"spring.deflection\"\nnominal");
    let path = force_with(folder.path(), &wires, "nominal");
    assert_eq!(say(&["check", &path]).code, 0);
    let page = say(&["explain", &path]).out;
    assert!(page.contains("`schedule` multiplies the gains of `pressure` from 0.1 to 2, by what this"), "{page}");
    assert!(!page.contains("phase margin"), "{page}");
    let said = say(&["tune", &path]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("`schedule` multiplies the gains of `pressure` by what is not known"), "{}", said.err);
    // One of both wires is a mistake in the place of the node.
    let said = say(&["check", &force_with(folder.path(), equilibrium, "in.deflection")]);
    assert!(said.code == 2 && said.err.contains("needs `equilibrium` beside `jacobian`"), "{}", said.err);
}

#[test]
fn a_contact_that_stiffens_counts_with_the_largest_motion() {
    let gains = ["nodes.pid.gains.pressure.kp=0.1", "nodes.pid.gains.pressure.ki=0.02"];
    let sets = gains.into_iter().chain(["devices.bench.stiffness=500.0"]).flat_map(|set| ["--set", set]);
    let said = say(&["tune", "graphs/force.toml"].into_iter().chain(sets).collect::<Vec<_>>());
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    assert!(said.out.contains("Over `ball`, the largest motion has an answer that is "), "{}", said.out);
}

#[test]
fn a_test_signal_does_not_come_near_the_limit_of_the_force() {
    // The box is held with 6.8 N, and this arm presses with 1 N more for each millimetre.
    let limits = ["limits.force_n=11.0", "devices.bench.stiffness=800.0"].into_iter().flat_map(|set| ["--set", set]);
    let box_of_toys = ["tune", "graphs/force.toml", "--bench", "graphs/benches/toy_box.toml"];
    let said = say(&box_of_toys.into_iter().chain(limits).collect::<Vec<_>>());
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let signals = said.err.lines().filter_map(|line| line.split("a test signal of ").nth(1)?.strip_suffix(" m"));
    let signals: Vec<f64> = signals.map(|amplitude| amplitude.parse().unwrap()).collect();
    assert!(signals.len() > 1 && signals.iter().all(|amplitude| (0.0003..0.001).contains(amplitude)), "{signals:?}");
}

#[test]
fn a_loop_that_loses_its_contact_is_measured_again_with_smaller_gains() {
    let swings = "devices.bench.damping_ratio=0.085";
    let said = say(&["tune", "graphs/position.toml", "--feature", "x", "--format", "json", "--set", swings]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    assert!(said.err.contains("`x`: again, with an eighth of its gains"), "{}", said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let kp = tuned["features"][0]["new"][0].as_f64().unwrap();
    // Of gains from a fourth of those of the task.
    assert!((1.3..=2.0).contains(&kp), "{kp}");
}

#[test]
fn gains_near_instability_do_not_run_again_beside_the_new_ones() {
    let near = ["nodes.pid.gains.orientation.kp=19.0", "nodes.pid.gains.orientation.ki=19.0"];
    let sets = near.into_iter().flat_map(|set| ["--set", set]);
    let args: Vec<&str> = ["tune", "graphs/edge.toml", "--feature", "orientation"].into_iter().chain(sets).collect();
    let said = say(&args);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let line =
        "Over `edge`, the old gains are not tried again: those of `orientation` (kp = 19) have a gain margin of ";
    assert!(said.out.contains(line), "{}", said.out);
    let compared = said.out.lines().find(|line| line.contains("the error of `orientation` is")).unwrap();
    assert!(compared.contains("with the new ones") && !compared.contains("old gains"), "{compared}");
}

#[test]
fn a_task_that_does_not_reach_the_mode_is_run_once_and_says_why() {
    let said = say(&["tune", "graphs/force.toml", "--set", "devices.bench.objects=[]"]);
    assert_eq!(said.code, 1, "{}{}", said.out, said.err);
    assert_eq!(said.err.matches("a test signal of").count(), 1, "{}", said.err);
    for text in ["the task does not reach the mode `servo`: ", "the sensor has moved 60 mm", "`tactflow run` shows"] {
        assert!(said.out.contains(text), "{}", said.out);
    }
}

#[test]
fn a_limit_that_acts_while_a_response_is_measured_is_named() {
    let slow = ["tune", "graphs/edge.toml", "--feature", "orientation", "--set", "limits.angular_rad_per_s2=0.3"];
    let said = say(&slow);
    assert!(said.out.contains("Over `edge`, `move.bumpless.bumpless` reduced the motion in "), "{}", said.out);
    assert!(!say(&slow[..4]).out.contains("reduced the motion"));
}

#[test]
fn a_limit_that_hides_what_gains_can_do_is_named_beside_the_steps() {
    let low = ["limits.peak_n=0.15", "limits.force_n=1.5"].into_iter().flat_map(|set| ["--set", set]);
    let task = ["tune", "graphs/hybrid.toml", "--feature", "pressure"];
    let said = say(&task.into_iter().chain(low).collect::<Vec<_>>());
    assert_eq!(said.code, 1, "{}{}", said.out, said.err);
    for text in ["`move.contact.force` reduced the motion in ", "raise it, or lower the setpoint"] {
        assert!(said.out.contains(text), "{}", said.out);
    }
}

/// Tunes `y` of `position`, which sticks on the ball, from a gain. Returns the gain that is proposed.
fn tuned_by_steps(from: f64) -> f64 {
    let set = format!("nodes.pid.gains.y.kp={from}");
    let said = say(&["tune", "graphs/position.toml", "--feature", "y", "--format", "json", "--set", &set]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let feature = &tuned["features"][0];
    assert!(
        feature["answers"][0]["refused"].is_string() && feature["margins"] == serde_json::json!([null]),
        "{feature}"
    );
    // A sine of 0.1 Hz and 9 mm without the controller has a hysteresis of 6.3 mm, by a program of its own.
    let play = feature["answers"][0]["play"].as_f64().unwrap();
    assert!((play / 0.0063 - 1.0).abs() < 0.2, "{play} m");
    let climbed = feature["climbed"].as_array().unwrap();
    let failed: Vec<&Value> = climbed.iter().filter(|rung| rung["failure"].is_string()).collect();
    assert!(failed.len() <= 1, "no larger gain is tried after one that fails: {climbed:?}");
    feature["new"][0].as_f64().unwrap()
}

/// The gain with the smallest mean error over steps of 5 mm up and down, by a program of its own: a grid of seven gains
/// with three seeds each, and the errors of the recordings.
const STEPS_BEST: f64 = 3.75;

#[test]
fn a_place_that_sticks_gets_the_gain_of_a_grid_search() {
    let kp = tuned_by_steps(1.5 * STEPS_BEST);
    assert!((kp / STEPS_BEST - 1.0).abs() < 0.2, "{kp}");
}

#[test]
#[ignore = "it takes more than half a minute: `.ci/edge` runs it"]
fn a_place_that_sticks_gets_the_same_gain_from_far_below() {
    let kp = tuned_by_steps(STEPS_BEST / 4.0);
    assert!((kp / STEPS_BEST - 1.0).abs() < 0.2, "{kp}");
}

#[test]
#[ignore = "it takes more than half a minute: `.ci/edge` runs it"]
fn steps_over_one_contact_keep_the_margins_over_another_one_that_was_measured() {
    let (_folder, path) = in_new_folder("bode.svg");
    let both = ["graphs/hybrid.toml", "--feature", "pressure", "--with", "graphs/benches/pen.toml"];
    let said = say(&[&["tune"], &both[..], &["--svg", &path, "--format", "json"]].concat());
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let feature = &tuned["features"][0];
    let (ball, pen) = (&feature["margins"][0], &feature["margins"][1]);
    assert!(ball.is_null() && feature["answers"][0]["refused"].is_string(), "{feature}");
    assert!(pen["gain_db"].as_f64().unwrap() >= 9.0 && pen["peak_sensitivity"].as_f64().unwrap() <= 1.7, "{pen}");
    // The curve has the proposed gains, as the dots.
    let drawn = peer("bode.py", &[&path]);
    let crossover: f64 = drawn.split_whitespace().next().unwrap().parse().unwrap();
    assert!((crossover / pen["crossover_hz"].as_f64().unwrap() - 1.0).abs() < 0.02, "{drawn}: {pen}");
}

#[test]
#[ignore = "it takes more than half a minute: `.ci/edge` runs it"]
fn a_light_press_is_measured_by_small_motions_and_its_gains_keep_the_contact() {
    let said = say(&["tune", "graphs/guided.toml", "--format", "json"]);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let feature = &tuned["features"][0];
    let answer = &feature["answers"][0];
    assert_eq!(answer["lifts_off"].as_f64(), Some(2.4e-3), "{answer}");
    let [kp, gain] = [&feature["new"][0], &answer["fits"][0][1]["gain"]].map(|number| number.as_f64().unwrap());
    // The contact flickers with 0.5, which is the gain of the task.
    assert!((0.2..=0.4).contains(&kp), "{kp}");
    // Without a delay and an integral, the crossover is at kp g.
    let crossover = feature["margins"][0]["crossover_hz"].as_f64().unwrap() * std::f64::consts::TAU;
    assert!((1.0..1.3).contains(&(crossover / (kp * gain))), "{crossover} rad/s, {kp}, {gain}");
}

#[test]
fn a_task_that_follows_a_cable_is_tuned_while_it_stands() {
    let said = say(&["tune", "graphs/cable.toml", "--feature", "orientation", "--format", "json"]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    assert!(said.err.contains("`guide` rests meanwhile"), "{}", said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let (fit, kp) =
        (&tuned["features"][0]["answers"][0]["fits"][0][1], tuned["features"][0]["new"][0].as_f64().unwrap());
    // By geometry, 1 rad of the sensor turns the line by 1 rad; the shipped gain is 6.
    assert!((1.0..1.4).contains(&-fit["gain"].as_f64().unwrap()) && (kp / 6.0 - 1.0).abs() < 0.2, "{kp}: {fit}");
}

#[test]
#[ignore = "it takes more than a minute: `.ci/edge` runs it"]
fn a_task_whose_modes_can_follow_each_other_without_a_contact_is_tuned_in_one_of_them() {
    let said = say(&["tune", "graphs/seek_ridge.toml", "--feature", "orientation", "--format", "json"]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let (fit, kp) =
        (&tuned["features"][0]["answers"][0]["fits"][0][1], tuned["features"][0]["new"][0].as_f64().unwrap());
    // The shipped gain is 2, and that of the edge, which is as long and stiffer, is 7.
    assert!((1.0..1.4).contains(&-fit["gain"].as_f64().unwrap()) && kp > 2.0 && kp < 10.0, "{kp}: {fit}");
}

#[test]
#[ignore = "it takes some minutes: `.ci/edge` runs it"]
fn two_arms_that_hold_an_object_are_tuned_together_and_their_part_gets_the_gains() {
    let (folder, path) = in_new_folder("carry.toml");
    let beside = |name: &str| folder.path().join(name).display().to_string();
    let (side, bench) = (beside("carry_side.toml"), beside("box.toml"));
    let parts = tactflow_tests::workspace().join("graphs/parts").display().to_string();
    let whole = shipped("carry.toml").replace(&format!("{parts}/carry_side.toml"), &side);
    let part = shipped("parts/carry_side.toml")
        .replace("\"touch.toml\"", &format!("\"{parts}/touch.toml\""))
        .replace("\"move.toml\"", &format!("\"{parts}/move.toml\""));
    fs::write(&path, &whole).unwrap();
    fs::write(&side, &part).unwrap();
    fs::write(&bench, shipped("benches/carried_box.toml")).unwrap();
    let said = say(&["tune", &path, "--bench", &bench, "--save"]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let read = |file: &str| toml::from_str::<toml::Table>(&fs::read_to_string(file).unwrap()).unwrap();
    let gains = read(&side)["nodes"]["pid"]["gains"]["force"].clone();
    let [kp, ki] = ["kp", "ki"].map(|key| gains[key].as_float().unwrap());
    // The shipped gains are 1 and 0.5, and stay in their ratio.
    assert!(kp > 1.0 && kp < 3.0 && (ki / kp - 0.5).abs() < 0.01, "{kp}, {ki}");
    assert_eq!(fs::read_to_string(&path).unwrap(), whole);
    let force = read(&bench)["facts"]["left_arm"]["contacts"][0]["force"].clone();
    // One pad alone would move the object. Between both, the force grows with the way of each of them.
    assert!((800.0..1200.0).contains(&force["vz"].as_float().unwrap()), "{force}");
}

#[test]
fn a_loop_that_pushes_the_wrong_way_gets_no_gains() {
    // With a reversed column the contact leaves the pad, and the mode ends.
    let set = "nodes.jacobian.columns.x=[1, 0, 0, 0, 0, 0]";
    let said = say(&["tune", "graphs/hybrid.toml", "--feature", "x", "--set", set]);
    assert_eq!(said.code, 1, "{}{}", said.out, said.err);
    assert!(said.out.contains("No gain"), "{}", said.out);
}

#[test]
fn the_bode_plot_shows_the_margins_and_what_was_measured() {
    let (_folder, path) = in_new_folder("bode.svg");
    let said = say(&["tune", "graphs/edge.toml", "--feature", "orientation", "--svg", &path, "--format", "json"]);
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let feature = &tuned["features"][0];
    let margins = &feature["margins"][0];
    let drawn = peer("bode.py", &[&path]);
    let drawn: Vec<f64> = drawn.split_whitespace().map(|word| word.parse().unwrap()).collect();
    let [crossover, phase, dots, far] = drawn[..] else { panic!("{drawn:?}") };
    assert!((crossover / margins["crossover_hz"].as_f64().unwrap() - 1.0).abs() < 0.02, "{drawn:?}: {margins}");
    assert!((phase - margins["phase_deg"].as_f64().unwrap()).abs() < 1.5, "{drawn:?}: {margins}");
    let frequencies = feature["answers"][0]["fits"][0][1]["frequencies"].as_f64().unwrap();
    assert_eq!(dots, 2.0 * frequencies, "{drawn:?}");
    // The curve goes through the dots, and geometry says 1 where 0.99 was measured.
    assert!(far < 0.5, "a dot is {far} dB beside the curve");
}

/// Each run opens the simulator again, whose arm stands where the last run has left it.
#[test]
#[ignore = "it takes more than a minute: `.ci/edge` runs it"]
fn a_loop_is_measured_on_a_simulator_that_does_not_start_again() {
    let simulator = Peer::start("--again --seconds 110");
    let address = format!("devices.bench.address=127.0.0.1:{}", simulator.port);
    let bench = ["--bench", "graphs/benches/lockstep.toml", "--set", &address];
    let said =
        say(&[&["tune", "graphs/hybrid.toml", "--feature", "pressure", "--format", "json"], &bench[..]].concat());
    assert_eq!(said.code, 0, "{}{}", said.out, said.err);
    let tuned: Value = serde_json::from_str(&said.out).unwrap();
    let fit = &tuned["features"][0]["answers"][0]["fits"][0][1];
    assert!(fit["residual"].as_f64().unwrap() < 0.3 && fit["gain"].as_f64().unwrap() > 5.0, "{fit}");
}
