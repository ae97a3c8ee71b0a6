//! `run --watch`: a run begins again when a file of its graph is saved, in real time only halted, at rest and untouched.

use std::fs::{self, File};
use std::io::Write;
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tactflow_tests::workspace;
use tempfile::TempDir;

use crate::control_law::rows;
use crate::tool::{say, tool};

/// Time in which something must happen.
const SOON: Duration = Duration::from_secs(20);

const GRAPH: &str = r#"
graph.clock = "pad"
roles.pad = "tactile_pad"
bind.pad = "pad"
[devices.pad]
type = "mock_pad"
for_s = 0.4
press = [{ force = 4.0 }]
[parts.touch]
file = "touch.toml"
in.image = "pad.image"
"#;

const PART: &str = r#"
[inputs]
image = "the image of a pad"
[exports]
sum = "source.sum"
[nodes.source]
type = "tactile_source"
in.image = "inputs.image"
"#;

/// A run with `--watch` in a folder of its own.
struct Watched {
    folder: TempDir,
    child: Child,
}

impl Watched {
    fn start(graph: &str) -> Self {
        Self::start_with(graph, &[])
    }

    /// Starts it with more arguments.
    fn start_with(graph: &str, args: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("graph.toml"), graph).unwrap();
        fs::write(folder.path().join("touch.toml"), PART).unwrap();
        let [out, err] = ["out", "err"].map(|name| File::create(folder.path().join(name)).unwrap());
        let graph = folder.path().join("graph.toml");
        let mut command = tool(&["run", graph.to_str().unwrap(), "--watch"]);
        command.args(args).args(["--out", folder.path().join("run.csv").to_str().unwrap()]);
        let child = command.stdin(Stdio::piped()).stdout(out).stderr(err).spawn().unwrap();
        Self { folder, child }
    }

    /// Types a line.
    fn say(&mut self, word: &str) {
        writeln!(self.child.stdin.as_mut().unwrap(), "{word}").unwrap();
    }

    /// Saves the graph.
    fn save(&self, graph: &str) {
        fs::write(self.path("graph.toml"), graph).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    /// Waits until a text is there that many times.
    fn wait(&self, name: &str, text: &str, times: usize) {
        let end = Instant::now() + SOON;
        while self.text(name).matches(text).count() < times {
            assert!(Instant::now() < end, "no `{text}`: {}{}", self.text("out"), self.text("err"));
            sleep(Duration::from_millis(5));
        }
    }

    /// Ends it as Ctrl-C does. Returns its exit code.
    fn end(&mut self) -> Option<i32> {
        let pid = self.child.id().to_string();
        assert!(std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        let end = Instant::now() + SOON;
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.code();
            }
            assert!(Instant::now() < end, "it does not end");
            sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

const ENDED: &str = "a device has no more samples after ";

#[test]
fn a_saved_file_is_checked_and_run_again() {
    let mut watched = Watched::start(GRAPH);
    watched.wait("err", "waiting until a file of the graph is saved", 1);
    watched.wait("out", ENDED, 1);
    // A mistake has its place, and nothing runs.
    fs::write(watched.path("graph.toml"), GRAPH.replace("pad.image", "pad.imag")).unwrap();
    watched.wait("err", "`pad` has no output `imag`", 1);
    watched.wait("err", "waiting until a file of the graph is saved", 2);
    // A file that replaces the old one, as many editors write it.
    fs::write(watched.path("new"), GRAPH.replace("0.4", "0.8")).unwrap();
    fs::rename(watched.path("new"), watched.path("graph.toml")).unwrap();
    watched.wait("out", "after 0.796 s", 1);
    // A part, which is gone for a moment.
    fs::remove_file(watched.path("touch.toml")).unwrap();
    sleep(Duration::from_millis(500));
    assert_eq!(watched.text("out").matches(ENDED).count(), 2);
    fs::write(watched.path("touch.toml"), format!("# once more\n{PART}")).unwrap();
    watched.wait("out", ENDED, 3);
    watched.wait("err", "touch.toml` was saved", 1);
    // Many saves are one run, or a few.
    for i in 0..100 {
        fs::write(watched.path("graph.toml"), GRAPH.replace("0.4", &format!("0.{:03}", 400 + i))).unwrap();
    }
    watched.wait("out", "after 0.496 s", 1);
    assert!(watched.text("out").matches(ENDED).count() < 20, "{}", watched.text("out"));
    assert_eq!(watched.end(), Some(0));
}

#[test]
fn a_run_that_is_under_way_begins_again() {
    let mut watched = Watched::start(&GRAPH.replace("for_s = 0.4", "for_s = 1e6"));
    watched.wait("out", "one tick every", 1);
    fs::write(watched.path("graph.toml"), GRAPH).unwrap();
    watched.wait("out", "after 0.396 s", 1);
    assert_eq!(watched.end(), Some(0));
}

#[test]
fn a_run_that_never_loads_ends_with_its_code() {
    let mut watched = Watched::start("graph.clok = 'pad'");
    watched.wait("err", "waiting until a file of the graph is saved", 1);
    assert_eq!(watched.end(), Some(2));
}

/// The hybrid task on its bench, where it finds its files from any folder.
fn hybrid() -> String {
    let graphs = workspace().join("graphs");
    let text = fs::read_to_string(graphs.join("hybrid.toml")).unwrap();
    ["parts", "benches"].iter().fold(text, |text, folder| {
        text.replace(&format!("\"{folder}/"), &format!("\"{}/", graphs.join(folder).display()))
    })
}

/// How far the arm is from where it was at first: time and the largest angle of a joint [rad].
fn ways(watched: &Watched, name: &str) -> Vec<(f64, f64)> {
    let rows = rows(watched.path(name).to_str().unwrap());
    let joints: Vec<&String> = rows[0].keys().filter(|column| column.starts_with("arm.position.")).collect();
    let way = |row: &std::collections::BTreeMap<String, f64>| {
        let angles = joints.iter().map(|joint| (row[*joint] - rows[0][*joint]).abs());
        (row["time"], angles.fold(0.0, f64::max))
    };
    rows.iter().map(way).collect()
}

const REALTIME: [&str; 2] = ["--realtime", "--listen"];
const WAITS: &str =
    "the saved graph has no mistake, and is not loaded before the run is halted, at rest and untouched: ";

#[test]
fn an_arm_gets_another_graph_only_halted_and_the_graph_begins_halted() {
    let mut watched = Watched::start_with(&hybrid(), &REALTIME);
    watched.wait("out", "one tick every", 1);
    // With a mistake, the run goes on.
    watched.save(&hybrid().replace("kp = 3.0", "kpp = 3.0"));
    watched.wait("err", "`kpp` is not a parameter here", 1);
    watched.save(&hybrid().replace("kp = 3.0", "kp = 3.25"));
    watched.wait("err", &format!("{WAITS}the task runs: send `stop` first"), 1);
    assert_eq!(watched.text("out").matches("one tick every").count(), 1, "it runs");
    watched.say("stop");
    watched.wait("err", "nothing moves before `resume` is typed", 1);
    watched.wait("out", "ended for the saved graph", 1);
    watched.wait("out", "one tick every", 2);
    sleep(Duration::from_millis(700));
    watched.say("resume");
    sleep(Duration::from_millis(700));
    assert_eq!(watched.end(), Some(0), "{}", watched.text("err"));
    let first = ways(&watched, "run.csv");
    assert!(first.last().unwrap().1 > 0.005, "it moved");
    let second = ways(&watched, "run-2.csv");
    let start = second.iter().find(|(_, way)| *way > 0.001).unwrap_or_else(|| panic!("`resume` lets it move")).0;
    assert!(start > 0.4, "it moved at {start} s, before `resume`");
    assert!(watched.text("out").contains("the operator resumed"), "{}", watched.text("out"));
}

#[test]
fn a_graph_that_is_mended_begins_halted_too() {
    let mut watched = Watched::start_with(&hybrid().replace("kp = 3.0", "kpp = 3.0"), &REALTIME);
    watched.wait("err", "waiting until a file of the graph is saved", 1);
    watched.save(&hybrid());
    watched.wait("err", "nothing moves before `resume` is typed", 1);
    sleep(Duration::from_millis(700));
    assert_eq!(watched.end(), Some(0), "{}", watched.text("err"));
    assert!(ways(&watched, "run-2.csv").iter().all(|(_, way)| *way < 0.001));
}

#[test]
fn an_arm_in_contact_keeps_its_graph() {
    let mut watched = Watched::start_with(&hybrid(), &REALTIME);
    watched.wait("out", "one tick every", 1);
    sleep(Duration::from_millis(2500));
    watched.say("stop");
    sleep(Duration::from_millis(500));
    watched.save(&hybrid().replace("kp = 3.0", "kp = 3.25"));
    watched.wait("err", &format!("{WAITS}`touch.calibrate`: something touches the pad"), 1);
    sleep(Duration::from_millis(1500));
    let said = watched.text("err");
    assert_eq!(said.matches(WAITS).count(), 1, "once is enough: {said}");
    assert_eq!(watched.text("out").matches("one tick every").count(), 1);
    watched.end();
}

#[test]
fn a_graph_that_moves_nothing_is_exchanged_at_once() {
    let endless = GRAPH.replace("for_s = 0.4", "for_s = 1e6");
    let mut watched = Watched::start_with(&endless, &["--realtime"]);
    watched.wait("out", "one tick every", 1);
    watched.save(&endless.replace("force = 4.0", "force = 2.0"));
    watched.wait("out", "ended for the saved graph", 1);
    watched.wait("out", "one tick every", 2);
    assert_eq!(watched.end(), Some(0));
}

#[test]
fn an_arm_needs_somebody_who_can_type_resume() {
    let said = say(&["run", "graphs/hybrid.toml", "--watch", "--realtime"]);
    assert!(said.code == 2 && said.err.contains("in real time needs `--listen`"), "{}", said.err);
}
