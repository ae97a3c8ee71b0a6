//! Somebody guides an arm over ROS 2 with CycloneDDS, `tests/peers/ros2/guide.py`. The arm and the pad are simulated.

use std::fs;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};
use tactflow_tests::workspace;
use tempfile::TempDir;

use super::end;
use crate::cli::in_new_folder;
use crate::control_law::rows;
use crate::peer::Process;
use crate::record::has_python_module;
use crate::tool::tool;

/// Somebody who guides, in a domain of its own; `None` without CycloneDDS.
fn guide(domain: u32, settings: &Value) -> Option<Process> {
    if !has_python_module("cyclonedds") {
        return None;
    }
    let mut all = json!({ "domain": domain });
    all.as_object_mut().unwrap().extend(settings.as_object().unwrap().clone());
    let process = Process::start("ros2/guide.py", [all.to_string().as_str()]);
    process.wait(0, |event| event["is_ready"] == true);
    Some(process)
}

/// Writes the shipped bench with a guide over ROS 2 in place of the script.
fn bench(domain: u32) -> (TempDir, String) {
    let text = fs::read_to_string(workspace().join("graphs/benches/guided_table.toml")).unwrap();
    let (before, rest) = text.split_once("[devices.hand]").unwrap();
    let (_, after) = rest.split_once("[limits]").unwrap();
    let before = before.replace("\"../", &format!("\"{}/", workspace().join("graphs").display()));
    let device = "type = \"ros2_guide\"\ntopic = \"/guide/twist\"\nframe = \"tactile_pad\"\nrate_hz = 50.0";
    let (folder, path) = in_new_folder("bench.toml");
    let device = format!("[devices.hand]\n{device}\nconnect_s = 2.0\ndomain = {domain}");
    fs::write(&path, format!("{before}{device}\n\n[limits]{after}")).unwrap();
    (folder, path)
}

fn run(bench: &str, more: &[&str]) -> Child {
    let args = ["run", "graphs/guided.toml", "--bench", bench, "--realtime", "--no-socket"];
    let mut run = tool(&[&args[..], more].concat());
    run.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

#[test]
fn the_pad_follows_a_guide_over_ros_2_and_the_contact_is_held_when_it_is_silent() {
    let Some(mut peer) = guide(86, &json!({"velocity": [0.008, 0, 0, 0, 0, 0]})) else { return };
    let (folder, bench) = bench(86);
    let out = folder.path().join("run.csv");
    let child = run(&bench, &["--for", "12s", "--out", out.to_str().unwrap()]);
    sleep(Duration::from_secs(5));
    peer.say("guide");
    sleep(Duration::from_secs(3));
    peer.say("rest");
    let text = end(child);
    assert!(!text.contains("nobody guides"), "{text}");
    let rows = rows(out.to_str().unwrap());
    let guided: Vec<(f64, f64)> =
        rows.iter().filter_map(|row| Some((row["time"], *row.get("guidance.twist.vx")?))).collect();
    assert!(guided.len() > 400 && guided.iter().all(|(_, vx)| *vx == 0.008), "{} ticks", guided.len());
    let (first, last) = (guided[0].0, guided[guided.len() - 1].0);
    assert!((2.5..3.8).contains(&(last - first)), "from {first} s to {last} s");
    // The run goes on, the arm rests, and the contact is held.
    let rest: Vec<_> = rows.iter().filter(|row| row["time"] > last + 0.2).collect();
    assert!(rest.len() > 300, "{} ticks", rest.len());
    for row in rest {
        let speed = row["move.acceleration.twist.vx"].abs();
        assert!(speed < 1e-3, "{speed} m/s at {} s", row["time"]);
        assert!((row["calm.value"] - 0.03).abs() < 0.01, "{} N per tactel", row["calm.value"]);
    }
}

#[test]
fn what_is_wrong_with_a_guide_is_named_and_guides_nothing() {
    let cases = [
        (json!({ "frame": "base_link" }), "", "`/guide/twist` has velocities in `base_link`, and not in `tactile_pad`"),
        (json!({ "frame": "" }), "", "has velocities in ``, and not in `tactile_pad`"),
        (json!({ "stamp_offset": -3.0 }), "", "behind the clock of this machine, and at most 50 ms"),
        (json!({ "stamp_offset": 0.5 }), "", "ahead of the clock of this machine, and at most 50 ms"),
        (json!({ "stamp_offset": -1.7e9 }), "", "are years away from the clock of this machine"),
        (json!({ "has_stamp": false }), "", "have no stamp, so that an old one could not be recognized"),
        (json!({ "type": "String" }), "", "of the type std_msgs/msg/String, and not"),
        (json!({ "topic": "/guide/other" }), "", "nobody publishes `/guide/twist` in the domain "),
        (json!({}), "second", "two programs publish on `/guide/twist`: only one may guide"),
        (json!({}), "nan", "`guide.velocity` is not a finite number"),
    ];
    for (i, (settings, word, expected)) in cases.into_iter().enumerate() {
        let domain = 87 + i as u32;
        let Some(mut peer) = guide(domain, &settings) else { return };
        let (folder, bench) = bench(domain);
        let out = folder.path().join("run.csv");
        let child = run(&bench, &["--for", "4s", "--quiet", "--out", out.to_str().unwrap()]);
        peer.say("guide");
        if !word.is_empty() {
            peer.say(word);
        }
        let text = end(child);
        assert!(text.contains(expected), "{settings} {word}: {text}");
        if word.is_empty() {
            let guided = rows(out.to_str().unwrap()).iter().filter(|row| row.contains_key("guidance.twist.vx")).count();
            assert_eq!(guided, 0, "{settings}: {guided} ticks");
        }
    }
}

#[test]
fn a_guide_that_cannot_be_right_is_refused_without_a_domain() {
    for (from, to, expected) in [
        ("\"/guide/twist\"", "\"guide\"", "`guide` is no name of a topic"),
        ("\"tactile_pad\"", "\"\"", "velocities without a frame mean nothing"),
        ("rate_hz = 50.0\nconnect_s", "rate_hz = 0.0\nconnect_s", "rate_hz"),
    ] {
        let (_folder, path) = bench(85);
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(&path, text.replace(from, to)).unwrap();
        let checked = crate::tool::say(&["check", "graphs/guided.toml", "--bench", &path]);
        assert!(checked.code != 0 && checked.err.contains(expected), "{to}: {}{}", checked.out, checked.err);
    }
}
