//! `tare`: a pad whose zero has drifted gets a new one, only halted, at rest and without a contact, and a replay has it
//! too.

use tactflow_runtime::harness::{FedRole, GraphRig};
use tactflow_runtime::random::Random;
use tactflow_runtime::signal::{Image, ImageShape, Unit};

use crate::control_law::rows;
use crate::replay::{recorded, ticks_of_replay};
use crate::tool::say;

/// A pad of four tactels with a self-test of eight frames.
const PAD: &str = "
    graph.clock = 'pad'
    roles.pad = 'tactile_pad'
    [nodes.source]
    type = 'tactile_source'
    in.image = 'pad.image'
    [nodes.calibrate]
    type = 'calibrate'
    in.image = 'source.image'
    offset = 100.0
    gain = 0.01
    unit = 'N'
    rest_frames = 8
    tare_bound = 50.0
";

/// Feeds frames whose readings are `reading` and a little noise, one every 4 ms.
fn feed(rig: &mut GraphRig, random: &mut Random, now: &mut f64, reading: f64, frames: usize) {
    for _ in 0..frames {
        *now += 4.0;
        let cells: Vec<f32> = (0..4).map(|_| (reading + random.uniform(-1.0, 1.0)) as f32).collect();
        rig.feed("pad.image", *now, Image::from_cells(2, &cells));
        rig.tick(*now).unwrap();
    }
}

fn force(rig: &GraphRig) -> Option<f32> {
    rig.get::<Image>("calibrate.image").map(|image| image.cells().iter().sum::<f32>() / 4.0)
}

#[test]
fn a_drifted_zero_is_taken_anew_and_a_touched_pad_keeps_its_own() {
    let shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::RAW };
    let pad = FedRole::new("pad", "tactile_pad", 4.0).output("image", shape);
    let rig = GraphRig::new(tactflow_nodes::catalogue(), PAD, vec![pad]);
    let mut rig = rig.unwrap_or_else(|report| panic!("{}", report.render(false)));
    let (mut random, mut now) = (Random::new(18, 3), 0.0);
    feed(&mut rig, &mut random, &mut now, 100.0, 12);
    assert!(force(&rig).unwrap().abs() < 0.02);
    // The foam has crept by 0.035 N, and the zero is that of the start.
    feed(&mut rig, &mut random, &mut now, 103.5, 5);
    assert!((force(&rig).unwrap() - 0.035).abs() < 0.015);
    rig.send("tare");
    feed(&mut rig, &mut random, &mut now, 103.5, 7);
    assert_eq!(force(&rig), None, "without a zero there is no force");
    feed(&mut rig, &mut random, &mut now, 103.5, 3);
    assert!(force(&rig).unwrap().abs() < 0.015, "{:?}", force(&rig));
    // A touch of a tenth of a newton is no zero, although the self-test would accept it.
    for reading in [113.5, 230.0] {
        feed(&mut rig, &mut random, &mut now, reading, 3);
        let refused = rig.engine_mut().tare().unwrap_err();
        assert!(
            refused.contains("`calibrate`: something touches the pad, or its zero has drifted too far: 4 tactels"),
            "{refused}"
        );
    }
    feed(&mut rig, &mut random, &mut now, 103.5, 1);
    assert!(force(&rig).unwrap().abs() < 0.02, "the zero has stayed");
}

#[test]
fn a_graph_without_a_zero_says_so() {
    let shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::RAW };
    let pad = FedRole::new("pad", "tactile_pad", 4.0).output("image", shape);
    let graph = PAD.split("    [nodes.calibrate]").next().unwrap();
    let mut rig = GraphRig::new(tactflow_nodes::catalogue(), graph, vec![pad]).unwrap_or_else(|_| panic!("it loads"));
    let refused = rig.engine_mut().tare().unwrap_err();
    assert_eq!(refused, "`tare` has no effect: no node of the graph keeps the zero of a sensor");
}

#[test]
fn a_light_touch_is_not_taken_as_a_zero() {
    let words = ["--send", "1.112s:stop", "--send", "1.5s:tare", "--for", "2.4s", "--send", "2.3s:resume", "--quiet"];
    let run = say(&[&["run", "graphs/hybrid.toml"], &words[..]].concat());
    assert!(
        run.code == 0 && run.err.contains("`tare` has no effect: `touch.calibrate`: something touches"),
        "{}",
        run.err
    );
}

#[test]
fn a_task_is_tared_only_halted_and_without_a_contact_and_a_replay_has_it() {
    // It stops before the contact at 1.1 s, and goes on afterwards.
    let words = ["--send", "0.2s:tare", "--send", "0.3s:stop", "--send", "0.8s:TARE", "--send", "1.2s:resume"];
    let late = ["--send", "4s:stop", "--send", "4.6s:tare", "--send", "5s:resume", "--for", "6s"];
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("run.csv");
    let csv = csv.to_str().unwrap();
    let args = [&["graphs/hybrid.toml"], &words[..], &late[..], &["--out", csv]].concat();
    let run = say(&[&["run"], &args[..]].concat());
    assert_eq!(run.code, 0, "{}", run.err);
    for refused in [
        "`tare` has no effect: the task runs: send `stop` first",
        "`tare` has no effect: `touch.calibrate`: something touches the pad, or its zero ",
    ] {
        assert_eq!(run.err.matches(refused).count(), 1, "{}", run.err);
    }
    // Forty frames of the self-test, in which the pad has no force.
    let rows = rows(csv);
    let absent = |row: &&std::collections::BTreeMap<String, f64>| !row.contains_key("touch.label.present");
    let times: Vec<f64> = rows.iter().filter(absent).map(|row| row["time"]).filter(|time| *time > 0.5).collect();
    let (first, last) = (times[0], times[times.len() - 1]);
    assert!(
        (38..=42).contains(&times.len()) && first >= 0.8 && last < 0.98,
        "{} from {first} s to {last} s",
        times.len()
    );
    assert!(rows.last().unwrap()["touch.moments.force"] > 1.0, "it is in contact again");
    let path = recorded(folder.path(), &args[..args.len() - 2]);
    assert_eq!(ticks_of_replay(&path), Ok(1501));
}
