//! Relays between the cell and the tool: cables that swallow what passes, or are cut in the middle of a packet.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, Mutex, OnceLock, Weak};
use std::thread;
use std::time::{Duration, Instant};

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
/// Time that `cut` waits for a packet.
const SILENCE: Duration = Duration::from_secs(1);

/// What the wires of a cable do. Its relays end with it.
#[derive(Default)]
pub(super) struct Cable {
    does: Arc<AtomicU8>,
    /// Locked while bytes pass.
    passing: Arc<Mutex<()>>,
}

impl Cable {
    /// Lets all bytes pass, or swallows them: then no byte passes after it has returned.
    pub(super) fn swallow(&self, swallows: bool) {
        self.does.store(if swallows { SWALLOW } else { PASS }, Ordering::SeqCst);
        self.wait_for_what_passes();
    }

    /// Cuts the next packet in its middle, and swallows the rest. A connection ends there, and there is no other one.
    /// Returns after the cut, which a busy machine may delay. If no packet comes for a second, it only swallows.
    pub(super) fn cut(&self) {
        self.does.store(CUT, Ordering::SeqCst);
        let end = Instant::now() + SILENCE;
        while self.does.load(Ordering::SeqCst) == CUT && Instant::now() < end {
            thread::sleep(IDLE);
        }
        let _ = self.does.compare_exchange(CUT, SWALLOW, Ordering::SeqCst, Ordering::SeqCst);
        self.wait_for_what_passes();
    }

    fn wait_for_what_passes(&self) {
        drop(self.passing.lock());
    }

    fn wire(&self) -> Wire {
        Wire { does: Arc::downgrade(&self.does), passing: Arc::clone(&self.passing) }
    }
}

/// A wire of a cable.
#[derive(Clone)]
struct Wire {
    does: Weak<AtomicU8>,
    passing: Arc<Mutex<()>>,
}

impl Wire {
    fn is_there(&self) -> bool {
        self.does.strong_count() > 0
    }

    fn has_state(&self, state: u8) -> bool {
        self.does.upgrade().is_some_and(|does| does.load(Ordering::SeqCst) == state)
    }

    /// Runs what passes bytes on. The cable can wait for its end.
    fn pass<T>(&self, passes: impl FnOnce() -> T) -> T {
        let _passing = self.passing.lock();
        passes()
    }

    /// Returns how many of so many bytes pass, and whether the cable is cut behind them.
    fn passes(&self, count: usize) -> (usize, bool) {
        let cuts = |does: &AtomicU8| does.compare_exchange(CUT, SWALLOW, Ordering::SeqCst, Ordering::SeqCst).is_ok();
        let is_cut = self.does.upgrade().is_none_or(|does| cuts(&does));
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
                stream.set_write_timeout(Some(SILENCE)).unwrap();
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
        let goes_on = wire.pass(|| {
            let (count, is_cut) = wire.passes(count);
            to.write_all(&bytes[..count]).is_ok() && !is_cut
        });
        if !goes_on {
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
            wire.pass(|| {
                let (count, _) = wire.passes(count);
                if let (Some(to), 1..) = (to.get(), count) {
                    // Nobody may listen yet, or any more.
                    let _ = by.send_to(&bytes[..count], to);
                }
            });
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
            let passed =
                wire.pass(|| move_bytes(&mut device, &mut host, &wire) + move_bytes(&mut host, &mut device, &wire));
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
            // Whoever swallows waits for this.
            Err(_) if wire.has_state(SWALLOW) => return 0,
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::sleep(IDLE),
            Err(_) => return 0,
        }
    }
    count
}
