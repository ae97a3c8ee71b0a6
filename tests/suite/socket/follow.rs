//! Ports that are followed: whole values with the time of their sample, images included.

use std::collections::BTreeMap;
use std::io::BufRead;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};

use super::ask;
use super::session::{Session, finish, wait_for};

const FOLLOW: &str =
    r#"{"ask":"follow","ports":["pad.image","touch.x","pid.control","move.sensor_pose"],"period_ms":20}"#;

#[test]
fn a_follower_gets_whole_values_at_its_rate_with_the_times_of_their_samples() {
    let mut session = Session::new();
    let table = session.folder.path().join("run.csv");
    let pid = session.run(&["graphs/hybrid.toml", "--out", table.to_str().unwrap()]);
    wait_for(|| (session.about()["tasks"][0]["mode"] == json!("servo")).then_some(()), "mode servo");
    let mut client = session.connect(pid);
    let facts = ask(&mut client, FOLLOW)["ok"].clone();
    let named = |name: &str| facts.as_array().unwrap().iter().find(|facts| facts["name"] == name).unwrap();
    let image = json!({"rows": 16, "cols": 16, "pitch": [0.005, 0.005], "unit": "raw"});
    assert_eq!((&named("pad.image")["image"], &named("pad.image")["kind"]), (&image, &json!("image")));
    assert_eq!(named("move.sensor_pose")["frames"], json!(["pad", "arm.base"]));
    assert_eq!(named("pid.control")["numbers"][0], json!(["x", "m/s"]));
    let (begin, mut lines, mut controls, mut youngest) = (Instant::now(), 0, BTreeMap::new(), i64::MAX);
    while begin.elapsed() < Duration::from_secs(1) {
        let mut line = String::new();
        client.read_line(&mut line).unwrap();
        let line: Value = serde_json::from_str(&line).unwrap();
        lines += 1;
        let image = &line["ports"]["pad.image"];
        assert_eq!(image["values"].as_array().unwrap().len(), 256);
        // The image, and what is computed from it, have one stamp.
        let stamp = image["stamp_ns"].as_i64().unwrap();
        assert_eq!(line["ports"]["touch.x"]["stamp_ns"].as_i64(), Some(stamp), "{line}");
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as i64;
        assert!(stamp <= now, "a sample from the future");
        youngest = youngest.min(now - stamp);
        let control = &line["ports"]["pid.control"]["values"];
        controls.insert(control[0].to_string(), line["t"].as_f64().unwrap());
    }
    assert!((20..=51).contains(&lines), "{lines} lines in a second");
    assert!(youngest < 200_000_000, "{youngest} ns");
    session.end();
    // Every number that was sent is one of the table of the run.
    let table = std::fs::read_to_string(table).unwrap();
    let mut rows = table.lines().filter(|line| !line.starts_with('#')).map(|row| row.split(',').collect::<Vec<_>>());
    let head = rows.next().unwrap();
    let at = head.iter().position(|name| name.starts_with("pid.control.x")).unwrap();
    let known: Vec<Option<f64>> = rows.map(|row| row[at].parse().ok()).collect();
    for control in controls.keys() {
        assert!(known.contains(&control.parse().ok()), "{control}");
    }
    assert!(controls.len() > 10, "{controls:?}");
}

#[test]
fn a_follower_that_reads_slowly_gets_the_newest_values_and_how_the_run_has_ended() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml", "--for", "4s"]);
    let mut client = session.connect(pid);
    assert!(ask(&mut client, r#"{"ask":"follow","ports":["*"],"period_ms":0}"#)["ok"].is_array());
    let mut lines: Vec<Value> = Vec::new();
    for line in client.lines() {
        lines.push(serde_json::from_str(&line.unwrap()).unwrap());
        std::thread::sleep(Duration::from_millis(20));
    }
    let ended = finish(session.runs.remove(0));
    assert_eq!(ended.code, 0, "the run is not delayed: {}", ended.err);
    let (last, before) = lines.split_last().unwrap();
    assert_eq!(last["end"], json!({"reason": "the time limit is reached", "is_fault": false}));
    // Lines in between are skipped, and never the newest ones.
    let times: Vec<f64> = before.iter().map(|line| line["t"].as_f64().unwrap()).collect();
    assert!(times.len() < 400 && times.is_sorted() && times[times.len() - 1] > 3.9, "{times:?}");
}

#[test]
fn a_run_says_what_it_ends_in_and_one_that_is_killed_says_nothing() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml", "--send", "1s:stop"]);
    let mut client = session.connect(pid);
    // Without a port, only the end comes.
    assert_eq!(ask(&mut client, r#"{"ask":"follow","ports":[],"period_ms":20}"#), json!({"ok": []}));
    let mut line = String::new();
    client.read_line(&mut line).unwrap();
    let line: Value = serde_json::from_str(&line).unwrap();
    assert_eq!(line["end"]["is_fault"], json!(true));
    assert!(line["end"]["reason"].as_str().unwrap().contains("the operator sent `stop`"), "{line}");
    finish(session.runs.remove(0));
    let pid = session.run(&["graphs/hybrid.toml"]);
    let mut client = session.connect(pid);
    assert_eq!(ask(&mut client, r#"{"ask":"follow","ports":[],"period_ms":20}"#), json!({"ok": []}));
    session.runs[0].kill().unwrap();
    assert_eq!(client.lines().count(), 0);
}

#[test]
fn what_cannot_be_followed_is_named() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml"]);
    for (ask_for, expected) in [
        (r#""ports":["pad.imag"],"period_ms":20"#, "did you mean `pad.image`?"),
        (r#""ports":["touch.x"],"period_ms":-1"#, "`period_ms` must be from 0 to 10000"),
        (r#""ports":["touch.x"],"period_ms":1e9"#, "`period_ms` must be from 0 to 10000"),
        (r#""ports":["touch.x"]"#, "missing field `period_ms`"),
        (r#""ports":["touch.label.regions"],"period_ms":20"#, "masks, regions and Jacobians cannot be followed"),
    ] {
        let answer = ask(&mut session.connect(pid), &format!("{{\"ask\":\"follow\",{ask_for}}}"));
        assert!(answer["error"].as_str().unwrap().contains(expected), "{ask_for}: {answer}");
    }
}
