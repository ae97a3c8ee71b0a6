//! The TCP connection to a simulator: one message per line, and a limit on every wait.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::net::{Shutdown, TcpStream, ToSocketAddrs};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use super::lines::Lines;

/// Time between two attempts to connect to a simulator that is starting.
const RETRY_PERIOD: Duration = Duration::from_millis(50);
/// Minimum timeout of a call of the operating system, where 0 would be no timeout.
const MIN_TIMEOUT: Duration = Duration::from_millis(1);
/// Longest time between two looks at whether the operator ends the run.
const LOOK: Duration = Duration::from_millis(20);
/// Maximum time to wait for the simulator when the operator ends the run.
const LAST_WAIT: Duration = Duration::from_millis(200);

/// The connection to a simulator.
#[derive(Debug)]
pub(super) struct Socket {
    stream: BufReader<TcpStream>,
    lines: Lines,
    /// Whether the simulator has closed its end.
    is_closed: bool,
    timeout: Duration,
    /// Whether the operator ends the run; `None` before the run.
    is_ending: Option<&'static AtomicBool>,
}

impl Socket {
    /// Connects within the time `connect`. Later the simulator may be silent for `timeout`.
    ///
    /// # Errors
    /// Why there is no connection.
    pub(super) fn connect(address: &str, connect: Duration, timeout: Duration) -> Result<Self, String> {
        let end = Instant::now() + connect;
        loop {
            let why = match attempt(address, end) {
                Ok(stream) => return Self::new(stream, timeout).map_err(|error| error.to_string()),
                Err(why) => why,
            };
            if Instant::now() + RETRY_PERIOD >= end {
                return Err(why);
            }
            std::thread::sleep(RETRY_PERIOD);
        }
    }

    fn new(stream: TcpStream, timeout: Duration) -> std::io::Result<Self> {
        // Each command is one small packet that the simulator waits for.
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(LOOK))?;
        let stream = BufReader::with_capacity(1 << 16, stream);
        Ok(Self { stream, lines: Lines::default(), is_closed: false, timeout, is_ending: None })
    }

    /// Sends a line.
    ///
    /// # Errors
    /// Why it cannot be sent.
    pub(super) fn send(&mut self, line: &str) -> Result<(), String> {
        let (begin, mut rest) = (Instant::now(), line.as_bytes());
        while !rest.is_empty() {
            match self.stream.get_mut().write(rest) {
                Ok(count) => rest = &rest[count..],
                Err(error) => match error.kind() {
                    ErrorKind::Interrupted => {}
                    ErrorKind::WouldBlock | ErrorKind::TimedOut if begin.elapsed() < self.patience() => {}
                    ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                        return Err(format!(
                            "the simulator has read no command for {} s",
                            self.patience().as_secs_f64()
                        ));
                    }
                    _ => return Err(format!("the simulator has closed the connection without an `end` ({error})")),
                },
            }
        }
        Ok(())
    }

    /// Watches a flag that is set when the operator ends the run. The waits for the simulator are short then.
    pub(super) const fn watch(&mut self, is_ending: &'static AtomicBool) {
        self.is_ending = Some(is_ending);
    }

    /// Returns how long to wait for the simulator.
    fn patience(&self) -> Duration {
        let is_ending = self.is_ending.is_some_and(|flag| flag.load(Ordering::Acquire));
        if is_ending { self.timeout.min(LAST_WAIT) } else { self.timeout }
    }

    /// Waits for the next line.
    ///
    /// # Errors
    /// If no line arrives in time, or if it is not valid.
    pub(super) fn line(&mut self) -> Result<String, String> {
        let begin = Instant::now();
        loop {
            if let Some(line) = self.line_within(LOOK)? {
                return Ok(line);
            }
            let patience = self.patience();
            if begin.elapsed() >= patience {
                return Err(format!("the simulator has sent nothing for {} s", patience.as_secs_f64()));
            }
        }
    }

    /// Waits for the next line for a `time`.
    ///
    /// # Errors
    /// If the line is not valid, or if the connection is closed.
    pub(super) fn line_within(&mut self, time: Duration) -> Result<Option<String>, String> {
        let end = Instant::now() + time;
        loop {
            if let Some(line) = self.take_line()? {
                return Ok(Some(line));
            }
            if self.is_closed {
                return Err(closed(&self.lines));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.receive(left)?;
        }
    }

    /// Takes a whole line from the bytes that have arrived.
    fn take_line(&mut self) -> Result<Option<String>, String> {
        loop {
            let (taken, line) = self.lines.feed(self.stream.buffer());
            self.stream.consume(taken);
            if self.stream.buffer().is_empty() || line != Ok(None) {
                return line;
            }
        }
    }

    /// Returns the number of lines received.
    pub(super) fn lines(&self) -> u64 {
        self.lines.count
    }

    /// Returns the connection for a driver that waits for several things at once, the bytes that have arrived, and the
    /// line in which they are.
    ///
    /// # Errors
    /// If the connection is broken.
    pub(super) fn into_parts(self) -> std::io::Result<(TcpStream, Vec<u8>, Lines)> {
        let arrived = self.stream.buffer().to_vec();
        let stream = self.stream.into_inner();
        stream.set_nonblocking(true)?;
        Ok((stream, arrived, self.lines))
    }

    /// Waits for bytes for at most `time`.
    fn receive(&mut self, time: Duration) -> Result<(), String> {
        self.stream.get_ref().set_read_timeout(Some(time.max(MIN_TIMEOUT))).map_err(broken)?;
        self.receive_some().map(|_| ())
    }

    /// Receives bytes. Returns whether any arrived.
    fn receive_some(&mut self) -> Result<bool, String> {
        match self.stream.fill_buf() {
            Ok([]) => self.is_closed = true,
            Ok(_) => return Ok(true),
            Err(error) => match error.kind() {
                ErrorKind::Interrupted | ErrorKind::WouldBlock | ErrorKind::TimedOut => {}
                ErrorKind::ConnectionReset => self.is_closed = true,
                _ => return Err(broken(error)),
            },
        }
        Ok(false)
    }

    /// Closes the own end, and gives the simulator a moment to read the last message. A connection that is dropped
    /// while the simulator still sends could lose that message.
    pub(super) fn close(&mut self) {
        const MOMENT: Duration = Duration::from_millis(200);
        if self.stream.get_ref().shutdown(Shutdown::Write).is_err() {
            return;
        }
        let end = Instant::now() + MOMENT;
        while !self.is_closed && Instant::now() < end {
            self.stream.consume(self.stream.buffer().len());
            if self.receive(end.saturating_duration_since(Instant::now())).is_err() {
                return;
            }
        }
    }
}

fn attempt(address: &str, end: Instant) -> Result<TcpStream, String> {
    let mut why = "the host name has no address".to_owned();
    for address in address.to_socket_addrs().map_err(|error| error.to_string())? {
        let left = end.saturating_duration_since(Instant::now()).max(MIN_TIMEOUT);
        match TcpStream::connect_timeout(&address, left) {
            Ok(stream) => return Ok(stream),
            Err(error) => why = error.to_string(),
        }
    }
    Err(why)
}

/// Returns the message of a connection that the simulator has closed.
pub(super) fn closed(lines: &Lines) -> String {
    let middle = if lines.is_in_a_line() { " in the middle of a message" } else { "" };
    format!("the simulator has closed the connection without an `end`{middle}")
}

/// Returns the message of a connection that broke.
pub(super) fn broken(error: std::io::Error) -> String {
    format!("the connection to the simulator broke: {error}")
}
