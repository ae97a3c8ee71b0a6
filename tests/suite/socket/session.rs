//! A user's session: the folder of the sockets, the graphs that run, and the commands for them.

use std::io::BufReader;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use crate::tool::{Said, said, tool};

/// Longest wait for a process or an answer.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// A user's session: the folder of the sockets, and the graphs that run.
pub(crate) struct Session {
    pub(crate) folder: TempDir,
    pub(crate) runs: Vec<Child>,
}

impl Session {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap(), runs: Vec::new() }
    }

    pub(crate) fn tool(&self, args: &[&str]) -> Command {
        let mut command = tool(args);
        command.env("XDG_RUNTIME_DIR", self.folder.path());
        command
    }

    pub(crate) fn say(&self, args: &[&str]) -> Said {
        said(&mut self.tool(args))
    }

    /// Runs a command that must succeed, and returns what it prints.
    pub(crate) fn print(&self, args: &[&str]) -> String {
        let said = self.say(args);
        assert_eq!(said.code, 0, "{args:?}: {}{}", said.out, said.err);
        said.out
    }

    /// Starts a graph in real time, and waits for its socket. Returns the number of its process.
    pub(crate) fn run(&mut self, args: &[&str]) -> u32 {
        let mut command = self.tool(&[&["run"], args, &["--realtime"]].concat());
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let pid = child.id();
        self.runs.push(child);
        wait_for(|| self.socket(pid).exists().then_some(()), "the socket");
        pid
    }

    pub(crate) fn socket(&self, pid: u32) -> PathBuf {
        self.folder.path().join(format!("tactflow/{pid}.sock"))
    }

    /// Ends the first graph as Ctrl-C does, and returns what it has said.
    pub(crate) fn end(&mut self) -> Said {
        let child = self.runs.remove(0);
        let pid = nix::unistd::Pid::from_raw(child.id().try_into().unwrap());
        nix::sys::signal::kill(pid, nix::sys::signal::Signal::SIGINT).unwrap();
        finish(child)
    }

    pub(crate) fn connect(&self, pid: u32) -> BufReader<UnixStream> {
        let stream = UnixStream::connect(self.socket(pid)).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        BufReader::new(stream)
    }

    pub(crate) fn about(&self) -> Value {
        let all: Value = serde_json::from_str(&self.print(&["ps", "--format", "json"])).unwrap();
        all[0].clone()
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        for mut child in self.runs.drain(..) {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

pub(crate) fn finish(child: Child) -> Said {
    let output = child.wait_with_output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    Said { code: output.status.code().unwrap_or(-1), out: text(output.stdout), err: text(output.stderr) }
}

pub(crate) fn wait_for<T>(mut look: impl FnMut() -> Option<T>, what: &str) -> T {
    let begin = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(begin.elapsed() < PATIENCE, "no {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}
