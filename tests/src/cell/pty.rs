//! A pseudo-terminal in the place of a serial port.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::openpty;
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

/// Bytes that are read at once.
const READ_BYTES: usize = 4096;

/// The device's end of a pseudo-terminal. It neither blocks nor keeps more than one message.
pub(super) struct Pty {
    master: File,
    /// Kept open, so that the terminal stays raw when a host closes it.
    _slave: OwnedFd,
    path: PathBuf,
    link: Option<PathBuf>,
    /// The rest of the message that is on its way.
    outbox: Vec<u8>,
}

impl Pty {
    /// Opens a terminal, and makes `link` point to it.
    ///
    /// # Errors
    /// If the operating system gives none, or the link cannot be made.
    pub(super) fn open(link: Option<&Path>) -> io::Result<Self> {
        let pair = openpty(None, None)?;
        let mut settings = tcgetattr(&pair.slave)?;
        cfmakeraw(&mut settings);
        tcsetattr(&pair.slave, SetArg::TCSANOW, &settings)?;
        let flags = OFlag::from_bits_truncate(fcntl(&pair.master, FcntlArg::F_GETFL)?);
        fcntl(&pair.master, FcntlArg::F_SETFL(flags | OFlag::O_NONBLOCK))?;
        let path = ttyname(&pair.slave)?;
        if let Some(link) = link {
            point(link, &path)?;
        }
        let link = link.map(Path::to_owned);
        Ok(Self { master: File::from(pair.master), _slave: pair.slave, path, link, outbox: Vec::new() })
    }

    /// The path under which a host opens it.
    pub(super) fn path(&self) -> &Path {
        self.link.as_deref().unwrap_or(&self.path)
    }

    /// Appends what a host has written to `inbox`, which holds `most` bytes at most.
    ///
    /// # Errors
    /// If the terminal is broken.
    pub(super) fn receive(&mut self, inbox: &mut Vec<u8>, most: usize) -> io::Result<()> {
        let mut bytes = [0; READ_BYTES];
        loop {
            match self.master.read(&mut bytes) {
                Ok(0) => return Ok(()),
                Ok(count) => inbox.extend(bytes[..count].iter().take(most.saturating_sub(inbox.len()))),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Sends a message, unless the last one has not gone out yet. Returns whether it has begun.
    ///
    /// # Errors
    /// If the terminal is broken.
    pub(super) fn send(&mut self, message: &[u8]) -> io::Result<bool> {
        self.flush()?;
        if !self.outbox.is_empty() {
            return Ok(false);
        }
        self.outbox.extend_from_slice(message);
        self.flush()?;
        Ok(true)
    }

    /// Sends the rest of the last message.
    ///
    /// # Errors
    /// If the terminal is broken.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        while !self.outbox.is_empty() {
            match self.master.write(&self.outbox) {
                Ok(count) => drop(self.outbox.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link {
            let _ = fs::remove_file(link);
        }
    }
}

/// Makes a symbolic link in one step, so that nobody finds it missing.
fn point(link: &Path, target: &Path) -> io::Result<()> {
    let new = link.with_extension("new");
    let _ = fs::remove_file(&new);
    symlink(target, &new)?;
    fs::rename(&new, link)
}
