//! The program on the robot: the reverse interface and speedj.

use std::io::{self, Read};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::mpsc::{Receiver, TryRecvError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use super::super::log::Log;
use super::JOINTS;

/// Deceleration of stopj at the end of a program [rad/s²].
pub(super) const STOP_ACCELERATION: f64 = 4.0;
/// Time to open a socket.
const CONNECT: Duration = Duration::from_millis(500);
/// Time that the first message may take.
const FIRST: Duration = Duration::from_secs(2);
/// Messages that may wait to be read.
const MAX_WAITING: usize = 256;
/// Sockets that a script may open.
const MAX_SOCKETS: usize = 8;
const MODE_IDLE: i32 = 0;
const MODE_SPEEDJ: i32 = 2;

/// What the program does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum State {
    /// It moves the joints at these velocities [rad/s].
    Moves([f64; JOINTS]),
    /// A message did not come in time.
    Late,
    /// It was asked to end, or its socket is closed.
    Ended,
}

/// A message: its time limit, six targets and a mode.
type Message = [i32; 8];

/// A program that runs.
pub(super) struct Program {
    messages: Receiver<(Instant, Message)>,
    /// The sockets that the script opens; their ends close them.
    _sockets: Vec<TcpStream>,
    last: Instant,
    /// Time that the next message may take; `None` is any time.
    limit: Option<Duration>,
    state: State,
}

impl Program {
    /// Starts a script: opens its sockets. Messages come over the one whose name begins with `reverse`, or over the
    /// only one; `reverse` replaces its address.
    ///
    /// # Errors
    /// If a socket cannot be opened, or the script opens no reverse interface.
    pub(super) fn start(script: &str, reverse: Option<&str>) -> io::Result<Self> {
        let mut opened = opened(script);
        opened.truncate(MAX_SOCKETS);
        let named = opened.iter().position(|(_, name)| name.starts_with("reverse"));
        let commands = named.or_else(|| (opened.len() == 1).then_some(0));
        let mut sockets = Vec::new();
        for (i, (address, _)) in opened.iter().enumerate() {
            sockets.push(connect(reverse.filter(|_| commands == Some(i)).unwrap_or(address))?);
        }
        let mut stream = match (commands, reverse) {
            (Some(at), _) => sockets[at].try_clone()?,
            (None, Some(address)) => {
                let stream = connect(address)?;
                sockets.push(stream.try_clone()?);
                stream
            }
            (None, None) => return Err(io::Error::other("it opens no socket `reverse_socket`")),
        };
        let (send, messages) = sync_channel(MAX_WAITING);
        thread::Builder::new().name("reverse".into()).spawn(move || {
            let mut bytes = [0; 32];
            while stream.read_exact(&mut bytes).is_ok() {
                let value = |i: usize| i32::from_be_bytes([0, 1, 2, 3].map(|k| bytes[4 * i + k]));
                // The robot's own buffer blocks as well.
                if send.send((Instant::now(), std::array::from_fn(value))).is_err() {
                    return;
                }
            }
        })?;
        let state = State::Moves([0.0; JOINTS]);
        Ok(Self { messages, _sockets: sockets, last: Instant::now(), limit: Some(FIRST), state })
    }

    /// Reads the messages that have arrived. Returns their number.
    ///
    /// # Errors
    /// If the log cannot be written.
    pub(super) fn receive(&mut self, log: &mut Log) -> io::Result<u64> {
        let mut count = 0;
        let is_open = loop {
            match self.messages.try_recv() {
                Ok((arrived, message)) => {
                    count += 1;
                    self.check_time(arrived);
                    self.obey(arrived, message);
                    if let State::Moves(velocity) = self.state {
                        log.command(arrived, true, &velocity)?;
                    }
                }
                Err(TryRecvError::Empty) => break true,
                Err(TryRecvError::Disconnected) => break false,
            }
        };
        self.check_time(Instant::now());
        if !is_open && self.state != State::Late {
            self.state = State::Ended;
        }
        Ok(count)
    }

    /// What it does now.
    pub(super) fn state(&self) -> State {
        self.state
    }

    fn check_time(&mut self, now: Instant) {
        let is_late = self.limit.is_some_and(|limit| now.saturating_duration_since(self.last) > limit);
        if is_late && matches!(self.state, State::Moves(_)) {
            self.state = State::Late;
        }
    }

