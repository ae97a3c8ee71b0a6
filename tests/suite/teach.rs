//! `tactflow teach` against a controller in another process whose arm a person moves.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::UdpSocket;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactflow_tests::workspace;
use tempfile::TempDir;

use crate::cli::in_new_folder;
use crate::tool::{say, tool};

const SOON: Duration = Duration::from_secs(20);

/// A bench with a pad that is 30 mm in front of the flange.
const BENCH: &str = "# My cell.
[bind]
arm = \"arm\"                         # a KUKA LWR
pad = \"pad\"

[devices.pad]
type = \"mock_pad\"
mount = { xyz = [0.0, 0.0, 0.03] }

[devices.arm]
type = \"lwr_fri\"
robot = \"builtin:lwr4p.toml\"
port = PORT                         # of this machine

[limits]
workspace_min_m = [-0.9, -0.9, -0.2] # yours
workspace_max_m = [0.9, 0.9, 1.2]
keep_out = [[1.0, 0.0, 0.0, -0.85]]
";

/// A controller, and a person at the tool and at the arm.
struct Person {
    peer: Child,
    peer_in: Option<ChildStdin>,
    said: Receiver<Value>,
    child: Child,
    child_in: Option<ChildStdin>,
    out: Arc<Mutex<String>>,
    path: String,
    before: String,
    _folder: TempDir,
}

fn collect(mut stream: impl Read + Send + 'static, into: &Arc<Mutex<String>>) {
    let into = into.clone();
    thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            into.lock().unwrap().push_str(&String::from_utf8_lossy(&bytes[..length]));
        }
    });
}

impl Person {
    fn teach(args: &[&str]) -> Self {
        Self::teach_bench(BENCH, args)
    }

    /// Teaches a bench whose port is `PORT`.
    fn teach_bench(bench: &str, args: &[&str]) -> Self {
        let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut peer = Command::new("python3")
            .arg(workspace().join("tests/peers/lwr.py"))
            .args(["--port", &port.to_string(), "--seconds", "120", "--guided", "--sag", "0"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("python3 is there");
        let (sender, said) = channel();
        let lines = BufReader::new(peer.stdout.take().unwrap()).lines();
        thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let _ = sender.send(serde_json::from_str(&line).expect("JSON"));
            }
        });
        let (folder, path) = in_new_folder("cell.toml");
        let before = bench.replace("PORT", &port.to_string());
        fs::write(&path, &before).unwrap();
        let mut command = tool(&[&["teach", &path], args].concat());
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let out = Arc::new(Mutex::new(String::new()));
        collect(child.stdout.take().unwrap(), &out);
        collect(child.stderr.take().unwrap(), &out);
        let (peer_in, child_in) = (peer.stdin.take(), child.stdin.take());
        Self { peer, peer_in, said, child, child_in, out, path, before, _folder: folder }
    }

    fn out(&self) -> String {
        self.out.lock().unwrap().clone()
    }

    /// Waits until the tool prints one of some texts after `from`, and returns which.
    fn wait(&self, from: usize, texts: &[&str]) -> usize {
        let end = Instant::now() + SOON;
        loop {
            let out = self.out();
            if let Some(found) = texts.iter().position(|text| out[from..].contains(text)) {
                return found;
            }
            assert!(Instant::now() < end, "none of {texts:?} in {out}");
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Types a line after the tool has asked for it.
    fn types(&mut self, question: &str, line: &str) -> usize {
        self.wait(0, &[question]);
        let from = self.out().len();
        writeln!(self.child_in.as_mut().unwrap(), "{line}").unwrap();
        from
    }

    /// Does something with the arm.
    fn tell(&mut self, line: &str) {
        writeln!(self.peer_in.as_mut().unwrap(), "{line}").unwrap();
        let end = Instant::now() + SOON;
        while Instant::now() < end {
            if self.said.recv_timeout(SOON).expect("it says what it did")["event"] == "told" {
                return;
            }
        }
        panic!("the controller does not hear");
    }

    /// Moves the arm to a posture and measures it there. The first samples may be those from before the motion.
    fn measures(&mut self, question: &str, joints: [f64; 7]) -> [f64; 3] {
        let from = self.shows(question, joints, "  measured, at [");
        self.wait(from, &["] m\n"]);
        let out = self.out();
        let list = out[from..].split("measured, at [").nth(1).unwrap().split(']').next().unwrap();
        let place: Vec<f64> = list.split(", ").map(|number| number.parse().unwrap()).collect();
        place.try_into().unwrap()
    }

    /// Moves the arm to a posture, and presses Enter until the tool prints that it has measured it. Returns the place of
    /// its answer.
    fn shows(&mut self, question: &str, joints: [f64; 7], answer: &str) -> usize {
        self.tell(&format!("move {}", joints.map(|q| q.to_string()).join(" ")));
        loop {
            let from = self.types(question, "");
            if self.wait(from, &[answer, "  not measured"]) == 0 {
                return from;
            }
        }
    }

    /// Waits for the end. The arm has got no answer, and so no motion. Returns the exit code, and the bench.
    fn ends(mut self) -> (i32, String, String) {
        self.child_in.take();
        let code = self.child.wait().unwrap().code().expect("it ends by itself");
        self.peer_in.take();
        let seen = std::iter::from_fn(|| self.said.recv_timeout(SOON).ok()).find(|said| said["event"] == "end");
        let seen = seen.expect("the controller ends too");
        assert_eq!((&seen["answers"], &seen["commands"]), (&Value::from(0), &Value::from(0)), "{seen}");
        assert_ne!(seen["sent"], 0);
        let (out, bench) = (self.out(), fs::read_to_string(&self.path).unwrap());
        (code, out, bench)
    }
}

impl Drop for Person {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = self.peer.kill();
        let _ = self.peer.wait();
    }
}

