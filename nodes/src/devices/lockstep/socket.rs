//! The line to a simulator: TCP, a message a line, and never a wait without an end.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

/// The longest line [bytes].
const LONGEST: usize = 1 << 20;
/// Time between two attempts to connect: a simulator may be about to start.
const AGAIN: Duration = Duration::from_millis(50);
/// As much is read ahead at most of a simulator that does not wait [bytes].
const AHEAD: usize = 8 << 20;

/// The line to a simulator.
#[derive(Debug)]
pub(super) struct Socket {
    stream: TcpStream,
    /// What was read, from `read` on.
    buffer: Vec<u8>,
    read: usize,
    /// Lines that were taken.
    pub(super) lines: u64,
    /// Whether the rest of a line that is too long is still to come.
    skips: bool,
    /// Whether the simulator has closed its end.
    is_closed: bool,
    patience: Duration,
}

impl Socket {
    /// Connects within `connect`; from then on the simulator may be silent for `patience`.
    ///
    /// # Errors
    /// Why there is no connection.
    pub(super) fn connect(address: &str, connect: Duration, patience: Duration) -> Result<Self, String> {
        let end = Instant::now() + connect;
        loop {
            let why = match attempt(address, end) {
                Ok(stream) => return Self::on(stream, patience).map_err(|error| error.to_string()),
                Err(why) => why,
            };
            if Instant::now() + AGAIN >= end {
                return Err(why);
            }
            std::thread::sleep(AGAIN);
        }
    }

    fn on(stream: TcpStream, patience: Duration) -> std::io::Result<Self> {
        // Each command is one small packet that the simulator waits for.
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(patience))?;
        Ok(Self { stream, buffer: Vec::new(), read: 0, lines: 0, skips: false, is_closed: false, patience })
    }

    /// Sends a line.
    ///
    /// # Errors
    /// Why it cannot be sent.
    pub(super) fn say(&mut self, line: &str) -> Result<(), String> {
        self.stream.write_all(line.as_bytes()).map_err(|error| match error.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                format!("the simulator has taken no command for {}", seconds(self.patience))
            }
            _ => format!("the simulator has closed the connection without an `end` ({error})"),
        })
    }

    /// The next line; waits for it.
    ///
    /// # Errors
    /// If there is none in time, or it will not do.
    pub(super) fn line(&mut self) -> Result<String, String> {
        let patience = self.patience;
        self.line_within(patience)?.ok_or_else(|| format!("the simulator has said nothing for {}", seconds(patience)))
    }

    /// The next line, if it comes within that time.
    ///
    /// # Errors
    /// If it will not do, or none can come any more.
    pub(super) fn line_within(&mut self, time: Duration) -> Result<Option<String>, String> {
        let end = Instant::now() + time;
        loop {
            if let Some(line) = self.take()? {
                return Ok(Some(line));
            }
            if self.is_closed {
                let rest = self.buffer.len() - self.read;
                let middle = if rest > 0 { " in the middle of a message" } else { "" };
                return Err(format!("the simulator has closed the connection without an `end`{middle}"));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.fill(Some(left))?;
        }
    }

    /// The next line, if it is there already; never waits.
    ///
    /// # Errors
    /// If it will not do.
    pub(super) fn line_at_hand(&mut self) -> Result<Option<String>, String> {
        while !self.is_closed && self.buffer.len() - self.read < AHEAD && self.fill(None)? {}
        self.take()
    }

    /// Takes a whole line out of what was read.
    fn take(&mut self) -> Result<Option<String>, String> {
        let rest = &self.buffer[self.read..];
        let end = rest.iter().position(|byte| *byte == b'\n');
        let is_too_long = end.unwrap_or(rest.len()) > LONGEST;
        let Some(end) = end else {
            if is_too_long || self.skips {
                (self.read, self.buffer) = (0, Vec::new());
            }
            let is_news = is_too_long && !self.skips;
            self.skips |= is_too_long;
            return if is_news { Err(self.too_long(1)) } else { Ok(None) };
        };
        if is_too_long || self.skips {
            (self.read, self.lines) = (self.read + end + 1, self.lines + 1);
            return if std::mem::take(&mut self.skips) { self.take() } else { Err(self.too_long(0)) };
        }
        let line = String::from_utf8(rest[..end].to_vec());
        (self.read, self.lines) = (self.read + end + 1, self.lines + 1);
        if self.read == self.buffer.len() || self.read > LONGEST {
            self.buffer.drain(..self.read);
            self.read = 0;
        }
        line.map(Some).map_err(|_| format!("line {}: it is not UTF-8 text", self.lines))
    }

    fn too_long(&self, more: u64) -> String {
        format!("line {}: it is longer than 1 MiB", self.lines + more)
    }

    /// Reads once, waiting for as long as it may; whether anything came.
    fn fill(&mut self, wait: Option<Duration>) -> Result<bool, String> {
        let mut chunk = [0; 1 << 14];
        let setting = match wait {
            Some(wait) => self.stream.set_read_timeout(Some(wait.max(Duration::from_millis(1)))),
            None => self.stream.set_nonblocking(true),
        };
        let result = setting.and_then(|()| self.stream.read(&mut chunk));
        if wait.is_none() {
            self.stream.set_nonblocking(false).map_err(broken)?;
        }
        match result {
            Ok(0) => self.is_closed = true,
            Ok(count) => {
                self.buffer.extend_from_slice(&chunk[..count]);
                return Ok(true);
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) if error.kind() == ErrorKind::ConnectionReset => self.is_closed = true,
            Err(error) => return Err(broken(error)),
        }
        Ok(false)
    }

    /// Says no more, and gives the simulator a moment to read what was said last: to hang up on what it still sends could
    /// take that from it.
    pub(super) fn hang_up(&mut self) {
        const MOMENT: Duration = Duration::from_millis(200);
        if self.stream.shutdown(Shutdown::Write).is_err() {
            return;
        }
        let end = Instant::now() + MOMENT;
        while !self.is_closed && Instant::now() < end {
            self.buffer.clear();
            self.read = 0;
            if self.fill(Some(end.saturating_duration_since(Instant::now()))).is_err() {
                return;
            }
        }
    }
}

fn attempt(address: &str, end: Instant) -> Result<TcpStream, String> {
    let mut why = "the name stands for no address".to_owned();
    for address in address.to_socket_addrs().map_err(|error| error.to_string())? {
        let left = end.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
        match TcpStream::connect_timeout(&address, left) {
            Ok(stream) => return Ok(stream),
            Err(error) => why = error.to_string(),
        }
    }
    Err(why)
}

fn broken(error: std::io::Error) -> String {
    format!("the connection to the simulator broke: {error}")
}

fn seconds(time: Duration) -> String {
    format!("{} s", time.as_secs_f64())
}
