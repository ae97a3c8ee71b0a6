//! A graph that runs is reached from other processes: it shows its values, changes, stops, and is delayed by nobody.

mod follow;
pub(crate) mod session;

use std::io::{BufRead, BufReader, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::Command;

use serde_json::{Value, json};
use tactflow_runtime::random::Random;
use tactflow_tests::workspace;
use tempfile::TempDir;

use crate::tool::said;
use session::{PATIENCE, Session, finish, wait_for};

const KP: &str = "pid.gains.y.kp";
/// Sends a line, and returns the answer.
fn ask(client: &mut BufReader<UnixStream>, line: &str) -> Value {
    client.get_mut().write_all(format!("{line}\n").as_bytes()).unwrap();
    let mut answer = String::new();
    client.read_line(&mut answer).unwrap();
    serde_json::from_str(&answer).unwrap_or_else(|error| panic!("{answer:?}: {error}"))
}

#[test]
fn runs_are_listed_and_one_of_several_is_chosen() {
    let mut session = Session::new();
    assert!(session.print(&["ps"]).contains("no graph runs in real time"));
    for args in [&["get"][..], &["set", "pid.gains.y.kp=2"], &["send", "stop"], &["watch", "touch.x"]] {
        let none = session.say(args);
        assert_eq!(none.code, 2, "{args:?}");
        assert!(none.err.contains("no graph runs in real time\nhelp: start one"), "{}", none.err);
    }
    let first = session.run(&["graphs/hybrid.toml"]);
    wait_for(|| session.print(&["ps"]).contains("servo").then_some(()), "mode servo");
    let about = session.about();
    assert_eq!((&about["pid"], &about["graph"]), (&json!(first), &json!("graphs/hybrid.toml")));
    assert!(about["t"].as_f64().unwrap() > 0.5 && about["tasks"][0]["halted"] == json!(false), "{about}");

    let second = session.run(&["graphs/force.toml"]);
    let listed = session.print(&["ps"]);
    assert!(listed.contains("graphs/hybrid.toml") && listed.contains("graphs/force.toml"), "{listed}");
    let unclear = session.say(&["get"]);
    assert_eq!(unclear.code, 2);
    for part in ["not clear which run", &format!("`--run {first}`"), &format!("`--run {second}` for graphs/force.toml")]
    {
        assert!(unclear.err.contains(part), "{part}: {}", unclear.err);
    }
    for name in [&second.to_string(), "force", "force.toml", "graphs/force.toml"] {
        let got = session.print(&["get", "--run", name]);
        assert!(!got.contains("live parameter") && got.contains("port"), "{name}: {got}");
    }
    let unknown = session.say(&["get", "--run", "press"]);
    assert!(unknown.code == 2 && unknown.err.contains("no graph `press` runs\nhelp: 2 graphs run"), "{}", unknown.err);
    // A graph without [live] says so.
    let refused = session.say(&["set", "pid.gains.x.kp=1", "--run", "force"]);
    assert!(refused.code == 2 && refused.err.contains("lists no parameter in [live]"), "{}", refused.err);
}

#[test]
fn virtual_time_and_no_socket_open_none() {
    let session = Session::new();
    session.print(&["run", "graphs/hybrid.toml", "--for", "1s", "-q"]);
    session.print(&["run", "graphs/hybrid.toml", "--for", "0.1s", "--realtime", "--no-socket", "-q"]);
    assert!(!session.folder.path().join("tactflow").exists());
}

#[test]
fn a_gain_is_changed_within_its_range_and_the_summary_says_so() {
    let mut session = Session::new();
    session.run(&["graphs/hybrid.toml"]);
    let cases = [
        ("pid.gains.y.kp=7", "`pid.gains.y.kp` cannot be 7: [live] allows 0.5 to 6"),
        ("pid.gains.y.kq=2", "[live] does not list it; did you mean `pid.gains.y.kp`?"),
        ("nodes.pid.gains.y.kp=2", "write `pid.gains.y.kp`, as in [live]"),
        ("pid.gains.y.kp=nan", "`nan` is not a number"),
        ("pid.gains.y.kp", "give a parameter and a number"),
    ];
    for (change, message) in cases {
        let refused = session.say(&["set", change]);
        assert_eq!(refused.code, 2, "{change}");
        assert!(refused.err.contains(message), "{change}: {}", refused.err);
    }
    assert!(session.say(&["set", "pid.gains.y.kp=3", "pid.gains.y.kp=2"]).err.contains("given twice"));
    let answer = session.print(&["set", "pid.gains.y.kp=3.5"]);
    // 1 at 2 per second, in ticks that take 0.8 of it.
    assert_eq!(answer.trim(), "`pid.gains.y.kp` goes from 4 to 3.5 in about 0.3 s");
    let live = || {
        let got: Value = serde_json::from_str(&session.print(&["get", KP, "--format", "json"])).unwrap();
        got["live"][0].clone()
    };
    wait_for(|| (live()["value"] == json!(3.5)).then_some(()), "end of the change");
    let live = live();
    assert_eq!(
        (&live["target"], &live["min"], &live["max"], &live["rate"]),
        (&json!(3.5), &json!(0.5), &json!(6.0), &json!(2.0))
    );
    assert_eq!(live["unit"], json!("1/s"));
    let text = session.print(&["get", KP]);
    assert!(text.contains("live parameter") && text.contains("2/s"), "{text}");
    let end = session.end();
    assert!(end.out.contains("`pid.gains.y.kp` changed from 4 to 3.5 at "), "{}", end.out);
    assert!(!end.out.contains("cannot be 7"), "{}", end.out);
}

#[test]
fn only_words_that_stop_are_sent() {
    let mut session = Session::new();
    let recording = session.folder.path().join("run.mcap").display().to_string();
    session.run(&["graphs/hybrid.toml", "--listen", "--record", &recording]);
    wait_for(|| (session.about()["tasks"][0]["mode"] == json!("servo")).then_some(()), "mode servo");
    let resume = session.say(&["send", "resume"]);
    assert!(resume.code == 2 && resume.err.contains("`resume` can start a motion"), "{}", resume.err);
    let unknown = session.say(&["send", "stopp"]);
    assert!(unknown.code == 2 && unknown.err.contains("did you mean `stop`?"), "{}", unknown.err);
    assert!(session.print(&["send", "STOP"]).contains("stay there until the run gets `resume`"));
    let halted = |session: &Session| session.about()["tasks"][0]["halted"].as_bool().unwrap();
    wait_for(|| halted(&session).then_some(()), "halt");
    assert!(session.print(&["ps"]).contains("halted"));
    let task = session.about()["tasks"][0].clone();
    assert!(
        task["reason"].as_str().unwrap().contains("the operator sent `stop`") && task["halts"] == json!(1),
        "{task}"
    );
    // The terminal of the run resumes.
    session.runs[0].stdin.as_mut().unwrap().write_all(b"resume\n").unwrap();
    wait_for(|| (!halted(&session)).then_some(()), "end of the halt");
    assert!(session.about()["tasks"][0]["reason"].is_null());
    session.print(&["set", "pid.gains.y.kp=3.5"]);
    wait_for(|| session.print(&["get", KP]).contains(" 3.5 ").then_some(()), "end of the change");
    let end = session.end();
    assert!(end.out.contains("the operator sent `stop`"), "{}", end.out);
    // What came over the socket is in the recording, and comes again.
    let replay = session.say(&["replay", &recording]);
    assert!(
        replay.code == 0 && replay.out.contains("`pid.gains.y.kp` changed from 4 to 3.5"),
        "{}{}",
        replay.out,
        replay.err
    );
}

#[test]
fn a_watcher_gets_what_the_table_of_the_run_contains() {
    let mut session = Session::new();
    let table = session.folder.path().join("run.csv");
    session.run(&["graphs/hybrid.toml", "--out", table.to_str().unwrap()]);
    let lines = session.print(&["watch", "touch.x", "pid.control", "-n", "100"]);
    session.end();
    let table = std::fs::read_to_string(table).unwrap();
    let mut rows = table.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = rows.next().unwrap().split(',').collect();
    let at = |name: &str| names.iter().position(|known| known.split(' ').next() == Some(name)).unwrap();
    let columns = [("touch.x", at("touch.moments.x")), ("pid.control.x", at("pid.control.x"))];
    let rows: Vec<Vec<&str>> = rows.map(|row| row.split(',').collect()).collect();
    let mut compared = 0;
    assert_eq!(lines.lines().count(), 100);
    for line in lines.lines() {
        let sample: Value = serde_json::from_str(line).unwrap();
        assert!(sample.get("lost").is_none(), "{line}");
        let time = sample["t"].as_f64().unwrap();
        // The table has a row for each tick, with the time at which the tick really began.
        let row = &rows[(time / 0.004).round() as usize];
        assert!((row[0].parse::<f64>().unwrap() - time).abs() < 0.5, "{} and {time}", row[0]);
        for (name, column) in columns {
            let Some(value) = sample.get(name) else { continue };
            assert_eq!(value.as_f64(), row[column].parse::<f64>().ok(), "{name} at {time}");
            compared += usize::from(!value.is_null());
        }
    }
    assert!(compared > 50, "{compared} numbers compared");
}

#[test]
fn a_watcher_that_does_not_read_loses_samples_and_is_told_how_many() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml"]);
    let mut stuck = session.connect(pid);
    // Every sample of the arm is new, so that a gap in time is a loss.
    assert_eq!(ask(&mut stuck, r#"{"ask":"watch","ports":["*"]}"#), json!({"ok": null}));
    let mut quick = session.connect(pid);
    assert_eq!(ask(&mut quick, r#"{"ask":"watch","ports":["arm.position"],"count":800}"#), json!({"ok": null}));
    let samples: Vec<Value> = quick.lines().map(|line| serde_json::from_str(&line.unwrap()).unwrap()).collect();
    assert_eq!(samples.len(), 800, "the run is not delayed, and the other watcher is not either");
    assert!(samples.iter().all(|sample| sample.get("lost").is_none()));
    let (mut last, mut lost) = (None, 0);
    for _ in 0..600 {
        let mut line = String::new();
        stuck.read_line(&mut line).unwrap();
        let sample: Value = serde_json::from_str(&line).unwrap();
        let tick = (sample["t"].as_f64().unwrap() / 0.004).round() as u64;
        let new = sample.get("lost").map_or(0, |lost| lost.as_u64().unwrap());
        if let Some(last) = last {
            assert_eq!(tick - last - 1, new, "at {tick}");
        }
        (last, lost) = (Some(tick), lost + new);
    }
    assert!(lost > 50, "{lost} lost");
}

#[test]
fn garbage_is_refused_and_delays_nobody() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml"]);
    let cases = [
        ("go", "this line is no request"),
        ("{}", "missing field `ask`"),
        (r#"{"ask":"step"}"#, "unknown variant `step`"),
        (r#"{"ask":"tare"}"#, "`tare` has no effect: the task runs: send `stop` first"),
        (r#"{"ask":"get","patern":"*"}"#, "unknown field `patern`"),
        (
            r#"{"ask":"get","pattern":"pad.imag"}"#,
            "no parameter in [live] and no number of a port is called `pad.imag`",
        ),
        (r#"{"ask":"set","values":{}}"#, "name a parameter and its value"),
        (r#"{"ask":"set","values":{"pid.gains.y.kp":"2"}}"#, "this line is no request"),
        (r#"{"ask":"set","values":{"pid.gains.y.kp":1e999}}"#, "this line is no request"),
        (r#"{"ask":"get","pattern":"*q*q*q*q*q*q*q*q"}"#, "is called `*q*q*q"),
        (r#"{"ask":"send","word":"resume"}"#, "can start a motion"),
    ];
    let mut client = session.connect(pid);
    for (line, message) in cases {
        let answer = ask(&mut client, line);
        assert!(answer["error"].as_str().is_some_and(|error| error.contains(message)), "{line}: {answer}");
    }
    let refused = ask(&mut session.connect(pid), r#"{"ask":"watch","ports":["touch.xx"]}"#);
    assert!(refused["error"].as_str().unwrap().contains("did you mean `touch.x`?"), "{refused}");
    let long = ask(&mut session.connect(pid), &"x".repeat(20_000));
    assert!(long["error"].as_str().unwrap().contains("longer than"), "{long}");
    // Bytes without end, and as many connections as there may be.
    let mut random = Random::new(18, 1);
    let noise: Vec<u8> = (0..4096).map(|_| random.uniform(0.0, 256.0) as u8).collect();
    let mut floods: Vec<UnixStream> = (0..3).map(|_| UnixStream::connect(session.socket(pid)).unwrap()).collect();
    for flood in &mut floods {
        flood.set_nonblocking(true).unwrap();
        (0..50).for_each(|_| _ = flood.write(&noise));
    }
    assert!(session.print(&["get", KP]).contains(" 4 "));
    // The places of the floods are free once the run has closed them, and are taken too.
    let mut idle = Vec::new();
    let full = wait_for(
        || {
            idle.extend((0..100).map(|_| UnixStream::connect(session.socket(pid)).unwrap()));
            Some(session.say(&["get", KP])).filter(|said| said.code != 0)
        },
        "refusal",
    );
    assert!(full.code == 2 && full.err.contains("has 64 clients already"), "{}", full.err);
    drop(idle);
    wait_for(|| (session.say(&["get", KP]).code == 0).then_some(()), "place for a client");
    let end = session.end();
    assert!(!end.out.contains("changed from") && !end.out.contains("stopped"), "{}", end.out);
}

#[test]
fn a_stop_needs_no_place() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml"]);
    let mut idle = Vec::new();
    let is_full = || {
        idle.extend((0..20).map(|_| UnixStream::connect(session.socket(pid)).unwrap()));
        (session.say(&["get", KP]).code != 0).then_some(())
    };
    wait_for(is_full, "refusal");
    // A client without a place gets a message, and its connection is closed after a moment.
    let stopped = wait_for(|| Some(session.say(&["send", "stop"])).filter(|said| said.code == 0), "place for a stop");
    assert!(stopped.out.contains("stop"), "{}", stopped.out);
    let end = finish(session.runs.remove(0));
    assert!(end.code == 1 && end.err.contains("stop"), "{}", end.err);
}

#[test]
fn what_a_dead_process_leaves_is_removed() {
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml"]);
    let folder = std::fs::metadata(session.folder.path().join("tactflow")).unwrap();
    let socket = std::fs::metadata(session.socket(pid)).unwrap();
    assert_eq!((folder.permissions().mode() & 0o777, socket.permissions().mode() & 0o777), (0o700, 0o600));
    session.runs[0].kill().unwrap();
    session.runs.remove(0).wait().unwrap();
    assert!(session.socket(pid).exists());
    assert!(session.print(&["ps"]).contains("no graph runs"));
    assert!(!session.socket(pid).exists());
    // A run that ends by itself leaves nothing.
    session.run(&["graphs/hybrid.toml", "--for", "0.2s"]);
    let end = finish(session.runs.remove(0));
    assert_eq!(end.code, 0, "{}", end.err);
    assert_eq!(std::fs::read_dir(session.folder.path().join("tactflow")).unwrap().count(), 0);
    // A folder that others can open is not used.
    std::fs::set_permissions(session.folder.path().join("tactflow"), PermissionsExt::from_mode(0o755)).unwrap();
    let open = session.say(&["ps"]);
    assert!(open.code == 2 && open.err.contains("close it with `chmod 700"), "{}", open.err);
    let run = session.say(&["run", "graphs/hybrid.toml", "--realtime", "--for", "0.1s"]);
    assert!(run.code == 0 && run.err.contains("other processes cannot reach this run"), "{}", run.err);
}

#[test]
fn another_user_gets_nothing() {
    /// The user `nobody`.
    const NOBODY: u32 = 65_534;
    if !nix::unistd::Uid::effective().is_root() {
        std::io::stderr().write_all(b"skipped: only root can start a process of another user\n").unwrap();
        return;
    }
    let mut session = Session::new();
    let pid = session.run(&["graphs/hybrid.toml"]);
    // The checkout may be in a folder that only its owner can enter.
    let entered = tempfile::tempdir().unwrap();
    std::fs::set_permissions(entered.path(), PermissionsExt::from_mode(0o755)).unwrap();
    let program = entered.path().join("suite");
    let own = std::env::current_exe().unwrap();
    std::fs::hard_link(&own, &program).or_else(|_| std::fs::copy(&own, &program).map(drop)).unwrap();
    let tries = || {
        let mut other = Command::new(&program);
        other.args(["--exact", "socket::as_another_user", "--ignored", "--nocapture"]);
        other.env("TACTFLOW_SOCKET", session.socket(pid)).current_dir("/");
        std::os::unix::process::CommandExt::uid(&mut other, NOBODY);
        let output = other.output().unwrap();
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let closed = tries();
    assert!(closed.contains("cannot connect: PermissionDenied"), "{closed}");
    // With every file open to everybody, the run still does not talk to them.
    let open = |path: PathBuf| std::fs::set_permissions(path, PermissionsExt::from_mode(0o777)).unwrap();
    open(session.folder.path().to_owned());
    open(session.folder.path().join("tactflow"));
    open(session.socket(pid));
    let refused = tries();
    assert!(refused.contains("connected, and got 0 bytes"), "{refused}");
    let mut own = session.connect(pid);
    assert!(ask(&mut own, r#"{"ask":"about"}"#)["ok"]["pid"] == json!(pid), "its own user still reaches it");
}

/// What a process of another user tries; only of use to the test above.
#[test]
#[ignore = "run by `another_user_gets_nothing` in a process of its own"]
fn as_another_user() {
    let path = std::env::var("TACTFLOW_SOCKET").expect("run by another test");
    let said = match UnixStream::connect(path) {
        Err(error) => format!("cannot connect: {:?}\n", error.kind()),
        Ok(mut stream) => {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
            let _ = stream.write_all(b"{\"ask\":\"send\",\"word\":\"stop\"}\n");
            let mut answer = Vec::new();
            let _ = stream.read_to_end(&mut answer);
            format!("connected, and got {} bytes\n", answer.len())
        }
    };
    std::io::stdout().write_all(said.as_bytes()).unwrap();
}

/// Copies the hybrid task to a folder, so that it can be changed.
fn copied(folder: &TempDir) -> PathBuf {
    let graphs = workspace().join("graphs").display().to_string();
    let text = std::fs::read_to_string(workspace().join("graphs/hybrid.toml")).unwrap();
    let text =
        text.replace("\"parts/", &format!("\"{graphs}/parts/")).replace("\"benches/", &format!("\"{graphs}/benches/"));
    let path = folder.path().join("mine.toml");
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_saved_value_is_the_only_change_of_the_file() {
    let mut session = Session::new();
    let path = copied(&session.folder);
    let graph = path.to_str().unwrap();
    let before = std::fs::read_to_string(&path).unwrap();
    session.run(&[graph]);
    let refused = session.say(&["set", "pid.gains.y.kp=9", "--save"]);
    assert_eq!(refused.code, 2);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), before);
    let saved = session.print(&["set", "pid.gains.y.kp=3.25", "--save"]);
    assert!(saved.contains("saved nodes.pid.gains.y.kp = 3.25 (before: 4) to "), "{saved}");
    let after = std::fs::read_to_string(&path).unwrap();
    let changed: Vec<(&str, &str)> = before.lines().zip(after.lines()).filter(|(old, new)| old != new).collect();
    let [(old, new)] = changed[..] else { panic!("{changed:?}") };
    assert_eq!(new, old.replace("kp = 4.0", "kp = 3.25"));
    assert_eq!(before.lines().count(), after.lines().count());
    session.end();
    session.print(&["check", graph]);
    // A value that the file does not have any more, or that is not of the file.
    session.run(&[graph, "--set", "nodes.pid.gains.y.kp=5"]);
    let of_command = session.say(&["set", "pid.gains.y.kp=3", "--save"]);
    assert!(of_command.code == 2 && of_command.err.contains("comes from `--set` of the run"), "{}", of_command.err);
    assert!(session.print(&["get", KP]).contains(" 5 "), "nothing has changed");
    session.end();
    session.run(&[graph]);
    std::fs::write(&path, after.replace(new, "")).unwrap();
    let gone = session.say(&["set", "pid.gains.y.kp=3", "--save"]);
    assert!(gone.code == 2 && gone.err.contains("has no number at `nodes.pid.gains.y.kp` any more"), "{}", gone.err);
}

#[test]
fn the_program_of_the_page_runs() {
    let page = std::fs::read_to_string(workspace().join("docs/live.md")).unwrap();
    let (_, program) = page.split_once("```python\n").unwrap();
    let (program, _) = program.split_once("```").unwrap();
    let mut session = Session::new();
    session.run(&["graphs/hybrid.toml"]);
    wait_for(|| (session.about()["tasks"][0]["mode"] == json!("servo")).then_some(()), "mode servo");
    let mut python = Command::new("python3");
    let ran = said(python.args(["-c", program]).env("XDG_RUNTIME_DIR", session.folder.path()));
    assert_eq!((ran.code, ran.err.as_str()), (0, ""), "{}", ran.out);
    assert!(ran.out.starts_with("pid.gains.y.kp from 4.0 to 3.5\n"), "{}", ran.out);
    assert!(ran.out.lines().count() > 20, "{}", ran.out);
}

/// Names of the limits that have reduced the motion, from the summary of a run.
fn limits(summary: &str) -> Vec<String> {
    let table = summary.lines().skip_while(|line| !line.starts_with("limited by")).skip(1);
    table.take_while(|line| line.contains('%')).filter_map(|line| Some(line.split(' ').next()?.to_owned())).collect()
}

#[test]
fn random_changes_in_contact_neither_jump_nor_touch_another_limit() {
    /// Time at which a run is ended and another one is started: the bench of the graph ends at 22 s.
    const MAX_TIME_S: f64 = 15.0;
    let count: usize = std::env::var("TACTFLOW_SETS").map_or(40, |count| count.parse().expect("a number"));
    let (mut random, mut left, mut moved) = (Random::new(18, 2), count, 0.0);
    while left > 0 {
        let mut session = Session::new();
        let pid = session.run(&["graphs/hybrid.toml"]);
        wait_for(|| (session.about()["tasks"][0]["mode"] == json!("servo")).then_some(()), "mode servo");
        let (mut setter, mut getter) = (session.connect(pid), session.connect(pid));
        let mut last = (0.0, None::<f64>);
        while left > 0 && last.0 < MAX_TIME_S {
            left -= 1;
            let value = random.uniform(0.5, 6.0);
            let answer = ask(&mut setter, &json!({"ask": "set", "values": {KP: value}}).to_string());
            assert_eq!(answer["ok"][0]["to"], json!(value), "{answer}");
            for _ in 0..4 {
                let got = ask(&mut getter, &json!({"ask": "get", "pattern": KP}).to_string());
                let (t, kp) = (got["ok"]["t"].as_f64().unwrap(), got["ok"]["live"][0]["value"].as_f64().unwrap());
                if let (before, Some(old)) = last {
                    assert!((kp - old).abs() <= 2.0 * (t - before) + 1e-9, "{old} to {kp} in {} s", t - before);
                    moved += (kp - old).abs();
                }
                last = (t, Some(kp));
            }
        }
        let end = session.end();
        assert!(!end.out.contains("commands stopped") && !end.out.contains("commands held"), "{}", end.out);
        let plain = session.print(&["run", "graphs/hybrid.toml", "--for", &format!("{}s", last.0 + 1.0)]);
        let (touched, allowed) = (limits(&end.out), limits(&plain));
        assert!(!allowed.is_empty(), "{plain}");
        let is_allowed = |limit: &String| allowed.contains(limit);
        assert!(touched.iter().all(is_allowed), "{touched:?}, and without changes {allowed:?}");
    }
    assert!(moved > 0.5, "the gain has moved by {moved} in all");
}