const HOME: [f64; 7] = [0.0, 0.3, 0.0, -1.3, 0.0, 1.3, 0.0];
const START: [f64; 7] = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0];

/// Postures on a circle about the vertical axis of the base: their points have one height.
fn round(turn: f64) -> [f64; 7] {
    [turn, 0.8, 0.0, -1.3, 0.0, 1.3, 0.0]
}

#[test]
fn a_cell_is_taught_by_hand_and_loads() {
    let mut person = Person::teach(&["--clearance", "4", "--margin", "10"]);
    person.measures("home: guide", HOME);
    person.measures("start: guide", START);
    person.types("workspace: visit", "done");
    person.wait(0, &["a box needs two points, not 0"]);
    let mut corners = Vec::new();
    for (i, joints) in
        [[-0.6, 0.2, 0.0, -1.0, 0.0, 1.3, 0.0], [0.6, 0.9, 0.0, -1.5, 0.0, 1.3, 0.0]].into_iter().enumerate()
    {
        corners.push(person.measures(&format!("`s` skips. Point {}:", i + 1), joints));
    }
    person.types("`s` skips. Point 3:", "done");
    // Two points nearly on a line with the third one are refused, until one is farther from it.
    let mut places = Vec::new();
    for (i, turn) in [-0.5, -0.02, 0.0].into_iter().enumerate() {
        places.push(person.measures(&format!("plane 1: touch it in three points or more, far apart. Enter adds a point, `done` ends the plane, `s` ends the planes. Point {}:", i + 1), round(turn)));
    }
    let planes = "`s` ends the planes. Point";
    person.measures(&format!("{planes} 4:"), round(0.5));
    person.types(&format!("{planes} 5:"), "done");
    person.wait(0, &["the side of home is free: "]);
    person.types("keep-out plane 2: touch", "s");
    person.types("`keep_out` of the bench has rows already: 1.", "keep");
    person.types("Type `yes` to write these lines", "yes");
    person.wait(0, &["wrote "]);
    let path = person.path.clone();
    let before = person.before.clone();
    // The arm has never got an answer, and so no motion.
    person.tell("quiet");
    let check = say(&["check", "graphs/hybrid.toml", "--bench", &path]);
    assert_eq!(check.code, 0, "{}{}", check.out, check.err);
    let (code, out, bench) = person.ends();
    assert_eq!(code, 0, "{out}");
    assert!(out.contains("Points are those of the origin of `pad`, which is at [0.0, 0.0, 0.03] m"), "{out}");
    let kept = |line: &str| bench.contains(line) && before.contains(line);
    assert!(kept("# My cell.\n") && kept("# a KUKA LWR\n") && kept("# of this machine\n"), "{bench}");
    let bench: toml::Table = bench.parse().unwrap();
    let list = |value: &toml::Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_float().unwrap()).collect()
    };
    // The controller sends single precision.
    let near = |found: &[f64], wanted: &[f64], error: f64| {
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < error), "{found:?}, not {wanted:?}");
    };
    near(&list(&bench["devices"]["arm"]["home"]), &HOME, 1e-4);
    near(&list(&bench["devices"]["arm"]["start"]), &START, 1e-4);
    for (key, outer, margin) in
        [("workspace_min_m", f64::min as fn(f64, f64) -> f64, -0.01), ("workspace_max_m", f64::max, 0.01)]
    {
        let corner = [0, 1, 2].map(|axis| outer(corners[0][axis], corners[1][axis]) + margin);
        near(&list(&bench["limits"][key]), &corner, 1.1e-4);
    }
    let rows = bench["limits"]["keep_out"].as_array().unwrap();
    assert_eq!((rows.len(), list(&rows[0])), (2, vec![1.0, 0.0, 0.0, -0.85]));
    // A horizontal plane, 4 mm above or below the points, on the side of home.
    let row = list(&rows[1]);
    near(&row[..2], &[0.0, 0.0], 1e-3);
    let height = places[0][2];
    near(&[row[2].abs(), row[3]], &[1.0, row[2] * height + 0.004], 5e-4);
    let start = out.split("measured, at [").nth(1).unwrap().split(']').next().unwrap();
    let home_z: f64 = start.split(", ").nth(2).unwrap().parse().unwrap();
    assert!(row[2] * (home_z - height) > 0.01, "home at {home_z} m is on the free side of {row:?}");
}

