//! The program as a process: its pipes, the frames that it sends, and its end.
//!
//! Three threads serve the pipes, so that a program that neither reads nor writes blocks nobody. The program has a process
//! group of its own, which ends with the run. If this process dies without ending it, a shell that waits at the end of a
//! pipe does.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};

use tokio::sync::mpsc as channel;

use super::launch::Launch;
use super::wire::{self, Frame};

/// Maximum length of the line with the signature [bytes].
const MAX_LINE_BYTES: u64 = 1 << 20;
/// Number of frames that wait for the tool. A program that sends more waits itself.
const MAX_WAITING: usize = 2;
/// Number of messages that wait for the program: the start, and a question.
const MAX_UNSENT: usize = 2;
/// Maximum number of lines of its standard error that are logged.
const MAX_LOGGED: usize = 1000;
/// Time that a program has to end after its standard input has.
const GRACE: Duration = Duration::from_millis(300);

/// What a program sends.
#[derive(Debug)]
pub(super) enum Received {
    /// The line with its signature.
    Line(String),
    Frame(Frame),
    /// What it sends instead.
    Broken(String),
}

/// A program that runs.
pub(super) struct Program {
    child: Child,
    /// Ends the process group when this process dies.
    guard: Option<Child>,
    /// `None` once its standard input has ended.
    input: Option<mpsc::SyncSender<Vec<u8>>>,
    pub(super) received: channel::Receiver<Received>,
    /// The last line of its standard error.
    last_stderr_line: Arc<Mutex<String>>,
}

impl Program {
    /// Starts a program.
    pub(super) fn start(launch: &Launch) -> Result<Self, String> {
        let mut words = launch.command.iter();
        let name = words.next().map(String::as_str).unwrap_or_default();
        let mut command = Command::new(name);
        command.args(words).current_dir(&launch.folder).env("PYTHONUNBUFFERED", "1");
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let folder = launch.folder.display();
        let mut child = command.spawn().map_err(|error| format!("cannot start `{name}` in `{folder}`: {error}"))?;
        let guard = guard(child.id());
        let last_stderr_line = Arc::default();
        let (input, questions) = mpsc::sync_channel(MAX_UNSENT);
        let (say, received) = channel::channel(MAX_WAITING);
        if let (Some(stdin), Some(stdout), Some(stderr)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        {
            let max = wire::max_bytes(&launch.signature);
            let (name, words) = (launch.signature.name.clone(), Arc::clone(&last_stderr_line));
            std::thread::spawn(move || pass_on(stdin, &questions));
            std::thread::spawn(move || listen(stdout, max, &say));
            std::thread::spawn(move || log(stderr, &name, &words));
        }
        Ok(Self { child, guard, input: Some(input), received, last_stderr_line })
    }

    /// Hands over bytes for the program, without waiting.
    ///
    /// # Errors
    /// If it has not read what it got before. That it has ended shows where its frames are received.
    pub(super) fn send(&self, bytes: Vec<u8>) -> Result<(), String> {
        match self.input.as_ref().map(|input| input.try_send(bytes)) {
            Some(Err(mpsc::TrySendError::Full(_))) => Err("it does not read its standard input".to_owned()),
            _ => Ok(()),
        }
    }

    /// Returns how a program has ended whose standard output has ended.
    pub(super) fn exit_message(&mut self) -> String {
        let end = Instant::now() + GRACE;
        let status = loop {
            match self.child.try_wait() {
                Ok(Some(status)) => break Some(status),
                Ok(None) if Instant::now() < end => std::thread::sleep(Duration::from_millis(2)),
                Ok(None) | Err(_) => break None,
            }
        };
        // Its standard error is read by a thread of its own.
        std::thread::sleep(Duration::from_millis(20));
        let words = self.last_stderr_line.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let how =
            status.map_or_else(|| "it closed its standard output".to_owned(), |status| format!("it ended: {status}"));
        if words.is_empty() { how } else { format!("{how}; it said `{words}`") }
    }

    /// Ends the standard input of the program, so that it ends by itself.
    pub(super) fn dismiss(&mut self) {
        self.input = None;
        let end = Instant::now() + GRACE;
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // The number of a group is taken until its last process has ended, also when the program itself has.
        #[cfg(unix)]
        if let Ok(group) = i32::try_from(self.child.id()) {
            // A group without a process is gone already.
            let _ = nix::sys::signal::killpg(nix::unistd::Pid::from_raw(group), nix::sys::signal::Signal::SIGKILL);
        }
        for child in std::iter::once(&mut self.child).chain(&mut self.guard) {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// Starts a shell that waits for the end of this process, whatever ends it, and then ends a process group.
#[cfg(unix)]
fn guard(group: u32) -> Option<Child> {
    let mut command = Command::new("sh");
    command.args(["-c", "read line; kill -s KILL -- \"-$0\"", &group.to_string()]);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    let started = command.spawn();
    if let Err(error) = &started {
        tracing::warn!(
            "cannot start `sh`: {error}; if this tool is killed, the program may go on until its input ends"
        );
    }
    started.ok()
}

#[cfg(not(unix))]
fn guard(_: u32) -> Option<Child> {
    None
}

fn pass_on(mut stdin: ChildStdin, questions: &mpsc::Receiver<Vec<u8>>) {
    for bytes in questions {
        if stdin.write_all(&bytes).and_then(|()| stdin.flush()).is_err() {
            break;
        }
    }
}

fn listen(stdout: ChildStdout, max: usize, say: &channel::Sender<Received>) {
    let mut stdout = BufReader::with_capacity(1 << 16, stdout);
    let mut line = Vec::new();
    let first = stdout.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line);
    if first.is_err() || line.is_empty() {
        return;
    }
    let mut received = match String::from_utf8(line) {
        Ok(line) if line.ends_with('\n') => Received::Line(line),
        Ok(_) | Err(_) => Received::Broken("its first line is not the line of its signature".to_owned()),
    };
    loop {
        let is_broken = matches!(received, Received::Broken(_));
        if say.blocking_send(received).is_err() || is_broken {
            return;
        }
        received = match wire::read(&mut stdout, max) {
            Ok(Some(frame)) => Received::Frame(frame),
            Ok(None) => return,
            Err(why) => Received::Broken(why),
        };
    }
}

fn log(stderr: ChildStderr, name: &str, last_stderr_line: &Mutex<String>) {
    let mut stderr = BufReader::new(stderr);
    for logged in 0.. {
        let mut line = Vec::new();
        match stderr.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line) {
            Ok(count) if count > 0 => {}
            Ok(_) | Err(_) => return,
        }
        let line = String::from_utf8_lossy(&line).trim_end().chars().take(300).collect::<String>();
        match logged {
            0..MAX_LOGGED => tracing::info!("`{name}` says: {line}"),
            MAX_LOGGED => tracing::warn!("`{name}` has said {MAX_LOGGED} lines: the others are not logged"),
            _ => {}
        }
        if !line.trim().is_empty() {
            *last_stderr_line.lock().unwrap_or_else(PoisonError::into_inner) = line;
        }
    }
}