    fn obey(&mut self, arrived: Instant, [limit, targets @ .., mode]: Message) {
        if !matches!(self.state, State::Moves(_)) {
            return;
        }
        self.last = arrived;
        self.limit = u64::try_from(limit).ok().filter(|ms| *ms > 0).map(Duration::from_millis);
        self.state = match mode {
            MODE_SPEEDJ => State::Moves(targets.map(|target| f64::from(target) / 1e6)),
            MODE_IDLE => State::Moves([0.0; JOINTS]),
            // Everything else is nothing that this controller does: it rests.
            _ => State::Ended,
        };
    }
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let found = address.to_socket_addrs()?.next();
    let found = found.ok_or_else(|| io::Error::other(format!("`{address}` is no address")))?;
    let stream = TcpStream::connect_timeout(&found, CONNECT)?;
    stream.set_nodelay(true)?;
    Ok(stream)
}

/// Returns the sockets that a script opens: `host:port`, and the name; empty without a name.
fn opened(script: &str) -> Vec<(String, String)> {
    let code = script.lines().map(|line| line.split('#').next().unwrap_or_default());
    let calls = code.flat_map(|line| line.split("socket_open(").skip(1).map(|rest| rest.split(')').next()));
    let socket = |call: Option<&str>| {
        let mut arguments = call?.split(',').map(|argument| argument.trim().trim_matches('"'));
        let (host, port) = (arguments.next()?, arguments.next()?);
        port.parse::<u16>().ok()?;
        Some((format!("{host}:{port}"), arguments.next().unwrap_or_default().to_owned()))
    };
    calls.filter_map(socket).collect()
}

#[cfg(test)]
mod tests {
    use std::io::Write;
    use std::net::TcpListener;

    use super::*;

    /// The example of the reverse interface: 20 ms, joint 1 at 0.1 rad/s, joint 6 at -0.1 rad/s, speedj.
    const EXAMPLE: [u8; 32] = [
        0, 0, 0, 0x14, 0, 0x01, 0x86, 0xA0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFE, 0x79, 0x60, 0,
        0, 0, 2,
    ];

    fn program() -> (Program, TcpStream, Log) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let script = format!("def f():\n  socket_open(\"127.0.0.1\", {port}, \"reverse_socket\")\nend\n");
        let program = Program::start(&script, None).unwrap();
        let log = Log::begin(None, JOINTS, Instant::now()).unwrap();
        (program, listener.accept().unwrap().0, log)
    }

    fn until(program: &mut Program, log: &mut Log, is_so: impl Fn(State) -> bool) -> State {
        let end = Instant::now() + Duration::from_secs(10);
        while !is_so(program.state()) && Instant::now() < end {
            program.receive(log).unwrap();
            thread::sleep(Duration::from_millis(1));
        }
        program.state()
    }

    #[test]
    fn the_example_moves_two_joints_until_the_next_message_is_late() {
        let (mut program, mut driver, mut log) = program();
        assert_eq!(program.state(), State::Moves([0.0; 6]));
        // A second to read it on a busy machine.
        let mut patient = EXAMPLE;
        patient[2..4].copy_from_slice(&[0x27, 0x10]);
        driver.write_all(&patient).unwrap();
        let moving = until(&mut program, &mut log, |state| state != State::Moves([0.0; 6]));
        assert_eq!(moving, State::Moves([0.1, 0.0, 0.0, 0.0, 0.0, -0.1]));
        driver.write_all(&EXAMPLE).unwrap();
        assert_eq!(until(&mut program, &mut log, |state| state == State::Late), State::Late);
    }

    #[test]
    fn a_stop_and_a_closed_socket_end_it() {
        let (mut program, mut driver, mut log) = self::program();
        let mut stop = EXAMPLE;
        stop[28..].copy_from_slice(&(-2_i32).to_be_bytes());
        driver.write_all(&stop).unwrap();
        assert_eq!(until(&mut program, &mut log, |state| state == State::Ended), State::Ended);
        let (mut program, driver, mut log) = self::program();
        drop(driver);
        assert_eq!(until(&mut program, &mut log, |state| state == State::Ended), State::Ended);
    }

    #[test]
    fn the_sockets_of_a_script_are_found() {
        let script = "def f():\n  # socket_open(\"1.1.1.1\", 1)\n  socket_open(\"10.0.0.2\", 50001, \"reverse_socket\")\n  \
            if socket_open(\"10.0.0.2\", 50003, \"trajectory_socket\"):\n  end\n  socket_open(HOST, PORT)\nend\n";
        let expected = [("10.0.0.2:50001", "reverse_socket"), ("10.0.0.2:50003", "trajectory_socket")];
        let expected = expected.map(|(address, name)| (address.to_owned(), name.to_owned()));
        assert_eq!(opened(script), expected);
    }
}