#[test]
fn a_posture_that_cannot_be_is_refused_and_a_no_writes_nothing() {
    let mut person = Person::teach(&["--only", "home,start", "--sensor", "none"]);
    person.tell("drift 0.2");
    let from = person.types("home: guide", "");
    person.wait(from, &["not measured: joint `lwr_a1_joint` moved by"]);
    person.tell("move 0.0 2.5 0.0 -1.3 0.0 1.3 0.0");
    thread::sleep(Duration::from_millis(300));
    let from = person.types("home: guide", "");
    person.wait(from, &["not measured: joint `lwr_a2_joint` is at 2.5000 rad, outside of its range"]);
    let from = person.types("home: guide", "perhaps");
    person.wait(from, &["`perhaps` is no answer here: Enter measures, `s` skips\n"]);
    person.measures("home: guide", HOME);
    person.tell("quiet");
    thread::sleep(Duration::from_millis(300));
    let from = person.types("start: guide", "");
    person.wait(from, &["not measured: the arm sent 0 positions"]);
    person.types("start: guide", "s");
    let from = person.types("Type `yes` to write these lines", "no");
    person.wait(from, &["nothing is written"]);
    let before = person.before.clone();
    let (code, out, bench) = person.ends();
    assert_eq!((code, bench), (0, before), "{out}");
    assert!(out.contains("Points are those of the tip of `arm`."), "{out}");
    assert!(out.contains("\n[devices.arm]\nhome = [0.0, 0.3, 0.0, -1.3, 0.0, 1.3, 0.0]\n"), "{out}");
    assert!(!out.contains("workspace: visit") && !out.contains("keep-out plane"), "{out}");
}

