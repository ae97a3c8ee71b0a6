//! A peer in another process: a script of `tests/peers` that prints what happens as lines of JSON, and may read words.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, UdpSocket};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;
use tactflow_tests::workspace;

/// Long enough for a machine that is five times slower, and busy.
pub(crate) const SOON: Duration = Duration::from_secs(20);

/// The process, which ends with its test.
pub(crate) struct Process {
    child: Child,
    words: ChildStdin,
    said: Arc<Mutex<Vec<Value>>>,
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Process {
    /// Starts a script.
    pub(crate) fn start<'a>(script: &str, args: impl IntoIterator<Item = &'a str>) -> Self {
        let mut command = Command::new("python3");
        command.arg(workspace().join("tests/peers").join(script)).args(args);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("python3 is there");
        let words = child.stdin.take().unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let said = Arc::new(Mutex::new(Vec::new()));
        let heard = Arc::clone(&said);
        thread::spawn(move || {
            for line in lines.map_while(Result::ok) {
                let line = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line}"));
                heard.lock().unwrap().push(line);
            }
        });
        Self { child, words, said }
    }

    /// The number of the process.
    #[cfg(feature = "ros2")]
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Says a line to the script.
    pub(crate) fn say(&mut self, line: &str) {
        writeln!(self.words, "{line}").unwrap();
    }

    /// Returns how many lines it has said.
    pub(crate) fn count(&self) -> usize {
        self.said.lock().unwrap().len()
    }

    /// Returns what it has said, from the line with a number on.
    pub(crate) fn said(&self, from: usize) -> Vec<Value> {
        self.said.lock().unwrap()[from..].to_vec()
    }

    /// Whether it has said something.
    pub(crate) fn has_said(&self, is_it: impl Fn(&Value) -> bool) -> bool {
        self.said.lock().unwrap().iter().any(is_it)
    }

    /// Waits until it says something, and returns that. Lines before the one with a number do not count.
    pub(crate) fn wait(&self, from: usize, is_it: impl Fn(&Value) -> bool) -> Value {
        let (end, mut seen) = (Instant::now() + SOON, from);
        loop {
            let said = self.said(seen);
            seen += said.len();
            if let Some(found) = said.into_iter().find(&is_it) {
                return found;
            }
            let last = self.said(self.count().saturating_sub(5));
            assert!(Instant::now() < end, "it does not happen; the last lines are {last:?}");
            thread::sleep(Duration::from_millis(2));
        }
    }
}

/// Returns a UDP port that nobody uses.
pub(crate) fn free_udp_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Returns a TCP port that nobody uses.
pub(crate) fn free_tcp_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}
