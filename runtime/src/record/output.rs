//! The file of an output, and a thread that writes it: its disk can be full, and its reader slow, frozen or gone.

use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Size of one write to a pipe, so that a slow reader shows progress [bytes].
const PIECE_BYTES: usize = 4096;
/// Interval at which a pipe that takes nothing is tried again.
const RETRY_INTERVAL: Duration = Duration::from_millis(5);
/// Interval at which the end of a thread is awaited.
const POLL_INTERVAL: Duration = Duration::from_micros(200);

/// An open file, pipe or terminal.
pub struct OutputFile {
    file: File,
    is_regular: bool,
    progress: Arc<AtomicU64>,
}

impl OutputFile {
    /// Creates a file, or opens what is there and removes its content.
    ///
    /// # Errors
    /// If that is not possible.
    pub fn create(path: &Path) -> io::Result<Self> {
        Ok(File::create(path)?.into())
    }

    /// Creates a file, or opens what is there and keeps its content until [`clear`](Self::clear).
    ///
    /// # Errors
    /// If that is not possible.
    pub fn open(path: &Path) -> io::Result<Self> {
        Ok(File::options().write(true).create(true).truncate(false).open(path)?.into())
    }

    /// Creates a file after this one, in the same output. An existing file is overwritten only if it begins with `start`.
    ///
    /// # Errors
    /// If it cannot be created, or is of another sort.
    #[cfg(feature = "mcap")]
    pub(crate) fn beside(&self, path: &Path, start: &[u8]) -> io::Result<Self> {
        use std::io::Read;
        let mut head = Vec::new();
        let read = File::open(path).and_then(|file| file.take(start.len() as u64).read_to_end(&mut head));
        if read.is_ok() && !head.is_empty() && head != start {
            let why = format!("`{}` exists and is not a recording, so it is not overwritten", path.display());
            return Err(io::Error::other(why));
        }
        Ok(Self { progress: Arc::clone(&self.progress), ..Self::create(path)? })
    }

    /// Removes the content of a file; a pipe or a device has none.
    ///
    /// # Errors
    /// If that is not possible.
    pub fn clear(&self) -> io::Result<()> {
        if self.is_regular { self.file.set_len(0) } else { Ok(()) }
    }

    /// Writes whole lines and adds their number to `lines` as they are written. After an error, the file ends with a whole
    /// line, if it is a file.
    ///
    /// # Errors
    /// If they cannot be written.
    pub(super) fn write_lines(&mut self, text: &[u8], lines: &AtomicU64) -> io::Result<()> {
        let count = |piece: &[u8]| {
            let ends = piece.iter().filter(|byte| **byte == b'\n').count();
            lines.fetch_add(ends as u64, Ordering::Relaxed);
        };
        self.write_counted(text, count).map_err(|(written, error)| {
            let written = &text[..written];
            let whole = written.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
            if self.is_regular {
                // A file that cannot be shortened ends with a part of a line; the error is reported anyway.
                let cut = (written.len() - whole) as u64;
                let _ = self.file.metadata().and_then(|file| self.file.set_len(file.len().saturating_sub(cut)));
            }
            error
        })
    }

    /// Writes what stands before the first row, or its end.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn write_head(&mut self, text: &[u8]) -> io::Result<()> {
        self.write_counted(text, |_| {}).map_err(|(_, error)| error)
    }

    /// Writes bytes. On an error, returns how many were written before.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), (usize, io::Error)> {
        self.write_counted(bytes, |_| {})
    }

    /// Writes bytes, and passes each piece to `count` once it is written.
    fn write_counted(&mut self, bytes: &[u8], count: impl Fn(&[u8])) -> Result<(), (usize, io::Error)> {
        let size = if self.is_regular { usize::MAX } else { PIECE_BYTES };
        let mut done = 0;
        while done < bytes.len() {
            match self.file.write(&bytes[done..bytes.len().min(done.saturating_add(size))]) {
                Ok(0) => return Err((done, ErrorKind::WriteZero.into())),
                Ok(size) => {
                    count(&bytes[done..done + size]);
                    done += size;
                    self.progress.fetch_add(size as u64, Ordering::Relaxed);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => std::thread::sleep(RETRY_INTERVAL),
                Err(error) => return Err((done, error)),
            }
        }
        Ok(())
    }
}

impl From<File> for OutputFile {
    fn from(file: File) -> Self {
        let is_regular = file.metadata().is_ok_and(|file| file.is_file());
        Self { file, is_regular, progress: Arc::default() }
    }
}

/// A thread that writes a file.
pub(crate) struct Writing<T> {
    thread: JoinHandle<T>,
    progress: Arc<AtomicU64>,
}

impl<T: Send + 'static> Writing<T> {
    /// Starts to write.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub(crate) fn start(
        mut file: OutputFile,
        work: impl FnOnce(&mut OutputFile) -> T + Send + 'static,
    ) -> io::Result<Self> {
        let progress = file.progress.clone();
        let thread = std::thread::Builder::new().name("writer".into()).spawn(move || work(&mut file))?;
        Ok(Self { thread, progress })
    }

    /// Waits for the end while `goes_on` returns true for the number of bytes that have been written. Returns `None` if
    /// it does not end in time.
    ///
    /// # Panics
    /// If the work panicked.
    pub(crate) fn finish(self, mut goes_on: impl FnMut(u64) -> bool) -> Option<T> {
        while !self.thread.is_finished() {
            if !goes_on(self.progress.load(Ordering::Relaxed)) {
                return None;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        Some(self.thread.join().expect("a writer does not panic"))
    }
}

/// Writes a whole file on a thread, while `goes_on` returns true.
///
/// # Errors
/// If it cannot be written, or is not read in time.
pub fn write_whole(file: OutputFile, bytes: Vec<u8>, goes_on: impl FnMut(u64) -> bool) -> io::Result<()> {
    let writing = Writing::start(file, move |file| file.write(&bytes).map_err(|(_, error)| error))?;
    writing.finish(goes_on).unwrap_or_else(|| Err(not_read()))
}

/// The error of a file that was given up.
pub(crate) fn not_read() -> io::Error {
    io::Error::new(ErrorKind::TimedOut, "it was not read in time")
}