#[test]
fn ctrl_c_and_the_end_of_the_input_write_nothing() {
    for is_signal in [true, false] {
        let mut person = Person::teach(&["--only", "home"]);
        person.measures("home: guide", HOME);
        person.wait(0, &["Type `yes` to write these lines"]);
        if is_signal {
            let kill = Command::new("kill").args(["-INT", &person.child.id().to_string()]).status().unwrap();
            assert!(kill.success());
            person.wait(0, &["nothing is written"]);
        }
        let before = person.before.clone();
        let (code, out, bench) = person.ends();
        assert_eq!((code, bench), (if is_signal { 130 } else { 1 }, before), "{out}");
    }
}

#[test]
fn a_bench_without_an_arm_to_guide_is_refused() {
    let said = say(&["teach", "graphs/benches/ball.toml"]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("device `bench` runs step by step with a graph, so nobody can guide it"), "{}", said.err);
    let said = say(&["teach", "graphs/benches/lwr_fri.toml", "--only", "nothing"]);
    assert_eq!(said.code, 2, "{}", said.err);
}

#[test]
fn an_arm_of_two_roles_is_one_arm_and_comments_in_the_list_stay() {
    let bench = BENCH.replace("pad = \"pad\"\n", "wrist = \"arm\"\npad = \"pad\"\n").replace(
        "keep_out = [[1.0, 0.0, 0.0, -0.85]]",
        "keep_out = [\n  # the wall\n  [1.0, 0.0, 0.0, -0.85], # of brick\n]",
    );
    let mut person = Person::teach_bench(&bench, &["--only", "keep-out"]);
    for (i, turn) in [-0.5, 0.0, 0.5].into_iter().enumerate() {
        person.measures(&format!("`s` ends the planes. Point {}:", i + 1), round(turn));
    }
    person.types("`s` ends the planes. Point 4:", "done");
    // The home of the robot file was not chosen for this cell.
    person.shows("guide the arm to the free side", HOME, "this side is free: ");
    person.types("keep-out plane 2: touch", "s");
    person.types("`keep_out` of the bench has rows already: 1.", "keep");
    person.types("Type `yes` to write these lines", "yes");
    person.wait(0, &["wrote "]);
    let (code, out, after) = person.ends();
    assert_eq!(code, 0, "{out}");
    assert!(after.contains("keep_out = [\n  # the wall\n  [1.0, 0.0, 0.0, -0.85], # of brick\n  ["), "{after}");
    assert!(!after.contains("[limits."), "{after}");
    assert!(!out.contains("the side of home is free"), "{out}");
}

#[test]
fn several_pads_of_one_arm_are_explained() {
    let bench = BENCH
        .replace("pad = \"pad\"\n", "pad = \"pad\"\nfingertip = \"tip_pad\"\n")
        .replace("[limits]", "[devices.tip_pad]\ntype = \"mock_pad\"\n\n[limits]");
    let mut person = Person::teach_bench(&bench, &["--only", "home", "--sensor", "pad"]);
    person.wait(0, &["keeps only the origin of its first pad in the workspace and before the planes"]);
    person.types("home: guide", "s");
    let (code, out, after) = person.ends();
    assert_eq!(code, 0, "{out}");
    assert!(after.contains("tip_pad") && out.contains("nothing was measured"), "{out}");
}

#[test]
fn with_several_arms_the_pad_must_be_named() {
    let ports = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    let ports = ports.map(|socket| socket.local_addr().unwrap().port().to_string());
    let second =
        format!("[devices.other]\ntype = \"lwr_fri\"\nrobot = \"builtin:lwr4p.toml\"\nport = {}\n\n", ports[1]);
    let bench = BENCH
        .replace("PORT", &ports[0])
        .replace("pad = \"pad\"\n", "right_arm = \"other\"\npad = \"pad\"\n")
        .replace("[limits]", &format!("{second}[limits]"));
    let (_folder, path) = in_new_folder("cell.toml");
    fs::write(&path, bench).unwrap();
    let said = say(&["teach", &path, "--arm", "right_arm"]);
    assert_eq!(said.code, 2, "{}", said.err);
    assert!(said.err.contains("the bench binds several arms") && said.err.contains("`--sensor pad`"), "{}", said.err);
}
