//! `run --watch`: a run in virtual time begins again when a file of its graph is saved.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::Child;
use std::thread::sleep;
use std::time::{Duration, Instant};

use tempfile::TempDir;

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
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("graph.toml"), graph).unwrap();
        fs::write(folder.path().join("touch.toml"), PART).unwrap();
        let [out, err] = ["out", "err"].map(|name| File::create(folder.path().join(name)).unwrap());
        let graph = folder.path().join("graph.toml");
        let child = tool(&["run", graph.to_str().unwrap(), "--watch"]).stdout(out).stderr(err).spawn().unwrap();
        Self { folder, child }
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

#[test]
fn a_run_in_real_time_is_not_exchanged() {
    let said = say(&["run", "graphs/hybrid.toml", "--watch", "--realtime"]);
    assert!(said.code == 2 && said.err.contains("'--watch' cannot be used with"), "{}", said.err);
}
