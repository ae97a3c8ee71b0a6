//! Relays between the cell and the tool: cables that swallow what passes, or are cut in the middle of a packet.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock, Weak};
use std::thread;
use std::time::Duration;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

const PASS: u8 = 0;
const SWALLOW: u8 = 1;
const CUT: u8 = 2;
/// Time between two looks at what may be there.
const IDLE: Duration = Duration::from_millis(1);
/// Time after which a relay without datagrams looks whether its cable is still there.
const LOOK: Duration = Duration::from_millis(50);

/// What the wires of a cable do. Its relays end with it.
#[derive(Default)]
pub(super) struct Cable(Arc<AtomicU8>);

impl Cable {
    /// Lets all bytes pass, or swallows them.
    pub(super) fn swallow(&self, swallows: bool) {
        self.0.store(if swallows { SWALLOW } else { PASS }, Ordering::SeqCst);
    }

    /// Cuts the next packet in its middle, and swallows the rest. A connection ends there, and there is no other one.
    pub(super) fn cut(&self) {
        self.0.store(CUT, Ordering::SeqCst);
    }

    fn wire(&self) -> Wire {
        Wire(Arc::downgrade(&self.0))
    }
}

/// A wire of a cable.
#[derive(Clone)]
struct Wire(Weak<AtomicU8>);

impl Wire {
    fn is_there(&self) -> bool {
        self.0.strong_count() > 0
    }

    fn has_state(&self, state: u8) -> bool {
        self.0.upgrade().is_some_and(|found| found.load(Ordering::SeqCst) == state)
    }

    /// Returns how many of so many bytes pass, and whether the cable is cut behind them.
    fn passes(&self, count: usize) -> (usize, bool) {
        let cuts = |state: &AtomicU8| state.compare_exchange(CUT, SWALLOW, Ordering::SeqCst, Ordering::SeqCst).is_ok();
        let is_cut = self.0.upgrade().is_none_or(|state| cuts(&state));
        match is_cut {
            true => (count / 2, true),
            false => (if self.has_state(PASS) { count } else { 0 }, false),
        }
    }
}

/// Relays TCP connections to a port of this machine. Returns the port on which it accepts them.
pub(super) fn tcp(to: u16, cable: &Cable) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.set_nonblocking(true).unwrap();
    let port = listener.local_addr().unwrap().port();
    let wire = cable.wire();
    thread::spawn(move || {
        while wire.is_there() {
            let Ok((client, _)) = listener.accept() else {
                thread::sleep(IDLE);
                continue;
            };
            let server = TcpStream::connect(("127.0.0.1", to));
            let Some(server) = server.ok().filter(|_| wire.has_state(PASS)) else { continue };
            for stream in [&client, &server] {
                stream.set_nodelay(true).unwrap();
            }
            let ends = [(&client, &server), (&server, &client)];
            for (from, to) in ends.map(|(from, to)| (from.try_clone().unwrap(), to.try_clone().unwrap())) {
                let wire = wire.clone();
                thread::spawn(move || follow(from, to, &wire));
            }
        }
    });
    port
}

/// Relays what one end of a connection sends to the other end, until one of them ends.
fn follow(mut from: TcpStream, mut to: TcpStream, wire: &Wire) {
    let mut bytes = [0; 4096];
    while let Ok(count @ 1..) = from.read(&mut bytes) {
        let (count, is_cut) = wire.passes(count);
        if to.write_all(&bytes[..count]).is_err() || is_cut {
            break;
        }
    }
    for end in [from, to] {
        // The other direction may have ended it.
        let _ = end.shutdown(Shutdown::Both);
    }
}

/// Relays datagrams to a port of this machine, and the answers back. Returns the port on which it receives them.
pub(super) fn udp(to: u16, cable: &Cable) -> u16 {
    let [near, far] = [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    let port = near.local_addr().unwrap().port();
    let back = Arc::new(OnceLock::new());
    let there = Arc::new(OnceLock::from(SocketAddr::from(([127, 0, 0, 1], to))));
    let [near_again, far_again] = [&near, &far].map(|socket| socket.try_clone().unwrap());
    pass_datagrams((near, far), Some(Arc::clone(&back)), there, cable.wire());
    pass_datagrams((far_again, near_again), None, back, cable.wire());
    port
}

/// Passes the datagrams of one socket on by another one, to an address that may not be known yet. `origin` is to become the
/// address that they come from.
fn pass_datagrams(
    (from, by): (UdpSocket, UdpSocket),
    origin: Option<Arc<OnceLock<SocketAddr>>>,
    to: Arc<OnceLock<SocketAddr>>,
    wire: Wire,
) {
    from.set_read_timeout(Some(LOOK)).unwrap();
    thread::spawn(move || {
        let mut bytes = [0; 2000];
        while wire.is_there() {
            let Ok((count, sender)) = from.recv_from(&mut bytes) else { continue };
            origin.as_ref().map(|origin| origin.set(sender));
            let (count, _) = wire.passes(count);
            if let (Some(to), 1..) = (to.get(), count) {
                // Nobody may listen yet, or any more.
                let _ = by.send_to(&bytes[..count], to);
            }
        }
    });
}

/// Relays a terminal to another one. Returns its path, and its end, which stays raw while it is open.
pub(super) fn terminal(of: &Path, cable: &Cable) -> (PathBuf, OwnedFd) {
    let pair = openpty(None, None).unwrap();
    let mut settings = tcgetattr(&pair.slave).unwrap();
    cfmakeraw(&mut settings);
    tcsetattr(&pair.slave, SetArg::TCSANOW, &settings).unwrap();
    let path = ttyname(&pair.slave).unwrap();
    let device = OpenOptions::new().read(true).write(true).open(of).unwrap();
    let host = File::from(pair.master);
    for file in [&device, &host] {
        let flags = OFlag::from_bits_truncate(fcntl(file, FcntlArg::F_GETFL).unwrap());
        fcntl(file, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK)).unwrap();
    }
    let wire = cable.wire();
    thread::spawn(move || {
        let (mut device, mut host) = (device, host);
        while wire.is_there() {
            let passed = move_bytes(&mut device, &mut host, &wire) + move_bytes(&mut host, &mut device, &wire);
            if passed == 0 {
                thread::sleep(IDLE);
            }
        }
    });
    (path, pair.slave)
}

/// Moves what waits from one terminal to another. Returns the number of bytes.
fn move_bytes(from: &mut File, to: &mut File, wire: &Wire) -> usize {
    let mut bytes = [0; 4096];
    let Ok(count) = from.read(&mut bytes) else { return 0 };
    let mut rest = &bytes[..wire.passes(count).0];
    while !rest.is_empty() && wire.is_there() {
        match to.write(rest) {
            Ok(count) => rest = &rest[count..],
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(IDLE),
            Err(_) => return 0,
        }
    }
    count
}
